"""A gain that the user knows, until the readings have confirmed it.

The voltage goes no farther than twice the way on which they have. A stage that lags, or has backlash, answers
too little at first: that is waited for, within the first per cents of the range. Where the readings speak
against the gain for long, it is sought as if nothing were known.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import readings as reading
from piezoest.controller import start as starts
from piezoest.controller.voltage import SEEK

# An answer confirms the gain within this factor.
ALIKE = 3.0
# The voltage goes on for so many first ways though the answer is too small.
FREE = 4.0
# Nothing is compared behind this fraction of the farthest way.
BACK = 0.7


@register_jitable
def compare(state: Any, settings: Any) -> None:
    """Compare what the readings of late have answered to a way from the start with the user's gain."""
    start, readings = state.start, state.readings
    gone = readings.recent.mean_u - start.origin
    answer = readings.recent.mean_x - start.zero
    way = np.abs(gone)
    start.total += start.gain * gone - answer
    start.farthest = max(start.farthest, way)
    # On the way back hysteresis and lag would pass for gain.
    if way == 0.0 or way < BACK * start.farthest:
        return
    answered = answer / gone
    ratio = answered / start.gain
    noise = starts.CLEAR * max(start.noise, np.sqrt(readings.noise))
    longest = starts.MOST_WINDOWS * settings.start.window
    if max(np.abs(answered), np.abs(start.gain)) * way <= max(noise, starts.STEPS * readings.step):
        # Nobody can tell yet.
        state.confirmed = max(state.confirmed, way)
    elif 1.0 / ALIKE < ratio < ALIKE:
        state.confirmed = max(state.confirmed, way)
        # The area between what the gain says and the answer: the time constant of a lag.
        start.lag = min(max(start.total / answer, 0.0), longest)
        start.given = start.doubted = 0.0
    else:
        start.doubted += 1.0
        if np.abs(ratio) < 1.0 / ALIKE and way < FREE * settings.start.way:
            state.confirmed = max(state.confirmed, way)
        if start.doubted > 2.0 * longest:
            _forget(state, settings, answered)


@register_jitable
def _forget(state: Any, settings: Any, answered: Any) -> None:
    """Seek the gain."""
    start = state.start
    start.given = start.doubted = 0.0
    start.gain_before = answered
    state.unit = state.scale = state.line.gain = 0.0
    state.stage = SEEK
    starts.begin_again(start, settings.start, state.u)
    reading.notice(state, reading.OTHER_GAIN)
