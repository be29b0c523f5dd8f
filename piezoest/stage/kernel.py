"""The compiled loops of a simulated stage, over flat vectors.

No part acts back on the one before it, so a record passes through the parts one after the
other, each in its own short loop; sample by sample the result is the same to the bit.
"""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from piezoest._jit import UNCOUNTED, compiled
from piezoest.equations.coleman_hodgdon import hysteresis_step
from piezoest.equations.creep import creep_step
from piezoest.equations.mechanics import mechanics_step
from piezoest.equations.play import prandtl_ishlinskii_step
from piezoest.equations.preisach import preisach_step
from piezoest.stage.instruments import amplifier_step, gauge_step

# The state vector, in this order:
SAMPLE = 5  # voltage or displacement, noise, factor, shape and reading of a single sample
AMPLIFIER = SAMPLE + 2
AMPLIFIER_FILTER = AMPLIFIER + 2
COLEMAN_HODGDON = AMPLIFIER_FILTER + 2  # last voltage, w_h
MECHANICS = COLEMAN_HODGDON + 2  # displacement, velocity
GAUGE_FILTER = MECHANICS + 2  # then the plays, the creep terms, the delay line

# The settings vector, in this order:
AMPLIFIER_SETTINGS = 4
AMPLIFIER_COEFFICIENTS = AMPLIFIER_SETTINGS + 5
HYSTERESIS_SETTINGS = AMPLIFIER_COEFFICIENTS + 6  # gain, a, b, centre, width, offset
MECHANICS_SETTINGS = HYSTERESIS_SETTINGS + 6
GAUGE_SETTINGS = MECHANICS_SETTINGS + 5
GAUGE_COEFFICIENTS = GAUGE_SETTINGS + 5  # then thresholds, weights, creep gains, creep decays


@register_jitable
def _amplify(x: Any, state: Any, filter_state: Any, settings: Any, coefficients: Any) -> None:
    for k in range(x.size):
        x[k] = amplifier_step(state, filter_state, x[k], settings, coefficients)


@register_jitable
def _coleman_hodgdon_step(w_h: Any, du: Any, a: Any, b: Any) -> Any:
    # The exponentials are left out for the models that have no such part.
    return hysteresis_step(w_h, du, a, b) if a != 0.0 else 0.0


@register_jitable
def _deform(
    x: Any, factor: Any, shape: Any, memory: Any, settings: Any, plays: Any, thresholds: Any, weights: Any
) -> None:
    """Voltage to displacement without offset: the models are cases of gain u + plays + w_h.

    A width above zero is that of a Preisach density, through which the plays then go.
    `factor` scales all of it, `shape` the plays and w_h alone; where they are 1 the result
    is that of the models, to the bit.
    """
    every = int(factor.size > 1)  # one value serves all samples
    every_shape = int(shape.size > 1)
    for k in range(x.size):
        u = x[k]
        if settings[4] > 0.0:
            w = preisach_step(plays, u, settings[0], thresholds, weights, settings[3], settings[4])
        else:
            w = prandtl_ishlinskii_step(plays, u, settings[0], thresholds, weights)
        memory[1] = _coleman_hodgdon_step(memory[1], u - memory[0], settings[1], settings[2])
        memory[0] = u
        w = w + memory[1]
        x[k] = factor[k * every] * (w + (shape[k * every_shape] - 1.0) * (w - settings[0] * u))


@register_jitable
def _creep(x: Any, z: Any, gains: Any, decays: Any, offset: Any) -> None:
    for k in range(x.size):
        x[k] = x[k] + creep_step(z, x[k], gains, decays) + offset


@register_jitable
def _move(x: Any, state: Any, coefficients: Any) -> None:
    for k in range(x.size):
        x[k] = mechanics_step(state, x[k], coefficients)


@register_jitable
def _measure(
    x: Any, noise: Any, measured: Any, filter_state: Any, line: Any, settings: Any, coefficients: Any
) -> None:
    every = int(noise.size > 1)
    for k in range(x.size):
        measured[k] = gauge_step(filter_state, line, x[k], noise[k * every], settings, coefficients)


@compiled("void(f8[::1], f8[::1], i8, i8, f8[::1], f8[::1], f8[::1], f8[::1], f8[::1])", **UNCOUNTED)
def run(
    state: Any,
    settings: Any,
    plays: int,
    terms: int,
    x: Any,
    noise: Any,
    factor: Any,
    shape: Any,
    measured: Any,
) -> None:
    """Run a record through a stage of so many plays and creep terms.

    `x` (N,) comes as voltage and goes as true displacement; `state` and `measured` (N,) are
    written; `noise`, `factor` and `shape` are of shape (N,), or (1,) for the same value
    throughout.
    """
    creep = GAUGE_FILTER + plays
    line = creep + terms
    weights = GAUGE_COEFFICIENTS + plays
    gains = weights + plays
    decays = gains + terms
    _amplify(
        x,
        state[SAMPLE:AMPLIFIER],
        state[AMPLIFIER:AMPLIFIER_FILTER],
        settings[:AMPLIFIER_SETTINGS],
        settings[AMPLIFIER_SETTINGS:AMPLIFIER_COEFFICIENTS],
    )
    _deform(
        x,
        factor,
        shape,
        state[AMPLIFIER_FILTER:COLEMAN_HODGDON],
        settings[AMPLIFIER_COEFFICIENTS:HYSTERESIS_SETTINGS],
        state[GAUGE_FILTER:creep],
        settings[GAUGE_COEFFICIENTS:weights],
        settings[weights:gains],
    )
    _creep(x, state[creep:line], settings[gains:decays], settings[decays:], settings[HYSTERESIS_SETTINGS - 1])
    _move(x, state[COLEMAN_HODGDON:MECHANICS], settings[HYSTERESIS_SETTINGS:MECHANICS_SETTINGS])
    _measure(
        x,
        noise,
        measured,
        state[MECHANICS:GAUGE_FILTER],
        state[line:],
        settings[MECHANICS_SETTINGS:GAUGE_SETTINGS],
        settings[GAUGE_SETTINGS:GAUGE_COEFFICIENTS],
    )


@compiled("UniTuple(f8, 2)(f8[::1], f8[::1], i8, i8, f8, f8, f8, f8)", **UNCOUNTED)
def step(
    state: Any, settings: Any, plays: int, terms: int, u: float, noise: float, factor: float, shape: float
) -> tuple[float, float]:
    """(measured, true) displacement after one sample: `run` with a record of one."""
    state[0] = u
    state[1] = noise
    state[2] = factor
    state[3] = shape
    run(state, settings, plays, terms, state[0:1], state[1:2], state[2:3], state[3:4], state[4:5])
    return state[4], state[0]
