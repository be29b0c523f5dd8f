"""Integral feedback around the feed-forward: what no model knows, creep and drift, is taken back slowly.

The reference of the feed-forward is r + i, with di/dt = gain (r - x). Source: K. J. Åström, R. M. Murray,
Feedback Systems, Princeton 2008, sec. 10.4.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import driving, faults
from piezoest.controller import travel as travels
from piezoest.controller.voltage import is_held
from piezoest.layout import AMOUNT, COUNT, FLAG, MEASURED, NUMBER, SIGN, record

# No sample corrects more than this fraction of an error, of one that is answered late less.
FASTEST = 0.25
# A correction that goes back and forth so many times within a leg, by this fraction of a swing each time, and
# within so many times what it takes to correct an error, shakes the stage: its gain is halved. But not if the
# last way is below this part of the first one: the stage rings by itself, as behind a step.
SHAKES, BACK_AND_FORTH, QUICK, LASTS = 8.0, 0.003, 3.0, 0.9
# Where the correction turned last, and before, its way since, samples since; such turns in a row, how far the
# first of them went; halvings so far.
SHAKING = record(
    turned=NUMBER, before=NUMBER, way=SIGN, samples=COUNT, count=COUNT, size=AMOUNT, halved=COUNT
)
# A rest is over where the reference has gone so far from it, in swings.
OVER = 0.02
# Whether the reference rests, and where. Behind a rest: turns left to look at; samples since the first one,
# those with a reading, and the sum of the corrections that these ask for.
REST = record(now=FLAG, r=MEASURED, left=COUNT, count=COUNT, known=COUNT, sum=NUMBER)
# Between the first and the last of so many turns lie two whole legs; this part of them must have readings.
TURNS, KNOWN = 3.0, 0.5


@register_jitable
def follow(state: Any, settings: Any, x: Any) -> None:
    """Take a believed reading; a sensor that lies can drive it no farther than the corridor."""
    gain = settings.feedback * 0.5**state.shaking.halved
    share = min(gain, FASTEST / (1.0 + state.block + state.start.lag))
    growth = share * (state.late.answered_r - x)
    if is_held(settings, state.u, growth * state.line.gain):
        # At a limit it would only wind up.
        return
    state.feedback = _within(state, settings, state.feedback + growth)
    _calm(state, 1.0 / share)


@register_jitable
def _noise(state: Any) -> float:
    """Noise of the readings as it was at rest, if it was seen: what is shaken would pass for noise."""
    return state.start.noise if state.start.told == 0.0 else np.sqrt(state.readings.noise)


@register_jitable
def _calm(state: Any, slow: Any) -> None:
    """Halve the gain of a correction that shakes the stage: it takes `slow` samples to correct an error.

    Integral feedback is stable below twice damping times resonance, which nobody has told.
    """
    shaking = state.shaking
    shaking.samples += 1.0
    gone = state.feedback - shaking.turned
    if gone * shaking.way > 0.0:
        shaking.turned = state.feedback
    elif np.abs(gone) > max(BACK_AND_FORTH * state.reference.swing, _noise(state)):
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
    """The correction, or as much of it as the corridor leaves room for."""
    room = settings.corridor * 0.5 * state.reference.swing + 3.0 * np.sqrt(state.readings.noise)
    return min(max(correction, -room), room)


@register_jitable
def forget(state: Any) -> None:
    """Forget the correction."""
    state.feedback = state.rest.now = state.rest.left = 0.0
    state.shaking.turned = state.shaking.before = state.shaking.way = state.shaking.count = 0.0


@register_jitable
def watch_rest(state: Any, settings: Any, x: Any, moved: Any) -> None:
    """Behind a long rest, learn the correction anew from the first two legs.

    What the stage has crept is wiped out in motion, and the integral alone would keep it for long.
    """
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
    """Correct by what the first two whole legs behind a rest have missed in the mean."""
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
