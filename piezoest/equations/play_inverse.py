"""The inverse of a Prandtl-Ishlinskii model with creep and bends, sample by sample.

Source: P. Krejci, K. Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185-192.
`piezoest.compensators.inverse_kernel` says what each function is for.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.equations.bent_plays import bent_plays_output, bent_plays_step, prandtl_ishlinskii_voltage
from piezoest.equations.creep import creep_to_come, unit_creep_step
from piezoest.equations.turning_points import recall
from piezoest.layout import FIXED, MEASURED, Length, Record, numbers, record


def layouts(settings: dict[str, Any]) -> tuple[Record, Record]:
    """Layouts of ``state.inverse`` and ``settings.inverse``: play states y [V] and creep states z [µm]."""
    plays = Length("plays", settings["thresholds"].size)
    terms = Length("terms", settings["creep_gains"].size)
    bends = Length("bend_count", settings["bends"].size)
    changes = Length("bend_weight_count", settings["bend_weights"].size)
    state = record(__name__, y=numbers(plays, kind=MEASURED), z=numbers(terms, kind=MEASURED))
    return state, record(
        gain=FIXED, offset=FIXED,
        thresholds=numbers(plays, kind=FIXED), weights=numbers(plays, kind=FIXED),
        creep_gains=numbers(terms, kind=FIXED), decays=numbers(terms, kind=FIXED),
        bends=numbers(bends, kind=FIXED), bend_weights=numbers(changes, kind=FIXED),
    )  # fmt: skip


@register_jitable
def wanted(state: Any, settings: Any, r: Any) -> Any:
    """Voltage that moves the displacement to r."""
    own, model = state.inverse, settings.inverse
    held, share = creep_to_come(own.z, model.creep_gains, model.decays)
    w = (r - model.offset - held) / (1.0 + share)
    return prandtl_ishlinskii_voltage(
        own.y, state.voltage, w, model.gain, model.thresholds, model.weights, model.bends, model.bend_weights
    )


@register_jitable
def follow(state: Any, settings: Any, wanted: Any, given: Any) -> None:
    """Update plays and creep with the voltage; creep continues while the voltage is held."""
    own, model = state.inverse, settings.inverse
    w = bent_plays_step(
        own.y, given, model.gain, model.thresholds, model.weights, model.bends, model.bend_weights
    )
    unit_creep_step(own.z, w, model.decays)


@register_jitable
def expected(state: Any, settings: Any) -> Any:
    """Displacement at the last voltage [µm]."""
    own, model = state.inverse, settings.inverse
    x = bent_plays_output(own.y, state.voltage, model.gain, model.weights, model.bends, model.bend_weights)
    for i in range(len(own.z)):
        x += model.creep_gains[i] * own.z[i]
    return x + model.offset


@register_jitable
def place(state: Any, settings: Any) -> None:
    """Set the plays from the turning points of the voltage."""
    for i in range(len(state.inverse.y)):
        state.inverse.y[i] = recall(state.memory, settings.inverse.thresholds[i])


def stays(before: Any, now: Any) -> bool:
    """Whether the states of a model with settings `before` are valid for settings `now`."""
    return before["decays"].size == now["decays"].size and np.array_equal(
        before["thresholds"], now["thresholds"]
    )
