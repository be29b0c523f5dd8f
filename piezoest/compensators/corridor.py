"""The corridor that an adaptive voltage stays in, and when a model may be handed over.

A model that is learnt from what its own inverse commands closes a loop, which can run away. Two things keep
it from that. A model takes effect by travel: when the reference has moved by a fraction of its last leg since
the last one did. And since the hysteresis of a piezo stage is 10 to 20 % of its stroke, the voltage stays
within a fraction of half the recent swing around a straight line, linear feed-forward: the least-squares line
of the voltages that were given for the reference over the last swings. It follows the models, but slowly, for
none of them can lead the voltage far from it, and its gain is at least half the first model's.
Until a leg has shown their gain, the corridor is wide, around the first model's line. At a limit it reaches
back into the range, so that the voltage need not stay there. The noise of a setpoint is no travel. A model
that is set once, and drives for two turns, was not learnt in such a loop and has no corridor.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.equations.play import play
from piezoest.layout import AMOUNT, COUNT, DISTANCE, FLAG, MEASURED, NUMBER, SHARE, SIGN, record

CORRIDOR = record(
    # Turns of the reference since the last hand-over, whether one came soon after another.
    turns=COUNT, soon=FLAG,
    # Direction of travel, furthest reference in it, where this leg began, length of the last [µm].
    direction=SIGN, furthest=MEASURED, turned=MEASURED, leg=DISTANCE,
    # The reference now, the same behind a play, its travel since the last sample, the one at the last
    # hand-over [µm], whether it is time for the next, half the recent swing, what is noise at any rate [µm].
    present=MEASURED, smooth=MEASURED, travel=DISTANCE, handed=MEASURED, due=FLAG, half_swing=DISTANCE,
    least=DISTANCE,
    # Gain of the first model; gain and centre of the line; means of voltage and reference over the last
    # swings, mean square of the voltage's deviation and mean product of both, weight of all that.
    first_gain=NUMBER, gain=NUMBER, centre=NUMBER, mean_u=MEASURED, mean_r=MEASURED, square=AMOUNT,
    product=NUMBER, known=SHARE,
    # Samples at which the corridor was in the way, whether there was any, legs so far.
    used=COUNT, begun=FLAG, legs=COUNT,
)  # fmt: skip

# Half-width, as a fraction of half the recent swing of the reference; before the line is known by half.
WIDTH, FIRST_WIDTH, ENOUGH = 0.3, 1.0, 0.5
# A model takes effect from this fraction on of the last leg, or of the present one if that is longer.
HAND_OVER = 1.0 / 64.0
# A way back is a turn from this fraction of such a leg on.
TURN = 0.02
# What each turn leaves of half the swing, at least; the line remembers so many swings.
FADES, MEMORY = 0.95, 2.0
# The line's gain is at least the first model's over this factor: what asks for more voltage has run away.
NEAR = 2.0
# No travel is less than this fraction of the range, of which so many volts count at most: a setpoint's noise.
LEAST, USUAL_RANGE = 1e-4, 100.0
# Beyond this a gain is no number.
LARGEST = 1e100


@register_jitable
def begin(corridor: Any, settings: Any, u: Any, x: Any, gain: Any) -> None:
    """Begin with zeros, at rest at voltage u and displacement x, and a line of this gain through both."""
    corridor.furthest = corridor.turned = corridor.present = corridor.handed = corridor.mean_r = x
    corridor.smooth = x
    corridor.mean_u = u
    corridor.gain = corridor.first_gain = gain
    corridor.least = np.abs(LEAST * gain) * min(settings.maximum - settings.minimum, USUAL_RANGE)
    corridor.centre = x - gain * u
    corridor.due = 1.0


@register_jitable
def kept(corridor: Any, settings: Any, r: Any, wanted: Any) -> Any:
    """`wanted` kept within the corridor, where models follow one another soon; r is the next reference."""
    corridor.present = r
    corridor.begun = 1.0
    leg = max(corridor.leg, np.abs(r - corridor.turned))
    least = max(HAND_OVER * leg, corridor.least)
    smooth = play(corridor.smooth, r, 0.5 * least)
    corridor.travel = np.abs(smooth - corridor.smooth)
    corridor.smooth = smooth
    if np.abs(r - corridor.handed) >= least:
        corridor.due = 1.0
    corridor.half_swing = max(corridor.half_swing, 0.5 * np.abs(r - corridor.turned))
    if corridor.soon == 0.0:
        return wanted
    # Part of the corridor is always within the range, so that no line can hold the voltage at a limit.
    line = min(max((r - corridor.centre) / corridor.gain, settings.minimum), settings.maximum)
    width = WIDTH if corridor.known >= ENOUGH else FIRST_WIDTH
    room = np.abs(width * corridor.half_swing / corridor.gain)
    inside = min(max(wanted, line - room), line + room)
    corridor.used += inside != wanted
    return inside


@register_jitable
def follow(corridor: Any, u: Any, slewed: Any) -> None:
    """Take the voltage given out; `slewed` is whether its rate was in the way."""
    r = corridor.smooth
    way = r - corridor.furthest
    if corridor.direction * way >= 0.0:
        if corridor.direction == 0.0:
            corridor.direction = np.sign(way)
        corridor.furthest = r
    elif np.abs(way) > TURN * max(corridor.leg, np.abs(corridor.furthest - corridor.turned)):
        corridor.leg = np.abs(corridor.furthest - corridor.turned)
        corridor.half_swing = max(0.5 * corridor.leg, FADES * corridor.half_swing)
        corridor.turned = corridor.furthest
        corridor.furthest = r
        corridor.direction = -corridor.direction
        corridor.turns += 1.0
        corridor.legs += 1.0
        corridor.soon *= corridor.turns < 2.0
    if corridor.soon != 0.0 and slewed == 0.0 and corridor.legs > 0.0:
        _follow_line(corridor, u, corridor.present)


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
        corridor.gain = corridor.first_gain * max(gain / corridor.first_gain, 1.0 / NEAR)
        corridor.centre = corridor.mean_r - corridor.gain * corridor.mean_u


@register_jitable
def hand_over(corridor: Any) -> None:
    """Note that another model was handed over."""
    if corridor.begun != 0.0:
        corridor.soon = corridor.turns < 2.0
    corridor.turns = 0.0
    corridor.handed = corridor.present
    corridor.due = 0.0
