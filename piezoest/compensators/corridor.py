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
Where the reference stays near the end of a leg, small movements are no turns at first. When it has moved for
as long as the leg took it has turned: legs are then as small as these movements. The line's centre follows
small legs sooner than its gain does, and the corridor becomes narrow later. One wrong sample of the reference
is no travel, and a voltage far outside the corridor moves no line.
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
    # Whether the reference has just jumped; it behind a play of what is noise [µm], samples for which that
    # has gone on up or down; moving samples up to the furthest reference of this leg, of the last leg, so far
    # in this leg; how long the reference has moved and not gone further [legs].
    jumped=FLAG, fine=MEASURED, steps=NUMBER, reach=COUNT, usual=COUNT, moved=COUNT, strayed=AMOUNT,
    # Gain of the first model; gain and centre of the line; means of voltage and reference over the last
    # swings, mean square of the voltage's deviation and mean product of both, weight of all that.
    first_gain=NUMBER, gain=NUMBER, centre=NUMBER, mean_u=MEASURED, mean_r=MEASURED, square=AMOUNT,
    product=NUMBER, known=SHARE,
    # Samples at which the corridor was in the way, whether there was any, legs so far, whether the voltage
    # wanted is so far off that it says nothing of the line.
    used=COUNT, begun=FLAG, legs=COUNT, absurd=FLAG,
)  # fmt: skip

# Half-width, as a fraction of half the recent swing of the reference; before the line is known by half.
WIDTH, FIRST_WIDTH, ENOUGH = 0.3, 1.0, 0.5
# So many half-widths from a known line a voltage is absurd.
ABSURD = 10.0
# A model takes effect from this fraction on of the last leg, or of the present one if that is longer.
HAND_OVER = 1.0 / 64.0
# A way back is a turn from this fraction of such a leg on.
TURN = 0.02
# The reference has turned, too, when it has moved for so many legs, by time or travel, but not further.
STAYS = 1.0
# What does not go on for more samples than this is noise.
NOISY = 5.0
# What each turn leaves of half the swing, at least; the line remembers so many swings.
FADES, MEMORY = 0.95, 2.0
# The line's gain is at least the first model's over this factor: what asks for more voltage has run away.
NEAR = 2.0
# No travel is less than this fraction of the range, of which so many volts count at most: a setpoint's noise.
LEAST, USUAL_RANGE = 1e-4, 100.0
# Legs are small below this fraction of the widest swing.
SMALL = 0.1
# Beyond this a gain is no number.
LARGEST = 1e100


@register_jitable
def begin(corridor: Any, settings: Any, u: Any, x: Any, gain: Any) -> None:
    """Begin with zeros, at rest at voltage u and displacement x, and a line of this gain through both."""
    corridor.furthest = corridor.turned = corridor.present = corridor.handed = corridor.mean_r = x
    corridor.smooth = corridor.fine = x
    corridor.mean_u = u
    corridor.gain = corridor.first_gain = gain
    corridor.least = np.abs(LEAST * gain) * min(settings.maximum - settings.minimum, USUAL_RANGE)
    corridor.centre = x - gain * u
    corridor.due = 1.0


@register_jitable
def kept(corridor: Any, settings: Any, r: Any, wanted: Any) -> Any:
    """`wanted` kept within the corridor, where models follow one another soon; r is the next reference."""
    _move(corridor, r)
    if corridor.soon == 0.0:
        return wanted
    # Part of the corridor is always within the range, so that no line can hold the voltage at a limit.
    line = min(max((r - corridor.centre) / corridor.gain, settings.minimum), settings.maximum)
    width = WIDTH if corridor.known >= ENOUGH else FIRST_WIDTH
    room = np.abs(width * corridor.half_swing / corridor.gain)
    corridor.absurd = corridor.known >= ENOUGH and np.abs(wanted - line) > ABSURD * room
    inside = min(max(wanted, line - room), line + room)
    corridor.used += inside != wanted
    return inside


@register_jitable
def _move(corridor: Any, r: Any) -> None:
    """Go to the next reference."""
    corridor.begun = 1.0
    jumps = corridor.legs > 0.0 and np.abs(r - corridor.present) > 2.0 * corridor.half_swing
    corridor.jumped = jumps and corridor.jumped == 0.0
    if corridor.jumped != 0.0:
        # It may be one wrong sample: it counts if the next one is there, too.
        r = corridor.present
    corridor.present = r
    leg = max(corridor.leg, np.abs(r - corridor.turned))
    fine = play(corridor.fine, r, 0.5 * corridor.least)
    gone, corridor.fine = fine - corridor.fine, fine
    corridor.steps = corridor.steps + np.sign(gone) if gone * corridor.steps >= 0.0 else np.sign(gone)
    if np.abs(corridor.steps) > NOISY and gone != 0.0:
        corridor.moved += 1.0
        by_time = 1.0 / max(corridor.reach, corridor.usual, 1.0)
        corridor.strayed += by_time + np.abs(gone) / max(2.0 * corridor.half_swing, np.abs(gone))
    least = max(HAND_OVER * leg, corridor.least)
    smooth = play(corridor.smooth, r, 0.5 * least)
    corridor.travel = np.abs(smooth - corridor.smooth)
    corridor.smooth = smooth
    if np.abs(r - corridor.handed) >= least:
        corridor.due = 1.0
    corridor.half_swing = max(corridor.half_swing, 0.5 * np.abs(r - corridor.turned))


@register_jitable
def follow(corridor: Any, u: Any, slewed: Any) -> None:
    """Take the voltage given out; `slewed` is whether its rate was in the way."""
    r = corridor.smooth
    way = corridor.direction * (r - corridor.furthest)
    if way > 0.0 or corridor.direction == 0.0:
        corridor.direction = np.sign(r - corridor.turned)
        corridor.furthest = r
        corridor.reach, corridor.strayed = corridor.moved, 0.0
    elif -way > TURN * max(corridor.leg, np.abs(corridor.furthest - corridor.turned)):
        _turn(corridor, r)
    elif corridor.strayed > STAYS:
        _turn(corridor, r)
        corridor.due = 1.0
    if corridor.soon * (1.0 - slewed) * (1.0 - corridor.absurd) != 0.0 and corridor.legs > 0.0:
        _follow_line(corridor, u, corridor.present)


@register_jitable
def _turn(corridor: Any, r: Any) -> None:
    """Begin another leg."""
    corridor.leg = np.abs(corridor.furthest - corridor.turned)
    if corridor.leg > TURN * 2.0 * corridor.half_swing:
        corridor.half_swing = max(0.5 * corridor.leg, FADES * corridor.half_swing)
    corridor.turned = corridor.furthest
    corridor.furthest = r
    corridor.direction = -corridor.direction
    corridor.usual, corridor.reach, corridor.moved, corridor.strayed = corridor.reach, 0.0, 0.0, 0.0
    corridor.turns += 1.0
    corridor.legs += 1.0
    corridor.soon *= corridor.turns < 2.0


@register_jitable
def _follow_line(corridor: Any, u: Any, r: Any) -> None:
    """Take a voltage and its reference into the line, by the reference's travel."""
    if corridor.travel == 0.0 or corridor.half_swing <= 0.0:
        return
    weight = corridor.travel / (2.0 * MEMORY * corridor.half_swing)
    corridor.known = min(corridor.known + weight, 1.0)
    share = min(weight / corridor.known, 1.0)
    du, dr = u - corridor.mean_u, r - corridor.mean_r
    # Legs that are much smaller than the widest swing are no loops within it: the centre follows them soon.
    leg = max(corridor.leg, np.abs(r - corridor.turned), corridor.travel)
    near = share
    if leg < SMALL * 2.0 * corridor.half_swing:
        near = max(share, corridor.travel / (MEMORY * leg))
    corridor.mean_u += near * du
    corridor.mean_r += near * dr
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
