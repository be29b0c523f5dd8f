"""Readings that do not come: after a while this is said, once, and once more when they are back."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.controller import faults

# It is said after so many times what a doubling takes: about a second.
SAID = 250.0
# At each reading the longest gap of late becomes shorter by this factor.
SHORTER = 0.9


@register_jitable
def _said(settings: Any) -> float:
    """Samples without a reading after which it is said."""
    return SAID * settings.doubling


@register_jitable
def is_long(state: Any, settings: Any) -> bool:
    """Whether no reading has come for so long that it was said."""
    return state.silent >= _said(settings)


@register_jitable
def watch(state: Any, settings: Any, x: Any) -> None:
    """Count samples without a reading in a row."""
    if np.abs(x) < WILDEST:
        if is_long(state, settings):
            faults.notice(state, state.readings.fault)
        state.gap = max(SHORTER * state.gap, state.silent)
        state.silent = 0.0
        return
    state.silent += 1.0
    if state.silent - 1.0 < _said(settings) <= state.silent:
        faults.notice(state, faults.NO_READINGS)
