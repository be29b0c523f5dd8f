"""The compiled inverse of a Prandtl-Ishlinskii model with creep and bends, sample by sample."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest._jit import UNCOUNTED, compiled
from piezoest.compensators.layout import CONFIG, DECAY, MISSED, OFFSET, OWED, SAMPLES, STATE, VOLTAGE, C
from piezoest.compensators.voltage import limited, remember_voltage
from piezoest.equations.bent_plays import (
    bent_plays_output,
    bent_plays_step,
    prandtl_ishlinskii_voltage,
)
from piezoest.equations.creep import creep_to_come, unit_creep_step

# After the configuration that all models share: how many plays, creep terms and bends, then
# thresholds, weights, creep gains, decays, bends and their weights.
PLAYS, TERMS, BENDS, ARRAYS = CONFIG, CONFIG + 1, CONFIG + 2, CONFIG + 3


@register_jitable
def _voltage(
    state: Any, config: Any, r: Any, y: Any, z: Any, thresholds: Any, weights: Any, gains: Any, decays: Any,
    bends: Any, changes: Any,
) -> Any:  # fmt: skip
    """Voltage for the next reference sample; plays and creep follow the voltage really given out."""
    state[SAMPLES] += 1.0
    u = state[VOLTAGE]
    if np.abs(r) < WILDEST:
        state[OWED] *= config[DECAY]
        held, share = creep_to_come(z, gains, decays)
        w = (r - state[OWED] - config[OFFSET] - held) / (1.0 + share)
        wanted = prandtl_ishlinskii_voltage(y, u, w, config[C], thresholds, weights, bends, changes)
        u = limited(state, config, r, wanted)
        remember_voltage(state, u)
    else:
        state[MISSED] += 1.0
    w = bent_plays_step(y, u, config[C], thresholds, weights, bends, changes)
    # Creep goes on while the voltage is held, too.
    unit_creep_step(z, w, decays)
    return u


@register_jitable
def _parts(state: Any, config: Any) -> Any:
    """Plays, creep states, thresholds, weights, creep gains, decays, bends and their weights."""
    n = int(config[PLAYS])
    m = int(config[TERMS])
    b = int(config[BENDS])
    gains = ARRAYS + 2 * n
    bends = gains + 2 * m
    changes = bends + b
    return (
        state[STATE : STATE + n],
        state[STATE + n : STATE + n + m],
        config[ARRAYS : ARRAYS + n],
        config[ARRAYS + n : gains],
        config[gains : gains + m],
        config[gains + m : bends],
        config[bends:changes],
        config[changes : changes + b * (n + 1)],
    )


@compiled("void(f8[::1], f8[::1], f8[::1], f8[::1])", **UNCOUNTED)
def run(state: Any, config: Any, r: Any, u: Any) -> None:
    """Voltages `u` for a whole reference `r`."""
    y, z, thresholds, weights, gains, decays, bends, changes = _parts(state, config)
    for k in range(r.size):
        u[k] = _voltage(state, config, r[k], y, z, thresholds, weights, gains, decays, bends, changes)


@compiled("f8(f8[::1], f8[::1], f8)", **UNCOUNTED)
def step(state: Any, config: Any, r: float) -> Any:
    """Voltage for one sample of the reference."""
    return _voltage(state, config, r, *_parts(state, config))


@compiled("f8(f8[::1], f8[::1])", **UNCOUNTED)
def expected(state: Any, config: Any) -> Any:
    """Displacement that the model expects of the last sample [µm]."""
    n, m, b = int(config[PLAYS]), int(config[TERMS]), int(config[BENDS])
    gains = ARRAYS + 2 * n
    bends = gains + 2 * m
    x = bent_plays_output(
        state[STATE : STATE + n],
        state[VOLTAGE],
        config[C],
        config[ARRAYS + n : gains],
        config[bends : bends + b],
        config[bends + b :],
    )
    for i in range(m):
        x += config[gains + i] * state[STATE + n + i]
    return x + config[OFFSET]
