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
from piezoest.layout import COUNT, FLAG, MEASURED, NUMBER, record

# No sample corrects more than this fraction of an error, of one that is answered late less.
FASTEST = 0.25
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
    share = min(settings.feedback, FASTEST / (1.0 + state.block + state.start.lag))
    growth = share * (state.r - x)
    if is_held(settings, state.u, growth * state.line.gain):
        # At a limit it would only wind up.
        return
    state.feedback = _within(state, settings, state.feedback + growth)


@register_jitable
def _within(state: Any, settings: Any, correction: Any) -> float:
    """The correction, or as much of it as the corridor leaves room for."""
    room = settings.corridor * 0.5 * state.reference.swing + 3.0 * np.sqrt(state.readings.noise)
    return min(max(correction, -room), room)


@register_jitable
def forget(state: Any) -> None:
    """Forget the correction."""
    state.feedback = state.rest.now = state.rest.left = 0.0


@register_jitable
def _correct(state: Any, settings: Any, correction: Any) -> None:
    """Change the correction at once; the difference is owed, and paid on the way."""
    correction = _within(state, settings, correction)
    driving.owe(state, (correction - state.feedback) / state.unit)
    state.feedback = state.back = correction


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
        _correct(state, settings, rest.sum / rest.known)
