"""Whether reference or voltage leave the ranges that the user's model was learnt on: noted once."""

from typing import Any

from numba.extending import register_jitable

from piezoest.controller import faults
from piezoest.layout import FIXED, record

# Infinite where no ranges are known.
ALLOWED = record(lowest_r=FIXED, highest_r=FIXED, lowest_u=FIXED, highest_u=FIXED)


@register_jitable
def watch(state: Any, settings: Any) -> None:
    """Note the first sample that is outside."""
    allowed = settings.allowed
    # A block keeps one event: of two warnings in it the first would be lost.
    if state.outside != 0.0 or state.samples <= state.pace.told + state.block:
        return
    within = allowed.lowest_r <= state.r <= allowed.highest_r
    if not (within and allowed.lowest_u <= state.u <= allowed.highest_u):
        state.outside, state.pace.told = 1.0, state.samples
        faults.notice(state, faults.OUTSIDE)
