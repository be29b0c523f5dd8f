"""The corridor that an adaptive voltage stays in, and when a model may be handed over.

A model that is learnt from what its own inverse commands closes a loop, which can run away. Two things keep
it from that. A model takes effect by travel: when the reference has moved by a fraction of its recent swing
since the last one did. And since the hysteresis of a piezo stage is 10 to 20 % of its stroke, the voltage
stays within a fraction of half the recent swing around a straight line, linear feed-forward, whose gain and
centre follow the models' own from one turn of the reference to the next, but only so fast. A model that has
driven for two turns or more was not learnt in such a loop: the line then goes through what it makes of them.

Until two legs of the reference have told the models' gain, the corridor is wide, around the first one's line.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

# Flat memory within a larger array: turns of the reference since the last hand-over, whether one came soon
# after another; direction of travel, furthest reference in it, where the present leg began [µm];
TURNS, SOON, DIRECTION, FURTHEST, TURNED = range(5)
# recent swing of the reference, its last leg, its present value, that at the last hand-over [µm], and whether
# it is time for the next;
SWING, LEG, PRESENT, HANDED, DUE = range(5, 10)
# voltage at the furthest reference and at the turn before, whether its range was in the way since;
U_FURTHEST, U_TURNED, BLOCKED = range(10, 13)
# gain and centre of the line, samples at which the corridor was in the way, whether any came, legs so far.
GAIN, CENTRE, USED, BEGUN, LEGS, SIZE = range(13, 19)

# Half-width, as a fraction of half the recent swing of the reference; until two legs have told the gain.
WIDTH, FIRST_WIDTH = 0.3, 3.0
# A model takes effect from this fraction on of the last leg, or of the present one if that is longer.
HAND_OVER = 1.0 / 64.0
# A way back is a turn from this fraction of the recent swing on; a leg takes this fraction of itself from it.
TURN, FADES = 0.02, 0.5
# Factor by which the line's gain may change in a turn; its centre by half the swing times that, less one.
LARGEST_RATIO, FIRST_RATIO = 1.25, 4.0
# Beyond this a ratio of gains is no number.
LARGEST = 1e100


@register_jitable
def begin(path: Any, start: int, u: Any, x: Any, gain: Any) -> None:
    """Begin at rest at voltage u, where the model has displacement x, with a line of this gain through it."""
    for k in range(SIZE):
        path[start + k] = 0.0
    path[start + FURTHEST] = path[start + TURNED] = path[start + PRESENT] = path[start + HANDED] = x
    path[start + U_FURTHEST] = path[start + U_TURNED] = u
    path[start + GAIN] = gain
    path[start + CENTRE] = x - gain * u
    path[start + DUE] = 1.0


@register_jitable
def swing(path: Any, start: int) -> Any:
    """Recent swing of the reference [µm]; before its first turn, twice the way so far."""
    leg = np.abs(path[start + FURTHEST] - path[start + TURNED])
    return max(path[start + SWING], leg) if path[start + SWING] > 0.0 else 2.0 * leg


@register_jitable
def kept(path: Any, start: int, r: Any, wanted: Any) -> Any:
    """`wanted` kept within the corridor, where models follow one another soon; r is the next reference."""
    path[start + BEGUN] = 1.0
    path[start + PRESENT] = r
    way = np.abs(r - path[start + HANDED])
    recent = max(swing(path, start), np.abs(r - path[start + TURNED]))
    # Before the first turn nobody knows how far a swing goes.
    if way >= HAND_OVER * max(path[start + LEG], np.abs(r - path[start + TURNED])):
        path[start + DUE] = 1.0
    if path[start + SOON] == 0.0:
        return wanted
    gain = path[start + GAIN]
    line = (r - path[start + CENTRE]) / gain
    width = WIDTH if path[start + LEGS] >= 2.0 else FIRST_WIDTH
    half = np.abs(0.5 * width * recent / gain)
    inside = min(max(wanted, line - half), line + half)
    path[start + USED] += inside != wanted
    return inside


@register_jitable
def follow(path: Any, start: int, u: Any, blocked: Any) -> None:
    """Take the voltage given out; `blocked` is whether its range or its rate was in the way."""
    r = path[start + PRESENT]
    way = r - path[start + FURTHEST]
    if path[start + DIRECTION] * way >= 0.0:
        if path[start + DIRECTION] == 0.0:
            path[start + DIRECTION] = np.sign(way)
    elif np.abs(way) > TURN * swing(path, start):
        _turn(path, start)
        path[start + DIRECTION] = -path[start + DIRECTION]
    else:
        return
    path[start + FURTHEST] = r
    path[start + U_FURTHEST] = u
    path[start + BLOCKED] = max(path[start + BLOCKED], blocked)


@register_jitable
def _turn(path: Any, start: int) -> None:
    """Note the recent swing, and let the line follow what the models made of it.

    By the voltages that were given for the reference, which go on without a bump whatever model comes: what
    one alone expects of them may be far off.
    """
    r_0, r_1 = path[start + TURNED], path[start + FURTHEST]
    u_0, u_1 = path[start + U_TURNED], path[start + U_FURTHEST]
    leg = np.abs(r_1 - r_0)
    path[start + SWING] = max(leg, path[start + SWING] - FADES * leg)
    path[start + LEG] = leg
    path[start + LEGS] += 1.0
    free = path[start + TURNS] >= 2.0 or path[start + SOON] == 0.0
    if path[start + BLOCKED] == 0.0 and u_1 != u_0:
        gain = path[start + GAIN]
        most = LARGEST_RATIO if path[start + LEGS] > 2.0 else FIRST_RATIO
        ratio = (r_1 - r_0) / (u_1 - u_0) / gain
        if not free:
            ratio = min(max(ratio, 1.0 / most), most)
        if ratio > 0.0 and ratio < LARGEST:
            gain = gain * ratio
        shift = 0.5 * (r_0 + r_1 - gain * (u_0 + u_1)) - path[start + CENTRE]
        if not free:
            furthest = (most - 1.0) * 0.5 * path[start + SWING]
            shift = min(max(shift, -furthest), furthest)
        path[start + GAIN] = gain
        path[start + CENTRE] += shift
    path[start + TURNS] += 1.0
    path[start + TURNED] = r_1
    path[start + U_TURNED] = u_1
    path[start + BLOCKED] = 0.0


@register_jitable
def hand_over(path: Any, start: int) -> None:
    """Note that another model was handed over."""
    if path[start + BEGUN] != 0.0:
        path[start + SOON] = path[start + TURNS] < 2.0
    path[start + TURNS] = 0.0
    path[start + HANDED] = path[start + PRESENT]
    path[start + DUE] = 0.0
