"""The corridor that an adaptive voltage stays in, and when a model may be handed over.

A model that is learnt from what its own inverse commands closes a loop, which can run away. Two things keep
it from that. A model takes effect by travel: when the reference has moved by a fraction of its last leg since
the last one did. And since the hysteresis of a piezo stage is 10 to 20 % of its stroke, the voltage stays
within a fraction of half the recent swing around a straight line, linear feed-forward: the least-squares line
of the voltages that were given for the reference over the last swings. It follows the models, but slowly, for
none of them can lead the voltage far from it. Until a leg has shown their gain, the corridor is wide, around
the first model's line. A model that is set once, and drives for two turns, was not learnt in such a loop and
has no corridor.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.layout import AMOUNT, COUNT, DISTANCE, FLAG, MEASURED, NUMBER, SHARE, SIGN, record

CORRIDOR = record(
    # Turns of the reference since the last hand-over, whether one came soon after another.
    turns=COUNT,
    soon=FLAG,
    # Direction of travel, furthest reference in it, where this leg began, length of the last [µm].
    direction=SIGN,
    furthest=MEASURED,
    turned=MEASURED,
    leg=DISTANCE,
    # The reference now, its travel since the last sample, the one at the last hand-over [µm], whether it is
    # time for the next, half the recent swing [µm].
    present=MEASURED,
    travel=DISTANCE,
    handed=MEASURED,
    due=FLAG,
    half_swing=DISTANCE,
    # Gain and centre of the line; means of voltage and reference over the last swings, mean square of the
    # voltage's deviation and mean product of both, weight of all that.
    gain=NUMBER,
    centre=NUMBER,
    mean_u=MEASURED,
    mean_r=MEASURED,
    square=AMOUNT,
    product=NUMBER,
    known=SHARE,
    # Samples at which the corridor was in the way, whether there was any, legs so far.
    used=COUNT,
    begun=FLAG,
    legs=COUNT,
)

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
def begin(corridor: Any, u: Any, x: Any, gain: Any) -> None:
    """Begin with zeros, at rest at voltage u and displacement x, and a line of this gain through both."""
    corridor.furthest = corridor.turned = corridor.present = corridor.handed = corridor.mean_r = x
    corridor.mean_u = u
    corridor.gain = gain
    corridor.centre = x - gain * u
    corridor.due = 1.0


@register_jitable
def kept(corridor: Any, r: Any, wanted: Any) -> Any:
    """`wanted` kept within the corridor, where models follow one another soon; r is the next reference."""
    corridor.travel = np.abs(r - corridor.present)
    corridor.present = r
    corridor.begun = 1.0
    leg = max(corridor.leg, np.abs(r - corridor.turned))
    if np.abs(r - corridor.handed) >= HAND_OVER * leg:
        corridor.due = 1.0
    if corridor.soon == 0.0:
        return wanted
    faded = corridor.half_swing - FADES * corridor.travel
    corridor.half_swing = max(np.abs(r - corridor.mean_r), faded)
    line = (r - corridor.centre) / corridor.gain
    width = WIDTH if corridor.known >= ENOUGH else FIRST_WIDTH
    room = np.abs(width * corridor.half_swing / corridor.gain)
    inside = min(max(wanted, line - room), line + room)
    corridor.used += inside != wanted
    return inside


@register_jitable
def follow(corridor: Any, u: Any, blocked: Any) -> None:
    """Take the voltage given out; `blocked` is whether its range or its rate was in the way."""
    r = corridor.present
    way = r - corridor.furthest
    if corridor.direction * way >= 0.0:
        if corridor.direction == 0.0:
            corridor.direction = np.sign(way)
        corridor.furthest = r
    elif np.abs(way) > TURN * max(corridor.leg, np.abs(corridor.furthest - corridor.turned)):
        corridor.leg = np.abs(corridor.furthest - corridor.turned)
        corridor.turned = corridor.furthest
        corridor.furthest = r
        corridor.direction = -corridor.direction
        corridor.turns += 1.0
        corridor.legs += 1.0
        corridor.soon *= corridor.turns < 2.0
    if corridor.soon != 0.0 and blocked == 0.0 and corridor.legs > 0.0:
        _follow_line(corridor, u, r)


@register_jitable
def _follow_line(corridor: Any, u: Any, r: Any) -> None:
    """Take a voltage and its reference into the line, by the reference's travel."""
    if corridor.travel == 0.0 or corridor.half_swing <= 0.0:
        return
    weight = corridor.travel / (2.0 * MEMORY * corridor.half_swing)
    corridor.known = min(corridor.known + weight, 1.0)
    share = min(weight / corridor.known, 1.0)
    du, dr = u - corridor.mean_u, r - corridor.mean_r
    corridor.mean_u += share * du
    corridor.mean_r += share * dr
    corridor.square = (1.0 - share) * (corridor.square + share * du * du)
    corridor.product = (1.0 - share) * (corridor.product + share * du * dr)
    gain = corridor.product / corridor.square if corridor.square > 0.0 else 0.0
    if corridor.known >= ENOUGH and gain * corridor.gain > 0.0 and np.abs(gain) < LARGEST:
        corridor.gain = gain
        corridor.centre = corridor.mean_r - gain * corridor.mean_u


@register_jitable
def hand_over(corridor: Any) -> None:
    """Note that another model was handed over."""
    if corridor.begun != 0.0:
        corridor.soon = corridor.turns < 2.0
    corridor.turns = 0.0
    corridor.handed = corridor.present
    corridor.due = 0.0
