"""From the reference to the voltage: seeking the gain, on the way to the reference, by a model."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.controller import doubt, driving, faults, homing, late, redraw, slots
from piezoest.controller import line as lines
from piezoest.controller import start as starts
from piezoest.controller import still as stills
from piezoest.controller import travel as travels

# The gain is sought; the voltage goes to where the reference needs it; all is learnt; hysteresis is erased.
SEEK, APPROACH, RUN, HOME = 0.0, 1.0, 2.0, 3.0
# The corridor reaches at most so many times as far from the line as the line has missed recently. It is wider
# where the line drifts to, by so many times the drift of two legs, as the line is where the loop was then; at
# most by so many times its width, and not farther than half the swing.
WIDER, DRIFTS, ASIDE = 2.0, 2.0, 2.0
# The voltage of a model moves at most so many times as fast as that of the line.
RATE = 5.0
# On the way to the reference the voltage goes at most so many times as far as was answered, before a user's
# gain is confirmed FIRST_AHEAD times as far. On new ground a doubling takes LATE times the delay of the
# stage, TOO_LATE times one that is longer than voltages are remembered. A slow stage is followed with this
# part of its speed.
AHEAD, FIRST_AHEAD, LATE, TOO_LATE, FOLLOWED = 8.0, 2.0, 2.0, 3.0, 0.8
# In a long block that way is at once this part of the longest: like both ways of a start without a gain.
AT_ONCE = 0.6
# A written voltage that differs from the planned one by less than this fraction of the range is the planned
# one: rounded by a converter, or measured by a monitor.
OFF = 0.01


@register_jitable
def is_held(settings: Any, u: Any, way: Any) -> bool:
    """Whether a voltage at a limit cannot go a way."""
    return (u <= settings.minimum and way < 0.0) or (u >= settings.maximum and way > 0.0)


@register_jitable
def written(state: Any, settings: Any, u: Any) -> float:
    """The voltage that was written, u according to the user: the planned one if u is near it."""
    # From a rounded voltage a small way would be rounded away again; the errors of a monitor would add up.
    near = np.abs(state.planned - u) <= OFF * (settings.maximum - settings.minimum)
    return state.planned if near else u


@register_jitable
def _feed_forward(state: Any, settings: Any, r: Any, before: Any) -> float:
    """Voltage of the model that drives, in the corridor around the line; `before` is the last reference."""
    line = state.line
    swing = max(state.reference.swing, np.abs(r - state.reference.turned))
    kept = redraw.kept(state, settings, np.abs(r - state.reference.last), swing)
    onward = (r - before) / line.gain
    r += state.feedback
    straight = wanted = lines.voltage(line, r - state.owed * kept * state.unit)
    drives = state.readings.fault == faults.NONE and state.driving > 0.0
    if drives and state.pending > 1.0:
        # It is unknown what became of the last voltage: go on parallel to the line, and soon on it.
        moved = np.abs(onward * line.gain)
        left = driving.kept(state.reference, moved, swing) if doubt.matters(state) else 1.0
        wanted += left * (state.planned + onward - wanted)
    elif drives:
        owed = slots.owed(state.candidates, state.driving, 0.0)
        z = (r - state.zero) / state.unit - owed * kept
        wanted = slots.voltage(state.candidates, settings.candidates, state.driving, z, straight)
        # Near a turn the inverse of a wide loop jumps, which would shake a resonance.
        learnt = state.reference.last + state.back
        ahead = lines.voltage(line, r - owed * kept * state.unit)
        ahead -= lines.voltage(line, learnt - owed * state.unit)
        most = (RATE - 1.0) * np.abs(ahead)
        wanted = min(max(wanted, state.u + ahead - most), state.u + ahead + most)
    if not np.abs(wanted) < WILDEST:
        wanted = straight
    half_swing = np.abs(0.5 * max(swing, travels.widest(state.reference), state.reference.wide) / line.gain)
    # No model can be better than the line by more than the line has missed recently.
    missed = np.abs(state.unit) * state.widest + 3.0 * np.sqrt(state.readings.noise)
    room = min(settings.corridor * half_swing, WIDER * missed / np.abs(line.gain))
    most = min(ASIDE * room, half_swing - room)
    wider = min(max(DRIFTS * state.lean / line.gain, -most), most)
    return min(max(wanted, straight - room - max(wider, 0.0)), straight + room - min(wider, 0.0))


@register_jitable
def goal(state: Any, settings: Any, r: Any) -> float:
    """Voltage for a reference on the way to it."""
    start, confirmed = state.start, state.confirmed
    way = lines.voltage(state.line, r) - start.origin
    if start.ahead > settings.start.ramp and np.abs(way) > confirmed > 0.0:
        # The gain grows with the way, as Rayleigh's law says, and no reading tells how far.
        way = np.sign(way) * confirmed * (np.abs(way) / confirmed) ** (1.0 / (1.0 + start.growth))
    return start.origin + way


@register_jitable
def _nearer(state: Any, settings: Any, target: Any) -> float:
    """The next voltage on the way to a target: faster and faster at first, and slower at the end."""
    # Where the stage has answered it is fast: else it would never reach a reference that goes to and fro.
    start = state.start
    span = max(np.abs(state.u - start.origin), state.confirmed)
    doubling = max(settings.doubling, state.gap)
    if np.abs(target - start.origin) > state.confirmed:
        # The readings must tell in time how far the stage goes.
        doubling = max(doubling, (LATE if start.lag < late.MOST else TOO_LATE) * start.lag)
    end = start.origin + AHEAD * np.sign(target - start.origin) * state.confirmed
    left = target - state.u
    if np.abs(target - start.origin) > np.abs(end - start.origin):
        left = end - state.u
    way = min(span, np.abs(left)) / doubling
    if start.fastest > 0.0:
        way = min(way, FOLLOWED * start.fastest)
    return state.u + min(max(left, -way), way)


@register_jitable
def plan(state: Any, settings: Any, r: Any) -> float:
    """Voltage for the next sample of the reference."""
    state.pending += 1.0
    if np.abs(r) < WILDEST:
        r, state.asked = stills.held(state, r), 1.0
    else:
        r = state.r
        state.missing += 1.0
    before, state.r = state.r, r
    if state.stage == SEEK:
        wanted = state.start.voltage
    elif state.stage == APPROACH:
        # Without a reference the voltage stays.
        target = goal(state, settings, r) if state.asked != 0.0 else state.u
        if state.start.given != 0.0:
            # The first way shows whether the gain is right.
            way = min(FIRST_AHEAD * state.confirmed, settings.start.longest)
            if state.start.ahead > starts.blind(settings):
                way = max(way, AT_ONCE * settings.start.longest)
            target = state.start.origin + np.sign(state.start.way) * way
        wanted = _nearer(state, settings, target)
    elif state.stage == HOME:
        wanted = homing.voltage(state.homing, state.u)
    else:
        wanted = _feed_forward(state, settings, r, before)
    if not np.abs(wanted) < WILDEST:
        wanted = state.u
    step = settings.largest_step
    slewed = min(max(wanted, state.u - step), state.u + step)
    given = min(max(slewed, settings.minimum), settings.maximum)
    state.slewed += slewed != wanted
    state.saturated += given != slewed
    state.planned, state.back = given, state.feedback
    return given
