"""Where all models begin: the gain has been found, a sweep is over, or the stage has rested."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.controller import doubt, driving, faults, feedback, homing, late, slots
from piezoest.controller import line as lines
from piezoest.controller import readings as reading
from piezoest.controller import start as starts
from piezoest.controller import travel as travels
from piezoest.controller.voltage import APPROACH, SEEK


@register_jitable
def begin_learning(state: Any) -> None:
    """The gain is known: all models begin with the line through the present point."""
    start = state.start
    if state.unit * start.gain <= 0.0:
        state.scale, state.unit = 0.0, start.gain
        state.zero = start.now - start.gain * start.voltage
    least = np.abs(start.target - start.from_u)
    lines.begin(state.line, start.gain, start.voltage, start.now, least)
    travels.begin(state.reference, state.r, least * np.abs(start.gain))
    travels.begin(state.travel, start.voltage, least)
    state.stage = APPROACH
    start.samples = start.growth = start.left = 0.0
    state.confirmed = starts.farthest(start)
    state.gone = state.handed = state.railed = state.owed = state.lean = state.small = 0.0
    state.patience = driving.PATIENCE
    reading.forget(state.readings)
    # The last readings may be from before the start.
    state.readings.before = state.readings.last = start.now


@register_jitable
def _begin_again(state: Any, settings: Any, u: Any, x: Any) -> None:
    """Begin the way to the reference from a voltage where the stage stands at x; the gain is known."""
    starts.rest_at(state.start, settings, u, x, state.line.gain)
    begin_learning(state)


@register_jitable
def home(state: Any, settings: Any, u: Any, x: Any) -> None:
    """Follow the sweep; after it the way to the reference begins, or the gain is sought."""
    line, recent = state.line, state.readings.recent
    if state.scale > 0.0:
        slots.advance(state.candidates, settings.candidates, u)
        slots.learn(state.candidates, settings.candidates, u, np.nan)
    if np.abs(x) < WILDEST:
        lines.add(recent, u, reading.middle(state.readings, x), settings.doubling)
    if not homing.follow(state.homing):
        return
    if state.unit == 0.0:
        state.stage = SEEK
        starts.begin_again(state.start, settings, u, state.readings.last)
        return
    here = lines.at(line, u)
    if recent.count > 0.0:
        here = recent.mean_x + line.gain * (u - recent.mean_u)
    _begin_again(state, settings, u, here)


@register_jitable
def go_on_at_rest(state: Any, settings: Any, u: Any, x: Any) -> None:
    """Go on at rest at a voltage where the sensor reads x; the gain is known."""
    state.readings.fault = faults.NONE
    late.rest(state.late, u, state.r)
    doubt.all_models(state)
    feedback.forget(state)
    if state.scale > 0.0:
        slots.advance(state.candidates, settings.candidates, u)
    _begin_again(state, settings, u, x)
