"""The memory of a rate-independent hysteresis: the turning points of its input not yet wiped out.

Plays of any thresholds can be set from it, which is what a model with new thresholds needs.
Source: I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991 (wiping-out).
Unlike the equations, these functions have branches and work on numbers only.
"""

import numpy as np
from numba.extending import register_jitable

from piezoest.equations.play import play
from piezoest.layout import MEASURED, SIGN, numbers, record, whole

MOST = 40  # turns that are kept

# Direction of travel, count, and the turning points, the last of which is the present input; all zero is an
# input at rest at zero.
TURNING_POINTS = record(direction=SIGN, count=whole(0.0, MOST - 1.0), points=numbers(MOST, kind=MEASURED))


@register_jitable
def remember(memory, u):
    """Follow the input to its next value."""
    count = int(memory.count)
    points = memory.points
    last = points[count - 1] if count > 0 else 0.0
    if u == last:
        return
    way = 1.0 if u > last else -1.0
    if way != memory.direction:
        memory.direction = way
        # Without room the smallest loop is forgotten, with both its ends.
        count = count + 1 if count < MOST - 1 else MOST - 2
    elif count == 0:
        count = 1
    # A loop that the input has passed is wiped out with both its ends.
    while count >= 3 and way * (u - points[count - 3]) >= 0.0:
        count -= 2
    if count == 2 and np.abs(u) >= np.abs(points[0]):
        count = 1
    points[count - 1] = u
    memory.count = count


@register_jitable
def recall(memory, r):
    """State of the play of threshold r that started at zero."""
    y = 0.0
    for k in range(int(memory.count)):
        y = play(y, memory.points[k], r)
    return y
