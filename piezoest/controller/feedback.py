"""Integral feedback around the feed-forward: it slowly removes what no model contains, creep and drift.

The reference of the feed-forward is r + i, with di/dt = gain (r - x). Source: K. J. Åström, R. M. Murray,
Feedback Systems, Princeton 2008, sec. 10.4.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import driving, faults, slots
from piezoest.controller import travel as travels
from piezoest.controller.voltage import is_held
from piezoest.layout import AMOUNT, COUNT, FLAG, MEASURED, NUMBER, SIGN, record

# A sample corrects at most this fraction of an error, less if the answer is late.
FASTEST = 0.25
# The gain is halved if the correction shakes the stage: it turns more than SHAKES times in a leg, each time
# after BACK_AND_FORTH swings, within QUICK times the time to correct an error. Not if the last way is below
# LASTS times the first one: then the stage rings by itself, as after a step.
SHAKES, BACK_AND_FORTH, QUICK, LASTS = 8.0, 0.003, 3.0, 0.9
# Where the correction turned last, and before that; direction and samples since; such turns in a row, length
# of the first way; halvings so far.
SHAKING = record(
    turned=NUMBER, before=NUMBER, way=SIGN, samples=COUNT, count=COUNT, size=AMOUNT, halved=COUNT
)
# A rest is over when the reference has gone so far from it, in swings.
OVER = 0.02
# Whether the reference rests, and where. After a rest: turns to go; samples since the first one, those with a
# reading, and the sum of the corrections that these need.
REST = record(now=FLAG, r=MEASURED, left=COUNT, count=COUNT, known=COUNT, sum=NUMBER)
# Between the first and the last of so many turns are two whole legs; this part of them must have readings.
TURNS, KNOWN = 3.0, 0.5


@register_jitable
def follow(state: Any, settings: Any, x: Any) -> None:
    """Take a believed reading; a wrong one cannot drive the correction farther than the corridor."""
    gain = settings.feedback * 0.5**state.shaking.halved
    share = min(gain, FASTEST / (1.0 + state.block + state.start.lag))
    growth = share * (state.late.answered_r - x)
    if is_held(settings, state.u, growth * state.line.gain):
        # At a limit it would only grow, without an effect.
        return
    state.feedback = _within(state, settings, state.feedback + growth)
    _calm(state, 1.0 / share)


@register_jitable
def _calm(state: Any, slow: Any) -> None:
    """Halve the gain of a correction that shakes the stage; it takes `slow` samples to correct an error."""
    # Integral feedback is stable below twice damping times resonance, which are unknown.
    shaking = state.shaking
    # The noise at rest, if it was seen: a shaken stage looks noisy.
    noise = state.start.noise if state.start.told == 0.0 else np.sqrt(state.readings.noise)
    shaking.samples += 1.0
    gone = state.feedback - shaking.turned
    if gone * shaking.way > 0.0:
        shaking.turned = state.feedback
    elif np.abs(gone) > max(BACK_AND_FORTH * state.reference.swing, noise):
        size = np.abs(shaking.turned - shaking.before)
        shaking.before, shaking.turned = shaking.turned, state.feedback
        shaking.count = shaking.count + 1.0 if shaking.samples < QUICK * slow else 0.0
        shaking.way, shaking.samples = np.sign(gone), 0.0
        if shaking.count == 1.0:
            shaking.size = size
        elif shaking.count > SHAKES:
            shaking.count = 0.0
            if size > LASTS * shaking.size:
                shaking.halved += 1.0
                faults.notice(state, faults.FEEDBACK)


@register_jitable
def _within(state: Any, settings: Any, correction: Any) -> float:
    """The correction, limited to the corridor."""
    room = settings.corridor * 0.5 * state.reference.swing + 3.0 * np.sqrt(state.readings.noise)
    return min(max(correction, -room), room)


@register_jitable
def forget(state: Any) -> None:
    """Forget the correction."""
    state.feedback = state.rest.now = state.rest.left = 0.0
    state.shaking.turned = state.shaking.before = state.shaking.way = state.shaking.count = 0.0


@register_jitable
def watch_rest(state: Any, settings: Any, x: Any, moved: Any) -> None:
    """After a long rest, take the correction from the first two legs."""
    # Motion erases the creep of a rest, and the integral alone would keep it for long.
    rest = state.rest
    if state.readings.fault != faults.NONE:
        rest.left = 0.0
    if rest.now == 0.0:
        rest.now = 1.0 if travels.rests(state.reference, moved) else 0.0
        rest.r = state.r
        _learn_from_legs(state, settings, x)
    elif np.abs(state.r - rest.r) > OVER * state.reference.swing:
        rest.now = rest.count = rest.known = rest.sum = 0.0
        rest.left = TURNS


@register_jitable
def _learn_from_legs(state: Any, settings: Any, x: Any) -> None:
    """Correct the mean error of the first two whole legs after a rest."""
    rest = state.rest
    if rest.left == 0.0:
        return
    rest.left -= state.reference.turned_now
    if rest.left == TURNS:
        return
    rest.count += 1.0
    if np.isfinite(x):
        rest.known += 1.0
        rest.sum += state.feedback + state.r - x
    if rest.left == 0.0 and rest.known > KNOWN * rest.count:
        # At once; the difference is owed, and paid on the way.
        correction = _within(state, settings, rest.sum / rest.known)
        driving.owe(state, (correction - state.feedback) / state.unit)
        state.feedback = state.back = correction


@register_jitable
def leave_to_model(state: Any) -> None:
    """After a rest, drop the part of the correction that the model that drives has learnt meanwhile."""
    # Model and correction both know of the creep: what the model owes would bring it in twice.
    rest = state.rest
    if rest.left == 0.0:
        return
    owed = state.unit * slots.owed(state.candidates, state.driving, state.owed)
    if owed * state.feedback <= 0.0:
        return
    known = np.sign(owed) * min(np.abs(owed), np.abs(state.feedback))
    driving.owe(state, -known / state.unit)
    state.feedback = state.back = state.feedback - known
    rest.count = rest.known = rest.sum = 0.0
