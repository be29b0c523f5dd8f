"""The recent path of a voltage: its last turning points, whether or not a larger loop wiped them out.

The Coleman-Hodgdon model forgets by travel alone, see (3). Where any model of that kind stands now follows
from the last few swings, so that a compensator can take up a new one as if it had always had it.
Like `turning_points` this is bookkeeping, with branches, for numbers alone.

Flat memory within a larger array, from `start` on: direction of travel, furthest voltage in it, present
voltage, whether swings were dropped, count, then the turning points, oldest first.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from piezoest.equations.coleman_hodgdon import hysteresis_step

DIRECTION, FURTHEST, PRESENT, DROPPED, COUNT, POINTS = range(6)
MOST = 33  # sixteen periods and the turn before
SIZE = POINTS + MOST

# What is left of a swing this long ago no longer counts.
FORGOTTEN = 1e-4

# A way back is a turn from this part of the largest swing on.
TURN = 0.01


@register_jitable
def begin(path, start, u):
    """Begin at rest at u, without any memory."""
    for k in range(SIZE):
        path[start + k] = 0.0
    path[start + FURTHEST] = path[start + PRESENT] = path[start + POINTS] = u
    path[start + COUNT] = 1.0


@register_jitable
def largest_swing(path, start):
    """Size of the largest swing that is remembered, the present one included [V]."""
    points = start + POINTS
    count = int(path[start + COUNT])
    largest = np.abs(path[start + FURTHEST] - path[points + count - 1])
    for k in range(1, count):
        largest = max(largest, np.abs(path[points + k] - path[points + k - 1]))
    return largest


@register_jitable
def follow(path, start, u):
    """Take the next voltage; `path` is updated in place."""
    path[start + PRESENT] = u
    way = u - path[start + FURTHEST]
    if path[start + DIRECTION] * way >= 0.0:
        if path[start + DIRECTION] == 0.0:
            path[start + DIRECTION] = np.sign(way)
        path[start + FURTHEST] = u
    elif np.abs(way) > TURN * largest_swing(path, start):
        points = start + POINTS
        count = int(path[start + COUNT])
        if count == MOST:
            for k in range(MOST - 1):
                path[points + k] = path[points + k + 1]
            count -= 1
            path[start + DROPPED] = 1.0
        path[points + count] = path[start + FURTHEST]
        path[start + COUNT] = count + 1
        path[start + DIRECTION] = -path[start + DIRECTION]
        path[start + FURTHEST] = u


@register_jitable
def middle(path, start):
    """Middle between the lowest and the highest turning point that is remembered [V]."""
    points = start + POINTS
    lowest = highest = path[points]
    for k in range(1, int(path[start + COUNT])):
        lowest = min(lowest, path[points + k])
        highest = max(highest, path[points + k])
    return 0.5 * (lowest + highest)


@register_jitable
def hysteresis(path, start, a):
    """w_h/b of a Coleman-Hodgdon model with decay a at the present voltage [V], by (3).

    A memory that still holds its beginning starts from zero. Else the oldest point is taken for the turning
    point of a steady loop around the middle of all that is remembered: at a voltage A above the
    middle that is -tanh(a A)/a.
    """
    points = start + POINTS
    count = int(path[start + COUNT])
    later = path[start + FURTHEST]
    h = hysteresis_step(0.0, path[start + PRESENT] - later, a, 1.0)
    kept = np.exp(-a * np.abs(path[start + PRESENT] - later))
    k = count - 1
    while k >= 0 and kept > FORGOTTEN:
        du = later - path[points + k]
        h += kept * hysteresis_step(0.0, du, a, 1.0)
        kept *= np.exp(-a * np.abs(du))
        later = path[points + k]
        k -= 1
    if k < 0 and path[start + DROPPED] != 0.0:
        twice = 2.0 * (later - middle(path, start))
        left = np.exp(-a * np.abs(twice))
        h -= kept * np.sign(twice) * (1.0 - left) / (1.0 + left) / a
    return h
