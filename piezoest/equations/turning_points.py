"""The memory of a rate-independent hysteresis: the turning points of its input not yet wiped out.

Plays of any thresholds can be set from it, which is what a model with new thresholds needs.
Source: I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991 (wiping-out).
Unlike the equations beside it this is bookkeeping, with branches, for numbers alone.

Flat memory within a larger array, from `start` on: direction of travel, count, then the
turning points, the last of which is the present input; all zero is an input at rest at zero.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from piezoest.equations.play import play

MOST = 40  # nested loops older than this many turns are kept, newer ones are forgotten
SIZE = 2 + MOST


@register_jitable
def remember(memory, start, u):
    """Take the next input; `memory` is updated in place."""
    direction = memory[start]
    count = int(memory[start + 1])
    points = start + 2
    last = memory[points + count - 1] if count > 0 else 0.0
    if u == last:
        return
    way = 1.0 if u > last else -1.0
    if way != direction:
        memory[start] = way
        if count < MOST - 1:
            count += 1
    elif count == 0:
        count = 1
    # A loop that the input has passed is wiped out with both its ends.
    while count >= 3 and way * (u - memory[points + count - 3]) >= 0.0:
        count -= 2
    if count == 2 and np.abs(u) >= np.abs(memory[points]):
        count = 1
    memory[points + count - 1] = u
    memory[start + 1] = count


@register_jitable
def recall(memory, start, r):
    """State of the play of threshold r that started at zero."""
    y = 0.0
    for k in range(int(memory[start + 1])):
        y = play(y, memory[start + 2 + k], r)
    return y
