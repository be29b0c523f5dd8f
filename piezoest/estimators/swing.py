"""How long the voltage takes from one turning point to the next: the estimator's own clock."""

from __future__ import annotations

from typing import Any

import numpy as np

from piezoest._jit import unrolled

# Flat state: direction of travel, furthest voltage in it, samples since it was entered,
# samples of a usual swing (0: none seen yet), size of a usual swing, or of the present one if
# larger [V], where the present one began.
DIRECTION, FURTHEST, SINCE, USUAL, SIZE, TURNED, STATE = range(7)

# A way back counts as a turn from this part of a usual swing on.
TURN = 0.1
# No clock is slower than this, in samples.
LONGEST = 1e6
# Smaller swings [V] than this are none: their size may round to zero.
SMALLEST = 1e-100


@unrolled
def follow(swing: Any, u: Any) -> None:
    """Take the next voltage; `swing` is updated in place."""
    swing[SINCE] += 1.0
    way = u - swing[FURTHEST]
    swing[SIZE] = max(swing[SIZE], abs(u - swing[TURNED]))
    if swing[DIRECTION] * way >= 0.0:
        if swing[DIRECTION] == 0.0:
            swing[DIRECTION] = np.sign(way)
        swing[FURTHEST] = u
    elif abs(way) > TURN * swing[SIZE]:
        if swing[USUAL] == 0.0:
            swing[USUAL] = swing[SINCE]
        else:
            swing[USUAL] += 0.5 * (swing[SINCE] - swing[USUAL])
        swing[SIZE] += 0.8 * (abs(swing[FURTHEST] - swing[TURNED]) - swing[SIZE])
        swing[DIRECTION] = -swing[DIRECTION]
        swing[TURNED] = swing[FURTHEST]
        swing[FURTHEST] = u
        swing[SINCE] = 0.0


@unrolled
def half_period(swing: Any, otherwise: Any) -> Any:
    """Samples of half a period; `otherwise` until there was a turn, and never less than the swing at hand."""
    usual = swing[USUAL] if swing[USUAL] > 0.0 else otherwise
    return min(max(usual, swing[SINCE]), LONGEST)


@unrolled
def part_of_swing(swing: Any, travel: Any, otherwise: Any) -> Any:
    """What part of a whole swing a travel of the voltage is: half a period in unit of motion.

    Hysteresis knows no time: what is remembered and what drifts is counted in this. Until the
    voltage has turned once nobody knows how far it will go, and time has to do.
    """
    if swing[USUAL] == 0.0:
        return (travel > 0.0) / max(otherwise, swing[SINCE])
    return min(travel / max(swing[SIZE], SMALLEST), 1.0)
