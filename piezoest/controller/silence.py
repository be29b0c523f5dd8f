"""Missing readings: after a while an event is noted, and another one when readings are back."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.controller import faults

# It is noted after so many times the time of a doubling: about a second.
SAID = 250.0
# At each reading the longest recent gap is multiplied by this.
SHORTER = 0.9


@register_jitable
def is_long(state: Any, settings: Any) -> bool:
    """Whether no reading has come for so long that it was noted."""
    return state.silent >= SAID * settings.doubling


@register_jitable
def fault(state: Any, settings: Any) -> Any:
    """Return the number of the readings' fault, one of which is that none comes."""
    if state.readings.fault == faults.NONE and is_long(state, settings):
        return faults.NO_READINGS
    return state.readings.fault


@register_jitable
def watch(state: Any, settings: Any, x: Any) -> None:
    """Count samples without a reading in a row."""
    was_long = is_long(state, settings)
    if np.abs(x) < WILDEST:
        if was_long:
            faults.notice(state, state.readings.fault)
        state.gap = max(SHORTER * state.gap, state.silent)
        state.silent = 0.0
        return
    state.silent += 1.0
    if is_long(state, settings) and not was_long:
        faults.notice(state, faults.NO_READINGS)
