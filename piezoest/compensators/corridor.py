"""The corridor that an adaptive voltage stays in, and when a model may be handed over.

A model that is learnt from what its own inverse commands closes a loop, which can run away. Two things keep
it from that. A model takes effect by travel: when the reference has moved by a fraction of its last leg since
the last one did. And since the hysteresis of a piezo stage is 10 to 20 % of its stroke, the voltage stays
within a fraction of half the recent swing around a straight line, linear feed-forward: the least-squares line
of the voltages that were given for the reference over the last swings. It follows the models, but slowly, for
none of them can lead the voltage far from it. Until a leg has told their gain, the corridor is wide, around
the first model's line. A model that is set once, and drives for two turns, was not learnt in such a loop and
has no corridor.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

# Flat memory within a larger array: turns of the reference since the last hand-over, whether one came soon
# after another; direction of travel, furthest reference in it, where this leg began, length of the last [µm];
TURNS, SOON, DIRECTION, FURTHEST, TURNED, LEG = range(6)
# the reference now, its travel since the last sample, the one at the last hand-over [µm], whether it is time
# for the next, half the recent swing [µm];
PRESENT, TRAVEL, HANDED, DUE, HALF = range(6, 11)
# gain and centre of the line; means of voltage and reference over the last swings, mean square of the
# voltage's deviation and mean product of both, weight of all that;
GAIN, CENTRE, MEAN_U, MEAN_R, SQUARE, PRODUCT, KNOWN = range(11, 18)
# samples at which the corridor was in the way, whether there was any, legs so far.
USED, BEGUN, LEGS, SIZE = range(18, 22)

# Half-width, as a fraction of half the recent swing of the reference; before the line is known by half.
WIDTH, FIRST_WIDTH, ENOUGH = 0.3, 1.0, 0.5
# A model takes effect from this fraction on of the last leg, or of the present one if that is longer.
HAND_OVER = 1.0 / 64.0
# A way back is a turn from this fraction of such a leg on.
TURN = 0.02
# The swing fades by this fraction of the reference's travel; the line remembers so many swings of it.
FADES, MEMORY = 0.125, 2.0
# Beyond this a gain is no number.
LARGEST = 1e100


@register_jitable
def begin(path: Any, start: int, u: Any, x: Any, gain: Any) -> None:
    """Begin at rest at voltage u, where the model has displacement x, with a line of this gain through it."""
    for k in range(SIZE):
        path[start + k] = 0.0
    path[start + FURTHEST] = path[start + TURNED] = path[start + PRESENT] = path[start + HANDED] = x
    path[start + MEAN_R] = x
    path[start + MEAN_U] = u
    path[start + GAIN] = gain
    path[start + CENTRE] = x - gain * u
    path[start + DUE] = 1.0


@register_jitable
def kept(path: Any, start: int, r: Any, wanted: Any) -> Any:
    """`wanted` kept within the corridor, where models follow one another soon; r is the next reference."""
    path[start + TRAVEL] = np.abs(r - path[start + PRESENT])
    path[start + PRESENT] = r
    path[start + BEGUN] = 1.0
    leg = max(path[start + LEG], np.abs(r - path[start + TURNED]))
    if np.abs(r - path[start + HANDED]) >= HAND_OVER * leg:
        path[start + DUE] = 1.0
    if path[start + SOON] == 0.0:
        return wanted
    faded = path[start + HALF] - FADES * path[start + TRAVEL]
    path[start + HALF] = max(np.abs(r - path[start + MEAN_R]), faded)
    line = (r - path[start + CENTRE]) / path[start + GAIN]
    width = WIDTH if path[start + KNOWN] >= ENOUGH else FIRST_WIDTH
    half = np.abs(width * path[start + HALF] / path[start + GAIN])
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
        path[start + FURTHEST] = r
    elif np.abs(way) > TURN * max(path[start + LEG], np.abs(path[start + FURTHEST] - path[start + TURNED])):
        path[start + LEG] = np.abs(path[start + FURTHEST] - path[start + TURNED])
        path[start + TURNED] = path[start + FURTHEST]
        path[start + FURTHEST] = r
        path[start + DIRECTION] = -path[start + DIRECTION]
        path[start + TURNS] += 1.0
        path[start + LEGS] += 1.0
        path[start + SOON] *= path[start + TURNS] < 2.0
    if path[start + SOON] != 0.0 and blocked == 0.0 and path[start + LEGS] > 0.0:
        _follow_line(path, start, u, r)


@register_jitable
def _follow_line(path: Any, start: int, u: Any, r: Any) -> None:
    """Take a voltage and its reference into the line, by the reference's travel."""
    if path[start + TRAVEL] == 0.0 or path[start + HALF] <= 0.0:
        return
    weight = path[start + TRAVEL] / (2.0 * MEMORY * path[start + HALF])
    path[start + KNOWN] = min(path[start + KNOWN] + weight, 1.0)
    share = min(weight / path[start + KNOWN], 1.0)
    du, dr = u - path[start + MEAN_U], r - path[start + MEAN_R]
    path[start + MEAN_U] += share * du
    path[start + MEAN_R] += share * dr
    path[start + SQUARE] = (1.0 - share) * (path[start + SQUARE] + share * du * du)
    path[start + PRODUCT] = (1.0 - share) * (path[start + PRODUCT] + share * du * dr)
    gain = path[start + PRODUCT] / path[start + SQUARE] if path[start + SQUARE] > 0.0 else 0.0
    if path[start + KNOWN] >= ENOUGH and gain * path[start + GAIN] > 0.0 and np.abs(gain) < LARGEST:
        path[start + GAIN] = gain
        path[start + CENTRE] = path[start + MEAN_R] - gain * path[start + MEAN_U]


@register_jitable
def hand_over(path: Any, start: int) -> None:
    """Note that another model was handed over."""
    if path[start + BEGUN] != 0.0:
        path[start + SOON] = path[start + TURNS] < 2.0
    path[start + TURNS] = 0.0
    path[start + HANDED] = path[start + PRESENT]
    path[start + DUE] = 0.0
