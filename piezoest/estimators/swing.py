"""How long the voltage takes from one turning point to the next: the estimator's own clock."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

# Flat state: direction of travel, furthest voltage in it, samples since it was entered,
# samples of a usual swing (0: none seen yet), size of the largest recent swing [V].
DIRECTION, FURTHEST, SINCE, USUAL, SIZE, STATE = range(6)

# A way back counts as a turn from this part of the largest recent swing on; the memory of
# that swing fades over so many samples.
TURN = 0.1
FADING = 1e-5
# No clock is slower than this, in samples.
LONGEST = 1e6


@register_jitable
def follow(swing: Any, u: Any) -> None:
    """Take the next voltage; `swing` is updated in place."""
    swing[SINCE] += 1.0
    way = u - swing[FURTHEST]
    swing[SIZE] = max(swing[SIZE] * (1.0 - FADING), abs(way))
    if swing[DIRECTION] * way >= 0.0:
        if swing[DIRECTION] == 0.0:
            swing[DIRECTION] = np.sign(way)
        swing[FURTHEST] = u
    elif abs(way) > TURN * swing[SIZE]:
        if swing[USUAL] == 0.0:
            swing[USUAL] = swing[SINCE]
        else:
            swing[USUAL] += 0.5 * (swing[SINCE] - swing[USUAL])
        swing[DIRECTION] = -swing[DIRECTION]
        swing[FURTHEST] = u
        swing[SINCE] = 0.0


@register_jitable
def half_period(swing: Any, otherwise: Any) -> Any:
    """Samples of half a period; `otherwise` until there was a turn, and never less than the swing at hand."""
    usual = swing[USUAL] if swing[USUAL] > 0.0 else otherwise
    return min(max(usual, swing[SINCE]), LONGEST)
