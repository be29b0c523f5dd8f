"""The straight line x = gain u + centre that readings show: linear feed-forward, always a candidate.

Least squares over the last two legs of the reference, up and down, so that a loop's width cancels. It is
fitted again at each turn; between turns nothing that a resonance or a lag does can lead it astray.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.layout import AMOUNT, COUNT, FLAG, MEASURED, NUMBER, record

# Points: how many; means of voltage and reading; mean squares of their deviations, mean product.
POINTS = record(
    count=AMOUNT, mean_u=MEASURED, mean_x=MEASURED, square=AMOUNT, square_x=AMOUNT, product=NUMBER
)
# The line; the one before the last turn, and before the one before; the gain it began with; whether the
# voltage was at a limit since the last turn; legs it rests on, turns since the last one, legs of late that
# agreed with it; length of the first leg when it was looked at last; points of this leg and of the last one.
LINE = record(
    gain=NUMBER, centre=NUMBER, last_gain=NUMBER, last_centre=NUMBER, held_gain=NUMBER, held_centre=NUMBER,
    first_gain=NUMBER, clipped=FLAG, legs=COUNT, small=COUNT, agreed=AMOUNT, looked=AMOUNT,
    now=POINTS, before=POINTS,
)  # fmt: skip

# Points of which a line explains less than this share teach nothing about its gain; it changes by no more
# than this factor at once, and by less after so many legs; before it grows no more than that in all.
EXPLAINED, CHANGE, LATER_CHANGE, CERTAIN = 0.8, 2.0, 1.3, 4.0
# Points of which a line explains less than this share teach nothing at all.
ANSWERED = 0.1
# Where no line explains the points, the stage goes too far at so many times what the gain says, if the
# voltage was at a limit and if not.
FARTHER, MUCH_FARTHER = 1.5, 2.5
# A leg whose mean square is so many times that of the next one does not count beside it.
UNLIKE = 6.0
# ... and one so much smaller than the last is no leg, but part of the next, for so many turns.
SMALL = 4.0
# A leg agrees with the line within this factor.
ALIKE = 1.6


@register_jitable
def begin(line: Any, gain: Any, u: Any, x: Any, leg: Any) -> None:
    """Begin with a gain and a line through one point; legs shorter than half of `leg` are not looked at."""
    line.gain = line.last_gain = line.held_gain = line.first_gain = gain
    line.centre = line.last_centre = line.held_centre = x - gain * u
    line.agreed = line.legs = line.before.count = 0.0
    line.looked = 0.25 * leg
    forget(line.now)


@register_jitable
def forget(points: Any) -> None:
    """Forget all points."""
    points.count = points.mean_u = points.mean_x = points.square = points.square_x = points.product = 0.0


@register_jitable
def add(points: Any, u: Any, x: Any, memory: Any) -> None:
    """Take a point; at most so many count, the last ones more."""
    points.count = min(points.count + 1.0, memory)
    share = 1.0 / points.count
    keep = 1.0 - share
    du, dx = u - points.mean_u, x - points.mean_x
    points.mean_u += share * du
    points.mean_x += share * dx
    points.square = keep * (points.square + share * du * du)
    points.square_x = keep * (points.square_x + share * dx * dx)
    points.product = keep * (points.product + share * du * dx)


@register_jitable
def slope(points: Any) -> float:
    """Slope of the points [µm/V]; zero without any."""
    return points.product / points.square if points.square > 0.0 else 0.0


@register_jitable
def explained(points: Any) -> float:
    """Share of the readings' mean square that a line explains: the square of their correlation."""
    both = points.square * points.square_x
    return points.product * points.product / both if both > 0.0 else 0.0


@register_jitable
def at(line: Any, u: Any) -> float:
    """Displacement on the line [µm]."""
    return line.gain * u + line.centre


@register_jitable
def voltage(line: Any, r: Any) -> float:
    """Voltage of the line for a reference [V]."""
    return (r - line.centre) / line.gain if np.abs(line.gain) > 0.0 else 0.0


@register_jitable
def _draw(line: Any, u: Any, x: Any, square: Any, square_x: Any, product: Any) -> None:
    """Draw the line through the middle of points, with their slope if they lie near it."""
    most = CHANGE if line.legs < CERTAIN else LATER_CHANGE
    answers = product * line.gain > 0.0 and product * product > ANSWERED * square * square_x
    farther = (FARTHER if line.clipped != 0.0 else MUCH_FARTHER) * line.gain
    if product * product > EXPLAINED * square * square_x and product * line.gain > 0.0:
        gain = product / square
        line.gain *= min(max(gain / line.gain, 1.0 / most), most)
        if line.legs < 1.0 and np.abs(line.gain) > CHANGE * np.abs(line.first_gain):
            # What lags goes on while the voltage hardly moves.
            line.gain = CHANGE * line.first_gain
    elif square_x > farther * farther * square > 0.0:
        # The stage goes much farther than the line says, late or ringing: with less voltage it does no harm.
        line.gain *= most
    elif not answers:
        # Readings that do not go with the voltage say nothing of the centre either: it would run away.
        return
    line.centre = x - line.gain * u


@register_jitable
def turn(line: Any) -> None:
    """The voltage has turned: draw the line through the last two legs."""
    now, before = line.now, line.before
    line.small += 1.0
    most = SMALL if line.legs > 2.0 else 1.0
    if now.count < 4.0 or (UNLIKE * now.square < before.square and line.small < most):
        return
    line.small = 0.0
    line.legs += 1.0
    line.held_gain, line.held_centre = line.last_gain, line.last_centre
    line.last_gain, line.last_centre = line.gain, line.centre
    ratio = slope(now) / line.gain
    agrees = explained(now) > EXPLAINED and 1.0 / ALIKE < ratio < ALIKE
    line.agreed = line.agreed + 1.0 if agrees else 0.5 * line.agreed
    if before.count == 0.0 or before.square > UNLIKE * now.square:
        _draw(line, now.mean_u, now.mean_x, now.square, now.square_x, now.product)
    else:
        # Both legs count alike, however long they took.
        u, x = 0.5 * (now.mean_u - before.mean_u), 0.5 * (now.mean_x - before.mean_x)
        _draw(
            line, before.mean_u + u, before.mean_x + x, 0.5 * (now.square + before.square) + u * u,
            0.5 * (now.square_x + before.square_x) + x * x, 0.5 * (now.product + before.product) + u * x,
        )  # fmt: skip
    before.count, before.mean_u, before.mean_x = now.count, now.mean_u, now.mean_x
    before.square, before.square_x, before.product = now.square, now.square_x, now.product
    line.clipped = 0.0
    forget(now)


@register_jitable
def grow(line: Any, leg: Any) -> bool:
    """Before there was a turn: draw the line each time the first leg has become twice as long."""
    now = line.now
    if line.legs > 0.0 or leg < 2.0 * line.looked or now.count < 16.0:
        return False
    line.looked = leg
    _draw(line, now.mean_u, now.mean_x, now.square, now.square_x, now.product)
    return True


@register_jitable
def hold(line: Any) -> None:
    """Return to the line before the last two turns, and forget the points since."""
    line.gain, line.centre = line.held_gain, line.held_centre
    line.last_gain, line.last_centre = line.gain, line.centre
    forget(line.now)
    line.before.count = 0.0


@register_jitable
def follow(line: Any, recent: Any) -> None:
    """Lay the line through the middle of the points of late."""
    if recent.count >= 4.0 and (recent.product * line.gain >= 0.0 or explained(recent) < EXPLAINED):
        line.centre = recent.mean_x - line.gain * recent.mean_u
