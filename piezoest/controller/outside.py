"""Whether reference or voltage leave what the model was learnt on: noted once, for learning goes on."""

from typing import Any

from numba.extending import register_jitable

from piezoest.controller import faults
from piezoest.layout import FIXED, FLAG, MEASURED, record

# Whether it was noted, and of which reference [µm] and voltage [V].
OUTSIDE = record(told=FLAG, r=MEASURED, u=MEASURED)
# Infinite where no ranges are known.
ALLOWED = record(lowest_r=FIXED, highest_r=FIXED, lowest_u=FIXED, highest_u=FIXED)


@register_jitable
def watch(state: Any, settings: Any) -> None:
    """Note the first sample that is outside."""
    outside, allowed = state.outside, settings.allowed
    # A block notes one event: of two warnings in it the first would be lost.
    if outside.told != 0.0 or state.samples <= state.pace.told + state.block:
        return
    within = allowed.lowest_r <= state.r <= allowed.highest_r
    if not (within and allowed.lowest_u <= state.u <= allowed.highest_u):
        outside.told, outside.r, outside.u = 1.0, state.r, state.u
        state.pace.told = state.samples
        faults.notice(state, faults.OUTSIDE)
