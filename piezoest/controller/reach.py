"""The voltage rests at a limit: the reference is out of reach, or what is known is wrong."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import faults, feedback
from piezoest.controller import readings as reading
from piezoest.controller import start as starts
from piezoest.controller import travel as travels
from piezoest.controller.voltage import SEEK, is_held

# The voltage may rest at a limit for this travel of the reference, in swings, before the gain is sought
# again; the second number is for a line that is not sure, once the reference has shown its swing.
RESTED, SOON_RESTED = 4.0, 1.5
# A way so many times as long as those of the start shows more than they did, if it is at least this fraction
# of the farthest way so far: nearer to the beginning, hysteresis of that way is left. Its answer contradicts
# them if it is at least this fraction of theirs.
LONGER, LEFT, AGAINST = 2.0, 0.5, 0.5
# Before the line is sure, the stage must have gone this fraction of the way that the line predicts.
ANSWERED = 0.2
# A reference is reported as out of reach after so many times the time of a doubling.
SAID = 25.0


@register_jitable
def seek_again(state: Any, settings: Any) -> None:
    """Seek the gain again, with longer ways."""
    state.stage, state.driving = SEEK, 0.0
    feedback.forget(state)
    state.start.least = np.abs(state.u - state.start.origin)
    starts.begin_again(state.start, settings, state.u, state.readings.last)


@register_jitable
def begin_anew(state: Any, settings: Any) -> None:
    """What the start has found is wrong: note that, and seek the gain again."""
    faults.notice(state, faults.FALSE_START)
    seek_again(state, settings)


@register_jitable
def is_refuted(state: Any, gone: Any, answer: Any) -> bool:
    """Whether the answer to a way from the beginning contradicts the sign of the gain."""
    # On the short ways of the start hum or drift may have looked like an answer; on a longer way less so.
    start, ways = state.start, starts.farthest(state.start)
    noise = starts.CLEAR * max(start.noise, np.sqrt(state.readings.noise))
    clear = np.abs(answer) > max(noise, AGAINST * np.abs(start.gain) * ways)
    far = np.abs(gone) > max(LONGER * ways, LEFT * state.confirmed)
    return clear and far and answer * gone * start.gain < 0.0


@register_jitable
def _has_answered(state: Any) -> bool:
    """Whether the stage has gone in the direction that the line predicts, if much less far."""
    gone, answer = state.u - state.start.origin, state.readings.last - state.start.zero
    # On ways as short as those of the start, hum, drift or ringing may look like an answer again.
    shown = answer * gone * state.line.gain > ANSWERED * (state.line.gain * gone) ** 2
    return shown and np.abs(gone) > LONGER * starts.farthest(state.start)


@register_jitable
def _is_out_of_reach(state: Any, settings: Any) -> bool:
    """Whether the stage has not reached the reference at a limit, with good readings."""
    short = is_held(settings, state.u, (state.r - state.readings.last) * state.line.gain)
    fine = state.readings.fault == faults.NONE and state.readings.spikes == 0.0
    return short and fine and (reading.is_sure(state.readings) or _has_answered(state))


@register_jitable
def watch(state: Any, settings: Any, moved: Any, gone: Any) -> None:
    """Start again if the line is wrong: for long at a limit, or with readings that go the wrong way.

    `moved`, `gone`: what reference and voltage have moved since the sample before.
    """
    # A reference that is out of reach is no reason.
    if _is_out_of_reach(state, settings):
        state.railed = 0.0
        state.beyond += 1.0
        if state.beyond - 1.0 < SAID * settings.doubling <= state.beyond:
            faults.notice(state, faults.OUT_OF_REACH)
        return
    # Also at the sample before, for an edge of a square wave is a whole swing.
    stood = gone == 0.0 or gone >= settings.maximum - settings.minimum
    rests = stood and (state.u <= settings.minimum or state.u >= settings.maximum)
    # With a line learnt from wrong readings, right readings look reversed, scaled or moved.
    fault = state.readings.fault
    doubted = fault != faults.NO_RESPONSE and fault != faults.SATURATED
    state.railed = state.railed + moved if rests and doubted else max(state.railed - moved, 0.0)
    sure = reading.is_sure(state.readings)
    most = RESTED if sure or state.reference.turns < travels.SHOWN else SOON_RESTED
    if state.railed > most * state.reference.swing or (reading.go_the_wrong_way(state.readings) and not sure):
        begin_anew(state, settings)
