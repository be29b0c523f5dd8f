"""Where the voltage rests at a limit: the reference is out of reach, or what is known is wrong."""

from typing import Any

from numba.extending import register_jitable

from piezoest.controller import readings as reading
from piezoest.controller import start as starts
from piezoest.controller.voltage import SEEK

# The voltage may rest at a limit for this travel of the reference, in swings, before all begins anew.
RESTED = 4.0
# A reference is said to be out of reach when it was for so many times what a doubling takes.
SAID = 25.0


@register_jitable
def watch(state: Any, settings: Any, moved: Any) -> None:
    """Where the voltage rests at a limit for long, all that is known may be wrong: start again.

    Not where the readings agree with the line, and the stage stands before the reference: that is out of
    reach.
    """
    left = (state.r - state.readings.last) * state.line.gain
    short = (state.u <= settings.minimum and left < 0.0) or (state.u >= settings.maximum and left > 0.0)
    if short and state.readings.fault == reading.NONE and state.readings.spikes == 0.0:
        state.railed = 0.0
        state.beyond += 1.0
        if state.beyond - 1.0 < SAID * settings.doubling <= state.beyond:
            reading.notice(state, reading.OUT_OF_REACH)
        return
    rests = state.u <= settings.minimum or state.u >= settings.maximum
    # Beside a line that was learnt from wrong readings, right ones look scaled or moved.
    fault = state.readings.fault
    doubted = fault == reading.NONE or fault == reading.SCALED or fault == reading.MOVED
    state.railed = state.railed + moved if rests and doubted else 0.0
    if state.railed > RESTED * state.reference.swing:
        state.stage, state.driving, state.feedback = SEEK, 0.0, 0.0
        starts.begin_again(state.start, settings.start, state.u)
