"""From a reference to the voltage, sample by sample, whatever model is inverted.

What depends on the model stands in the module that its class names as ``inverse``, such as
`piezoest.equations.loop_inverse`. It keeps its own numbers in ``state.inverse`` and ``settings.inverse``:

- ``layouts(settings)``: layouts of both, for a model's ``inverse_settings``; the first names the module;
- ``wanted(state, settings, r)``: voltage that moves the displacement to r, ``state.voltage`` being the last;
- ``follow(state, settings, wanted, given)``: remember the voltage that was given out instead;
- ``expected(state, settings)``: displacement at the last voltage;
- ``place(state, settings)``: find its numbers from ``state.path`` and ``state.memory``;
- ``stays(before, now)``, if it has any: in Python, whether other settings leave them as they are;
- ``change(state, settings, new)`` and ``proposed(model, hysteretic, new)``, if it has any: use other
  settings within compiled code, which then can be handed a model.
"""

import functools
from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.compensators import corridor
from piezoest.compile import Record, Vector, compiled, local
from piezoest.equations import recent_path
from piezoest.equations.turning_points import TURNING_POINTS, remember
from piezoest.layout import COUNT, FIXED, MEASURED, NUMBER, SIGN, record

# Beyond this a voltage is what the inverse of no stage asks for.
BEYOND = 1e100


@functools.cache
def layouts(own_state: Any, own_settings: Any) -> tuple[Any, Any]:
    """Layouts of state and settings around those of a model's inverse."""
    state = record(
        voltage=MEASURED,
        owed=NUMBER,  # what the last change of model still owes [µm]
        samples=COUNT, saturated=COUNT, slewed=COUNT, missing=COUNT,
        limited=SIGN,  # of what the limits withhold now
        # The voltage's recent path, and its turning points that are not wiped out.
        path=recent_path.PATH, memory=TURNING_POINTS,
        corridor=corridor.CORRIDOR, inverse=own_state,
    )  # fmt: skip
    settings = record(
        minimum=NUMBER, maximum=NUMBER, largest_step=NUMBER,
        decay=FIXED,  # of what is owed, from sample to sample
        # Of a hysteresis: whether (17) is integrated, whether a new model is placed by the voltage's path.
        integrated=FIXED, by_path=FIXED, inverse=own_settings,
    )  # fmt: skip
    return state, settings


@register_jitable
def voltage(state: Any, settings: Any, r: Any) -> Any:
    """Voltage for the next reference sample; the state follows the voltage really given out."""
    state.samples += 1.0
    if np.abs(r) < WILDEST:
        state.owed *= settings.decay
        wanted = state.inverse.wanted(state, settings, r - state.owed)
        given = _limited(state, settings, r, wanted)
        state.inverse.follow(state, settings, wanted, given)
        state.voltage = given
        recent_path.follow(state.path, given)
        remember(state.memory, given)
    else:
        state.missing += 1.0
        state.inverse.follow(state, settings, np.nan, state.voltage)
    return state.voltage


@register_jitable
def _limited(state: Any, settings: Any, r: Any, wanted: Any) -> Any:
    """The voltage wanted, as far as corridor, slew rate and range allow it; a finite one."""
    u = state.voltage
    if not np.abs(wanted) < BEYOND:
        wanted = u
    inside = corridor.kept(state.corridor, settings, r, wanted)
    slewed = min(max(inside, u - settings.largest_step), u + settings.largest_step)
    given = min(max(slewed, settings.minimum), settings.maximum)
    state.slewed += slewed != inside
    state.saturated += given != slewed
    state.limited = np.sign(wanted - given)
    corridor.follow(state.corridor, given, (slewed != inside) * 1.0)
    return given


@register_jitable
def change_model(state: Any, settings: Any, new: Any) -> None:
    """Use other settings of the inverse without a bump: what they make of the voltage otherwise is owed."""
    expected = state.inverse.expected(state, settings) + state.owed
    if state.inverse.change(state, settings, new):
        state.owed = expected - state.inverse.expected(state, settings)
        corridor.hand_over(state.corridor)


@register_jitable
def set_model(state: Any, settings: Any, model: Any, hysteretic: bool) -> bool:
    """Use a model as an estimator proposes it, see ``proposed`` of the inverse; False if it cannot be."""
    new = local(4)
    found = state.inverse.proposed(model, hysteretic, new)
    if found:
        change_model(state, settings, new)
    else:
        # The estimator learns in the loop, even if this model is useless: the corridor stays.
        corridor.hand_over(state.corridor)
    return bool(found)


@compiled
def step(state: Record, settings: Record, r: float) -> Any:
    """Voltage for one sample of the reference."""
    return voltage(state, settings, r)


@compiled
def run(state: Record, settings: Record, r: Vector, u: Vector) -> None:
    """Voltages `u` for a whole reference `r`."""
    for k in range(len(r)):
        u[k] = voltage(state, settings, r[k])


@compiled
def change(state: Record, settings: Record, new: Vector) -> None:
    """Compiled `change_model`."""
    change_model(state, settings, new)


# Rare, and not compiled: in Python, on `piezoest.layout.Named` records.


def begin(state: Any, settings: Any, u: float, slope: float, x: float | None) -> None:
    """Begin with a state of zeros, at rest at voltage u and displacement x, with a model of this slope."""
    state.voltage = u
    recent_path.begin(state.path, u, 1.0)
    remember(state.memory, u)
    state.inverse.place(state, settings)
    expected = state.inverse.expected(state, settings)
    state.owed = 0.0 if x is None else x - expected
    corridor.begin(state.corridor, settings, u, expected + state.owed, slope)


def go_on(state: Any, settings: Any, expected: float, stays: bool) -> None:
    """Go on with other numbers of an inverse, where those before expected and owed a displacement."""
    if not stays:
        state.inverse.place(state, settings)
    state.owed = expected - state.inverse.expected(state, settings)
    corridor.hand_over(state.corridor)
