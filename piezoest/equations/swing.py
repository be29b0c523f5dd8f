"""Size and duration of a swing, from one turning point of the voltage to the next: the unit of counting.

Hysteresis depends on travel, see (3), and not on time.
"""

from typing import Any

import numpy as np

from piezoest.compile import inlined
from piezoest.layout import AMOUNT, COUNT, DISTANCE, MEASURED, SIGN, record

# Direction of travel, furthest voltage in it, samples since it was entered, samples of a usual swing (0: none
# seen yet), size of a usual swing, or of the present one if larger [V], where the present one began.
SWING = record(
    direction=SIGN, furthest=MEASURED, since=COUNT, usual=AMOUNT, size=DISTANCE, turned=MEASURED
)  # fmt: skip

# A way back counts as a turn from this fraction of a usual swing on.
TURN = 0.1
# No swing is longer than this, in samples.
LONGEST = 1e6
# Smaller swings [V] than this are none: their size may round to zero.
SMALLEST = 1e-100


def has_a_size(swing: Any) -> tuple[str, bool]:
    """Rule for a saved swing: in words, and whether it holds."""
    return "a usual swing that took time must have a size", swing["usual"] == 0.0 or swing["size"] > 0.0


@inlined
def follow(swing: Any, u: Any) -> None:
    """Follow the voltage to its next value."""
    swing.since += 1.0
    way = u - swing.furthest
    swing.size = max(swing.size, abs(u - swing.turned))
    if swing.direction * way >= 0.0:
        if swing.direction == 0.0:
            swing.direction = np.sign(way)
        swing.furthest = u
    elif abs(way) > TURN * swing.size:
        if swing.usual == 0.0:
            swing.usual = swing.since
        else:
            swing.usual += 0.5 * (swing.since - swing.usual)
        swing.size += 0.8 * (abs(swing.furthest - swing.turned) - swing.size)
        swing.direction = -swing.direction
        swing.turned = swing.furthest
        swing.furthest = u
        swing.since = 0.0


@inlined
def half_period(swing: Any, otherwise: Any) -> Any:
    """Samples of half a period, at least those of the present swing; `otherwise` before the first turn."""
    usual = swing.usual if swing.usual > 0.0 else otherwise
    return min(max(usual, swing.since), LONGEST)


@inlined
def fraction_of_swing(swing: Any, travel: Any, otherwise: Any) -> Any:
    """A travel of the voltage as a fraction of a whole swing, which is half a period.

    Memory and drift are counted in this unit. Before the first turning point the size of a swing is
    unknown, and time is used instead.
    """
    if swing.usual == 0.0:
        return (travel > 0.0) / max(otherwise, swing.since)
    return min(travel / max(swing.size, SMALLEST), 1.0)
