"""The recent path of a voltage: its last turning points, whether or not a larger loop wiped them out.

The Coleman-Hodgdon model forgets by travel alone, see (3). Where any model of that kind stands now follows
from the last few swings, so that a compensator can take up a new one as if it had always had it.
Like `turning_points` this is bookkeeping, with branches, for numbers alone.

Flat memory within a larger array, from `start` on: direction of travel, furthest voltage in it, present
voltage, decay a of the model in use, its w_h/b at the oldest and at the last turning point, largest swing
of late, how many turning points there are, the place of the last one, then the places, used in turns.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from piezoest.equations.coleman_hodgdon import hysteresis_step

DIRECTION, FURTHEST, PRESENT, DECAY, AT_OLDEST, AT_LAST, LARGEST, COUNT, NEWEST, POINTS = range(10)
MOST = 33  # sixteen periods and the turn before; odd
SIZE = POINTS + MOST

# What is left of a swing this long ago no longer counts.
FORGOTTEN = 1e-3

# A way back is a turn from this part of the largest swing on, which fades by this part from one to the next.
TURN, FADES = 0.01, 0.03


@register_jitable
def begin(path, start, u, a):
    """Begin at rest at u, without any memory; a [1/V] is the decay of the model in use."""
    for k in range(SIZE):
        path[start + k] = 0.0
    path[start + FURTHEST] = path[start + PRESENT] = path[start + POINTS] = u
    path[start + DECAY] = a
    path[start + COUNT] = 1.0


@register_jitable
def follow(path, start, u):
    """Take the next voltage; `path` is updated in place."""
    path[start + PRESENT] = u
    way = u - path[start + FURTHEST]
    if path[start + DIRECTION] * way >= 0.0:
        if path[start + DIRECTION] == 0.0:
            path[start + DIRECTION] = np.sign(way)
        path[start + FURTHEST] = u
        return
    swing = path[start + FURTHEST] - path[start + POINTS + int(path[start + NEWEST])]
    largest = max(path[start + LARGEST], np.abs(swing))
    if np.abs(way) > TURN * largest:
        path[start + LARGEST] = largest - FADES * largest
        path[start + AT_LAST] = hysteresis_step(path[start + AT_LAST], swing, path[start + DECAY], 1.0)
        _add(path, start, path[start + FURTHEST])
        path[start + DIRECTION] = -path[start + DIRECTION]
        path[start + FURTHEST] = u


@register_jitable
def _add(path, start, u):
    """Add a turning point; where all places are taken the oldest goes: the model goes on from the next."""
    points = start + POINTS
    free = int(_later(int(path[start + NEWEST])))
    if path[start + COUNT] < MOST:
        path[start + COUNT] += 1.0
    else:
        swing = path[points + int(_later(free))] - path[points + free]
        path[start + AT_OLDEST] = hysteresis_step(path[start + AT_OLDEST], swing, path[start + DECAY], 1.0)
    path[points + free] = u
    path[start + NEWEST] = free


@register_jitable
def _later(place):
    """The place after this one, in turns."""
    return place + 1 if place < MOST - 1 else 0


@register_jitable
def _earlier(place):
    """The place before this one, in turns."""
    return place - 1 if place > 0 else MOST - 1


@register_jitable
def hysteresis(path, start):
    """w_h/b of the model in use at the present voltage [V], by (3) from its last turning point."""
    last = path[start + POINTS + int(path[start + NEWEST])]
    a, furthest = path[start + DECAY], path[start + FURTHEST]
    h = hysteresis_step(path[start + AT_LAST], furthest - last, a, 1.0)
    return hysteresis_step(h, path[start + PRESENT] - furthest, a, 1.0)


@register_jitable
def take_up(path, start, a):
    """Bring another decay a [1/V] into use, as if it had been from the oldest turning point on.

    Where that one still counts after so many swings, they are small, a times a swing well below one. The
    model then stands at minus half the swing in a steady loop, whatever a is: it keeps the place there.
    Where the walk back ends before, what little is left counts as that of a steady loop: the same place, on
    either side in turns.
    """
    points = start + POINTS
    level, kept = 0.0, 1.0  # a w_h/b that comes of the swings, and what is left of an earlier one
    earlier = path[start + AT_OLDEST]  # on the last one's side: it is zero while the number of points is even
    at = int(path[start + NEWEST])
    more = int(path[start + COUNT]) - 1
    while more > 0 and kept > FORGOTTEN:
        before = int(_earlier(at))
        swing = path[points + at] - path[points + before]
        faded = kept * np.expm1(-a * np.abs(swing))  # (B12)-(B15)
        level += faded if swing > 0.0 else -faded
        kept += faded
        earlier = -earlier
        at = before
        more -= 1
    path[start + AT_LAST] = level / a + kept * earlier
    path[start + DECAY] = a
