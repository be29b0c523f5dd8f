"""The compiled loops of a simulated stage: amplifier, hysteresis, creep, mechanics, gauge.

The parts come one after the other, each in its own short loop, as none acts back on the one before
it: sample by sample the result is the same to the bit. All stages have one layout but for the hysteresis, the
number of creep terms and the delay. What a stage does without has numbers that leave the signal as it is.

A model's ``stage_layouts(settings)`` are the layouts of its state and of its numbers (`stage_settings`), of
which ``gain`` is the slope of its linear term; the former names the module with ``deform(own, settings, u)``,
the displacement without offset after the next voltage. Models without it are those of `hysteresis_layouts`,
which one machine code serves.
"""

from typing import Any

from numba.extending import register_jitable

from piezoest.compile import Record, Vector, compiled, local
from piezoest.equations.coleman_hodgdon import hysteresis_step
from piezoest.equations.creep import creep_step
from piezoest.equations.mechanics import mechanics_step
from piezoest.equations.play import prandtl_ishlinskii_step
from piezoest.equations.preisach import preisach_step
from piezoest.layout import FIXED, MEASURED, NUMBER, Length, numbers, record
from piezoest.layout import Record as Layout
from piezoest.stage import instruments


def hysteresis_layouts(settings: dict[str, Any]) -> tuple[Layout, Layout]:
    """Layouts of state and settings of a sum of a line, plays and w_h; what `settings` leaves out is zero."""
    plays = Length("plays", len(settings.get("weights", ())))
    each = numbers(plays, kind=FIXED)
    # Last voltage [V], w_h [µm], states of the plays [V].
    state = record(__name__, u=MEASURED, w_h=NUMBER, y=numbers(plays))
    return state, record(
        gain=FIXED, a=FIXED, b=FIXED, centre=FIXED, width=FIXED, thresholds=each, weights=each
    )


def state_layout(hysteresis: Layout, terms: int, delay: int) -> Layout:
    """Layout of the state of a stage with so many creep terms and samples of delay."""
    return record(
        amplifier=instruments.AMPLIFIER,
        hysteresis=hysteresis,
        creep=record(z=numbers(Length("terms", terms))),
        mechanics=numbers(2),  # displacement [µm] and velocity [µm/s]
        gauge=instruments.gauge_layout(delay),
    )


def settings_layout(hysteresis: Layout, terms: int) -> Layout:
    """Layout of the settings of a stage with so many creep terms."""
    each = numbers(Length("terms", terms), kind=FIXED)
    return record(
        amplifier=instruments.AMPLIFIER_SETTINGS,
        hysteresis=hysteresis,
        creep=record(gains=each, decays=each),
        offset=FIXED,
        mechanics=numbers(6, kind=FIXED),
        gauge=instruments.GAUGE_SETTINGS,
    )


@register_jitable
def deform(own: Any, settings: Any, u: Any) -> Any:
    """Displacement after the next voltage: the models are cases of gain u + plays + w_h.

    A width above zero is that of a Preisach density, through which the plays then go.
    """
    y, thresholds, weights = own.y, settings.thresholds, settings.weights
    if settings.width > 0.0:
        w = preisach_step(y, u, settings.gain, thresholds, weights, settings.centre, settings.width)
    else:
        w = prandtl_ishlinskii_step(y, u, settings.gain, thresholds, weights)
    if settings.a != 0.0:  # the models without w_h do without its exponential
        own.w_h = hysteresis_step(own.w_h, u - own.u, settings.a, settings.b)
    own.u = u
    return w + own.w_h


@register_jitable
def _deform(x: Any, factor: Any, shape: Any, state: Any, settings: Any) -> None:
    """Voltage to displacement without offset.

    `factor` scales all of it, `shape` what is not linear; where they are 1 the result is that of the model,
    to the bit.
    """
    # One value serves all samples.
    every, every_shape = int(len(factor) > 1), int(len(shape) > 1)
    for k in range(len(x)):
        u = x[k]
        w = state.deform(state, settings, u)
        x[k] = factor[k * every] * (w + (shape[k * every_shape] - 1.0) * (w - settings.gain * u))


@register_jitable
def _through(state: Any, settings: Any, x: Any, noise: Any, factor: Any, shape: Any, measured: Any) -> None:
    """Run a record through the parts.

    `x` (N,) comes as voltage and goes as true displacement; `measured` (N,) is written; `noise`, `factor` and
    `shape` are of shape (N,), or (1,) for the same value throughout.
    """
    for k in range(len(x)):
        x[k] = instruments.amplifier_step(state.amplifier, settings.amplifier, x[k])
    _deform(x, factor, shape, state.hysteresis, settings.hysteresis)
    z, creep = state.creep.z, settings.creep
    for k in range(len(x)):
        x[k] = x[k] + creep_step(z, x[k], creep.gains, creep.decays) + settings.offset
    for k in range(len(x)):
        x[k] = mechanics_step(state.mechanics, x[k], settings.mechanics)
    every, line = int(len(noise) > 1), state.gauge.line
    for k in range(len(x)):
        measured[k] = instruments.gauge_step(state.gauge, line, settings.gauge, x[k], noise[k * every])


@compiled
def run(
    state: Record, settings: Record, x: Vector, noise: Vector, factor: Vector, shape: Vector, measured: Vector
) -> None:
    """Run a record through a stage."""
    _through(state, settings, x, noise, factor, shape, measured)


@compiled
def step(state: Record, settings: Record, u: float, noise: float, factor: float, shape: float) -> Any:
    """(measured, true) displacement after one sample: `run` with a record of one."""
    x, noises, factors, shapes, measured = local(1), local(1), local(1), local(1), local(1)
    x[0], noises[0], factors[0], shapes[0] = u, noise, factor, shape
    _through(state, settings, x, noises, factors, shapes, measured)
    return measured[0], x[0]
