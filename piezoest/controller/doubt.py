"""Where nobody knows what the hysteresis remembers: the line drives, and all models have to show again."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import candidate, driving, slots
from piezoest.controller import readings as reading

# A voltage that may not have been written does not matter below this fraction of a swing.
NOTHING = 1.0 / 64.0


@register_jitable
def all_models(state: Any) -> None:
    """Let the line drive, and forget how well each model has done."""
    driving.drive(state, 0.0)
    state.since = 0.0
    candidate.forget(state.score)
    candidate.forget(state.outcome)
    slots.forget(state.candidates)


@register_jitable
def lose_write(state: Any) -> None:
    """Nobody knows whether the voltage was written: it is the planned one, or still the last one."""
    state.pending = 0.0
    if np.abs(state.planned - state.u) < NOTHING * state.travel.swing:
        return
    if state.since > 0.0:
        # Once for all that are lost in a row.
        reading.notice(state, reading.UNKNOWN)
    all_models(state)
