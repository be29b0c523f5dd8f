"""From the voltage that was written and its reading to all that is learnt."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.controller import (
    beginning,
    candidate,
    doubt,
    driving,
    faults,
    feedback,
    given,
    late,
    outside,
    reach,
    redraw,
    silence,
    slots,
    zero,
)
from piezoest.controller import line as lines
from piezoest.controller import pace as paces
from piezoest.controller import readings as reading
from piezoest.controller import start as starts
from piezoest.controller import still as stills
from piezoest.controller import travel as travels
from piezoest.controller.voltage import APPROACH, HOME, RUN, SEEK, goal, is_held

# Models are handed over after this fraction of a swing.
HAND_OVER = 1.0 / 8.0
# The way to the reference is over within this fraction of its length, or after so many times the time of a
# doubling: a fast reference is never reached.
NEAR, LONGEST = 0.05, 50.0
# The gain on the way counts if the mean of the recent readings has gone this fraction of it. It is at least
# this fraction of the gain from the start: in the dead zone after a turn the stage hardly answers.
LEAST_WAY, LEAST_GAIN = 0.4, 0.5
# A way so many times as long as those of the start shows how the gain grows: with a power of the way, at most
# the second number.
MUCH_LONGER, MOST_GROWTH = 1.5, 0.6
# If the voltage rests at a limit and the stage is beyond the reference, the line follows the readings after
# this travel of the reference, in swings.
BEYOND = 0.1
# The models begin where the voltage is farther from the beginning than this fraction of half the range, with
# USUAL times half the range as their unit.
WIDE, USUAL = 0.12, 0.4
# Otherwise they begin when the second leg has gone this fraction of the first way. Their unit is at least
# this fraction of the way of the start.
PASSED, SMALLEST = 0.7, 0.25
# The voltage is frozen if it stands still for this travel of the reference, in swings.
FROZEN = 0.4
# At each turn, near which the line misses least, its largest miss is multiplied by this.
REMEMBERED = 0.7
# No miss counts for more than so many swings.
FARTHEST = 3.0


@register_jitable
def _size_up(state: Any, settings: Any, u: Any) -> None:
    """Begin the models when the voltage has shown how far it swings: in that unit they learn fastest."""
    travel, models, numbers = state.travel, state.candidates, settings.candidates
    origin, half_range = state.start.origin, 0.5 * (settings.maximum - settings.minimum)
    if np.abs(u - origin) > WIDE * half_range:
        # On the first way from rest the past that models and estimators remember is known.
        state.scale = USUAL * half_range
        slots.begin(models, numbers, origin, origin, state.scale)
        slots.learn(models, numbers, origin, (state.start.zero - state.zero) / state.unit)
        slots.advance(models, numbers, u)
        return
    if state.stage == APPROACH or travel.turns == 0.0:
        return
    way = np.abs(state.start.target - state.start.from_u)
    first = max(travel.leg, np.abs(travel.turned - origin))
    early = travel.turns == 1.0 and np.abs(u - travel.turned) > PASSED * first > 0.0
    if early or travel.turns > 1.0:
        # Early: the second leg is expected to become as long as the first.
        state.scale = max(first if early else 0.5 * travel.leg, SMALLEST * way)
        slots.begin(models, numbers, origin, travel.turned + travel.direction * state.scale, state.scale)
        slots.advance(models, numbers, travel.turned)
        slots.advance(models, numbers, u)
        slots.shift(models, numbers, (state.readings.last - state.zero) / state.unit)


@register_jitable
def _watch_voltage(state: Any, settings: Any, gone: Any, moved: Any) -> None:
    """If the voltage does not move with the reference, there is no response."""
    within = settings.minimum < state.u < settings.maximum
    # The rest of a block may stand still if it was planned before the reference was reached.
    planned = state.travel.turns > 0.0 or state.travel.count > state.block
    state.frozen = state.frozen + moved if gone == 0.0 and within and planned else 0.0
    if state.frozen > FROZEN * state.reference.swing and state.readings.fault == faults.NONE:
        state.readings.fault, state.readings.good = faults.NO_RESPONSE, 0.0


@register_jitable
def _name_silence(state: Any, settings: Any) -> None:
    """There is no response if no way was answered; without readings this is unknown."""
    if state.silent > settings.doubling:
        return
    silent = state.start.tries >= 1.0 and state.start.stage != starts.DONE
    fault = faults.NO_RESPONSE if silent else faults.NONE
    if fault != state.readings.fault:
        state.readings.fault = fault
        faults.notice(state, fault)


@register_jitable
def _score(state: Any, settings: Any, x: Any, z: Any, moved: Any) -> None:
    """Take a believed reading into the line's points and all scores."""
    u, swings = state.u, travels.progress(state.travel, state.gone)
    state.gone = 0.0
    state.since += swings
    if redraw.is_young(state) or not travels.rests(state.reference, moved):
        lines.add(state.line.now, state.late.answered, x, 1e9)
    bound = FARTHEST * state.travel.swing
    miss = z - driving.line_z(state) - state.owed
    candidate.judge(state.score, miss, bound, swings)
    kept = REMEMBERED if state.travel.turned_now != 0.0 else 1.0
    state.widest = max(state.score.peak, kept * state.widest)
    if state.scale > 0.0:
        slots.judge(state.candidates, z, bound, swings)
    if settings.minimum < u < settings.maximum:
        # Models do not cause the error at a limit, nor the first model the error that the line has left.
        off = (x - state.r) / state.unit
        left = slots.owed(state.candidates, state.driving, state.owed) if state.switches <= 1.0 else 0.0
        candidate.judge(state.outcome, off + left, bound, swings)
        driving.watch(state, np.abs(off), np.abs(miss))


@register_jitable
def _growth(ratio: Any, longer: Any) -> float:
    """The power of the way that a gain grows with; `ratio` of gains and `longer` of ways."""
    return min(np.log(max(ratio, 1.0)) / np.log(longer), MOST_GROWTH)


@register_jitable
def _refine(state: Any, settings: Any, u: Any, x: Any) -> float:
    """Draw the line again with a reading on the way to the reference; single wrong ones do not count."""
    start, line, recent = state.start, state.line, state.readings.recent
    x = reading.middle(state.readings, x)
    lines.add(recent, state.late.before, x, settings.doubling)
    way = np.abs(u - start.origin)
    if start.given != 0.0:
        given.compare(state, settings)
    elif reach.is_refuted(state, recent.mean_u - start.origin, recent.mean_x - start.zero):
        reach.begin_anew(state, settings)
    elif way >= state.confirmed:
        # Only on new ground: on the way back hysteresis would look like gain.
        state.confirmed = way
        # Where the voltage came back, what is left of the way there would look like an answer.
        back = (u - start.target) * (start.target - start.origin) < 0.0
        gone = recent.mean_u - (start.target if back else start.origin)
        # A way through its own beginning has hardly moved the mean.
        if np.abs(gone) > LEAST_WAY * way:
            gain = (recent.mean_x - (start.now if back else start.zero)) / gone
            least = LEAST_GAIN * line.first_gain
            line.gain = gain if gain / least > 1.0 else least
            longer = way / starts.farthest(start)
            if longer > MUCH_LONGER:
                start.growth = _growth(line.gain / start.gain, longer)
    if state.stage != SEEK:
        line.centre = recent.mean_x - line.gain * recent.mean_u
    return x


@register_jitable
def _arrive(state: Any, settings: Any, r: Any, u: Any, gone: Any, told: Any) -> None:
    """The run begins when a reading has shown that the reference is reached, or the way has taken long."""
    start, line = state.start, state.line
    if gone == 0.0:
        # The rest of a block that was planned before the way began.
        return
    start.samples += 1.0
    target = goal(state, settings, r)
    left = target - u
    # A fast reference passes by: between two samples it goes farther than is near.
    passed = left * start.left < 0.0
    there = passed or np.abs(left) <= NEAR * np.abs(u - start.origin) or is_held(settings, u, left)
    start.left = left
    longest = LONGEST * max(settings.doubling, start.lag) + 2.0 * state.gap
    if start.fastest > 0.0:
        longest += 2.0 * np.abs(target - start.origin) / start.fastest
    if (there and told) or start.samples > longest:
        least = np.abs(start.target - start.from_u)
        state.stage = RUN
        lines.begin(line, line.gain, u, lines.at(line, u), least)
        # What is left of the way is paid on the run.
        state.owed = (r - lines.at(line, u)) / state.unit
        travels.begin(state.reference, r, 0.5 * least * np.abs(line.gain))
        travels.begin(state.travel, u, 0.5 * least)
        state.gone = state.handed = 0.0


@register_jitable
def _approach(state: Any, settings: Any, r: Any, u: Any, x: Any, gone: Any) -> float:
    """Take a reading on the way to the reference; NaN, for nothing to learn, while the gain may be wrong."""
    known = np.abs(x) < WILDEST
    if known:
        x = _refine(state, settings, u, x)
    if state.stage == SEEK or state.start.given != 0.0 or state.asked == 0.0:
        return np.nan
    _arrive(state, settings, r, u, gone, known or state.start.ahead != 0.0)
    return x if known else np.nan


@register_jitable
def _believe(state: Any, settings: Any, u: Any, x: Any, gone: Any, moved: Any) -> float:
    """The reading if it can be believed, else NaN; a fault is noted, and the line drives."""
    before = state.readings.fault
    raw, wanted, line = x, gone, state.line
    if not settings.minimum < u < settings.maximum:
        line.clipped = 1.0
        wanted = moved / np.abs(line.gain)
    memory = redraw.memory(state, settings)
    x = reading.believed(state.readings, line, state.travel, memory, state.late.answered, u, x, gone, wanted)
    zero.follow(state)
    _watch_voltage(state, settings, gone, moved)
    if state.readings.fault != before:
        faults.notice(state, state.readings.fault)
        if state.readings.fault != faults.NONE:
            driving.drive(state, 0.0)
            if reading.hide_the_line(state.readings):
                redraw.hold(state)
    # At a limit, with the stage beyond the reference, the line is wrong.
    beyond = is_held(settings, u, (raw - state.r) * line.gain)
    if np.abs(raw) < WILDEST:
        # Without readings nobody knows whether the line is wrong, as while a block is planned.
        reach.watch(state, settings, moved, gone)
    far = (beyond and state.railed > BEYOND * state.reference.swing) or redraw.is_young(state)
    if far and state.readings.fault == faults.NONE:
        redraw.follow(state)
    return x


@register_jitable
def _seek(state: Any, settings: Any, u: Any, x: Any) -> None:
    """Look for the gain; when it is found all models begin."""
    paces.follow(state.pace, state.start, settings.start, u, x)
    starts.learn(state.start, settings, u, x)
    if state.scale > 0.0:
        slots.advance(state.candidates, settings.candidates, u)
    _name_silence(state, settings)
    if state.start.stage == starts.DONE:
        paces.conclude(state.pace, state.start, settings.start, u)
        beginning.begin_learning(state)


@register_jitable
def _follow(state: Any, settings: Any, r: Any, u: Any) -> tuple[float, float]:
    """Let line and models follow reference and voltage; how far each has moved."""
    moved = travels.follow(state.reference, r)
    left = redraw.kept(state, settings, moved, state.reference.swing)
    state.owed *= left
    redraw.lean(state, left)
    slots.pay(state.candidates, left)
    gone = travels.follow(state.travel, u)
    if state.stage == RUN:
        if not reading.hide_the_line(state.readings):
            redraw.draw(state)
        doubt.widen(state)
        doubt.narrow(state)
    state.gone += gone
    if not travels.dithers(state.reference, moved, np.sqrt(state.readings.noise)):
        # Noise around a rest is no travel: a model that it has taught would shake the stage.
        state.handed += gone
    if state.scale > 0.0:
        slots.advance(state.candidates, settings.candidates, u)
    else:
        _size_up(state, settings, u)
    return moved, gone


@register_jitable
def _run(state: Any, settings: Any, u: Any, x: Any, moved: Any, gone: Any) -> float:
    """Take a reading of the run; NaN if it cannot be believed."""
    x = _believe(state, settings, u, x, gone, moved)
    if state.stage == RUN and settings.feedback > 0.0:
        if np.isfinite(x):
            feedback.follow(state, settings, x)
        feedback.watch_rest(state, settings, x, moved)
    if state.reference.turned_now != 0.0:
        paces.watch(state, settings)
        # What the correction does in each leg shakes nothing.
        state.shaking.count = 0.0
    outside.watch(state, settings)
    return x


@register_jitable
def _hand_over(state: Any, settings: Any) -> None:
    """Use the models of now."""
    state.handed = 0.0
    if state.scale > 0.0:
        slots.hand_over(state.candidates, settings.candidates)
        repeats = state.reference.turned_now * state.reference.alike != 0.0
        if repeats and state.pace.late == 0.0 and state.driving != settings.recorded:
            # What it missed on the legs before says little of a loop that is recorded anew; but late readings
            # make a loop look better than it is. Nor is it to owe what lies between it and a first loop.
            left = 0.0 if driving.begins_to_repeat(state, settings) else 1.0
            slots.forget_one(state.candidates, settings.recorded, left)


@register_jitable
def take(state: Any, settings: Any, r: Any, u: Any, x: Any) -> None:
    """Learn from a voltage that was written and a reading; r is NaN where `plan` has taken it already."""
    state.samples += 1.0
    if np.abs(r) < WILDEST:
        state.r, state.asked = stills.held(state, r), 1.0
    if not np.abs(u) < WILDEST:
        if state.stage == RUN:
            doubt.lose_write(state)
        return
    state.pending = 0.0
    state.u = u
    late.remember(state.late, state.start, u, state.r)
    silence.watch(state, settings, x)
    if state.stage == SEEK:
        _seek(state, settings, u, x)
        return
    if state.stage == HOME:
        beginning.home(state, settings, u, x)
        return
    moved, gone = _follow(state, settings, state.r, u)
    if state.stage == APPROACH:
        x = _approach(state, settings, state.r, u, x, gone)
    else:
        x = _run(state, settings, u, x, moved, gone)
    z = (x - state.zero) / state.unit
    if np.isfinite(x):
        _score(state, settings, x, z, moved)
    if state.scale > 0.0:
        slots.learn(state.candidates, settings.candidates, u, z)
    due = state.reference.turned_now != 0.0 or state.handed >= HAND_OVER * state.travel.swing
    if state.stage == RUN and state.readings.fault == faults.NONE and gone > 0.0 and due:
        _hand_over(state, settings)
        driving.reconsider(state, settings)
        feedback.leave_to_model(state)
