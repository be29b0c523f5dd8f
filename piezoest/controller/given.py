"""A gain that the user knows, until the readings have confirmed it.

First the voltage goes a few per cent of its range, to the side with more room, and rests there until the
readings have answered about as the gain predicts. If they contradict it for long, the gain is sought.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import faults, reach
from piezoest.controller import start as starts

# An answer confirms the gain within this factor.
ALIKE = 3.0
# The answer counts after so many first ways; it is clear above so many times the noise of a reading.
FREE, CLEAR = 4.0, 3.0
# A lag below this part of the time in which the way doubles does not count.
SMALL = 0.03
# An answer rests if it grows by no more than this part while its time becomes so many times as long.
RESTS, LATER = 0.04, 1.25


@register_jitable
def compare(state: Any, settings: Any) -> None:
    """Compare the recent answer to the way from the beginning with the user's gain."""
    start, readings = state.start, state.readings
    gone = readings.recent.mean_u - start.origin
    answer = readings.recent.mean_x - start.zero
    way, longest = np.abs(gone), starts.MOST_WINDOWS * settings.start.window
    start.gone += gone
    start.answered += answer
    if way < FREE * settings.start.way:
        state.confirmed = max(state.confirmed, way)
        return
    answered = answer / gone
    ratio = answered / start.gain
    noise = CLEAR * max(start.noise, np.sqrt(readings.noise))
    clear = max(np.abs(answer), np.abs(start.gain) * way) > max(noise, starts.STEPS * readings.step)
    alike = 1.0 / ALIKE < ratio < ALIKE
    if clear and alike:
        start.agreed += 1.0
    else:
        start.agreed = start.largest = start.look = 0.0
        start.doubted += 1.0
    if not clear:
        # Go farther: the answer is too small to tell.
        state.confirmed = max(state.confirmed, min(way, 0.5 * settings.start.longest))
    waited = start.agreed + start.doubted
    if start.agreed >= settings.doubling and waited >= start.look:
        scatter = CLEAR * np.sqrt(readings.noise / settings.doubling)
        if np.abs(answer) > (1.0 + RESTS) * start.largest + scatter:
            # It still grows: look again later.
            start.largest, start.look = np.abs(answer), LATER * waited
            return
        # The area between way and answer, both divided by their final values, is about the time constant of a
        # lag. Creep and a bent answer look like a small one, so there is no warning.
        late = start.gone / gone - start.answered / answer - SMALL * settings.doubling
        start.lag, state.pace.late = min(max(late, 0.0), longest), 1.0
        start.given = start.doubted = 0.0
    elif start.doubted > 2.0 * longest:
        start.given = start.doubted = 0.0
        if clear:
            start.gain_before = answered
            state.unit = state.line.gain = 0.0
            reach.seek_again(state, settings)
            faults.notice(state, faults.OTHER_GAIN)
