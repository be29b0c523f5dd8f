"""The recent path of a voltage: its last turning points, also those that a larger loop has wiped out.

The Coleman-Hodgdon model forgets with the travel of the voltage, see (3). The present state of any such model
follows from the last few swings, so a compensator can change to a new model as if it had always used it.
Unlike the equations, these functions have branches and work on numbers only.
"""

import numpy as np
from numba.extending import register_jitable

from piezoest.equations.coleman_hodgdon import hysteresis_step
from piezoest.layout import DISTANCE, MEASURED, NUMBER, SIGN, numbers, record, whole

MOST = 33  # sixteen periods and the turn before; odd

# Direction of travel, furthest voltage in it, present voltage; decay a of the model in use [1/V], its w_h/b
# at the oldest and at the last turning point [V]; largest swing of late; how many turning points there are,
# the place of the last one, and the places, used in turns.
PATH = record(
    direction=SIGN, furthest=MEASURED, present=MEASURED,
    decay=NUMBER, at_oldest=NUMBER, at_last=NUMBER, largest=DISTANCE,
    count=whole(0.0, MOST), newest=whole(0.0, MOST - 1.0), points=numbers(MOST, kind=MEASURED),
)  # fmt: skip

# What is left of a swing this long ago no longer counts.
FORGOTTEN = 1e-3

# A way back is a turn from this part of the largest swing on, which fades by this part from one to the next.
TURN, FADES = 0.01, 0.03


@register_jitable
def begin(path, u, a):
    """Begin at rest at u with a path of zeros; a [1/V] is the decay of the model in use."""
    path.furthest = path.present = path.points[0] = u
    path.decay = a
    path.count = 1.0


@register_jitable
def follow(path, u):
    """Follow the voltage to its next value."""
    path.present = u
    way = u - path.furthest
    if path.direction * way >= 0.0:
        if path.direction == 0.0:
            path.direction = np.sign(way)
        path.furthest = u
        return
    swing = path.furthest - path.points[int(path.newest)]
    largest = max(path.largest, np.abs(swing))
    if np.abs(way) > TURN * largest:
        path.largest = largest - FADES * largest
        path.at_last = hysteresis_step(path.at_last, swing, path.decay, 1.0)
        _add(path, path.furthest)
        path.direction = -path.direction
        path.furthest = u


@register_jitable
def _add(path, u):
    """Add a turning point; where all places are taken the oldest goes: the model goes on from the next."""
    free = int(_later(int(path.newest)))
    if path.count < MOST:
        path.count += 1.0
    else:
        swing = path.points[int(_later(free))] - path.points[free]
        path.at_oldest = hysteresis_step(path.at_oldest, swing, path.decay, 1.0)
    path.points[free] = u
    path.newest = free


@register_jitable
def _later(place):
    """The place after this one, in turns."""
    return place + 1 if place < MOST - 1 else 0


@register_jitable
def _earlier(place):
    """The place before this one, in turns."""
    return place - 1 if place > 0 else MOST - 1


@register_jitable
def hysteresis(path):
    """w_h/b of the model in use at the present voltage [V], by (3) from its last turning point."""
    last = path.points[int(path.newest)]
    h = hysteresis_step(path.at_last, path.furthest - last, path.decay, 1.0)
    return hysteresis_step(h, path.present - path.furthest, path.decay, 1.0)


@register_jitable
def use_decay(path, a):
    """Bring another decay a [1/V] into use, as if it had been from the oldest turning point on.

    Where that one still counts after so many swings, they are small, a times a swing well below one. The
    model then stands at minus half the swing in a steady loop, whatever a is: it keeps the place there.
    Where the walk back ends before, what little is left counts as that of a steady loop: the same place, on
    either side in turns.
    """
    level, kept = 0.0, 1.0  # a w_h/b that comes of the swings, and what is left of an earlier one
    earlier = path.at_oldest  # on the last one's side: it is zero while the number of points is even
    at = int(path.newest)
    more = int(path.count) - 1
    while more > 0 and kept > FORGOTTEN:
        before = int(_earlier(at))
        swing = path.points[at] - path.points[before]
        faded = kept * np.expm1(-a * np.abs(swing))  # (B12)-(B15)
        level += faded if swing > 0.0 else -faded
        kept += faded
        earlier = -earlier
        at = before
        more -= 1
    path.at_last = level / a + kept * earlier
    path.decay = a
