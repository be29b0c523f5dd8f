"""The straight line x = gain u + centre through the readings: linear feed-forward, always a candidate.

Its slope is the spread of the readings, divided by that of the voltage, over the last legs of the reference.
Legs up and legs down count alike, so that the width of the loop cancels. The line is drawn again at turns
only, so that ringing and lag do not change it in between. A short leg takes little weight from those before
it, because small loops are flatter than the wide one around them.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.layout import AMOUNT, COUNT, DISTANCE, FLAG, MEASURED, NUMBER, SIGN, record

# Number of points; means of voltage and reading; mean squares and mean product of the deviations from them.
POINTS = record(
    count=AMOUNT, mean_u=MEASURED, mean_x=MEASURED, square=AMOUNT, square_x=AMOUNT, product=NUMBER
)
# The recent legs in one direction, and their total length [µm].
LEGS = record(length=DISTANCE, points=POINTS)
# The line; the lines before the last turn and before the turn before that; the gain at the beginning, and the
# way of the voltage that showed it [V]; how far the line has moved in the last two legs [µm], 0 if unknown;
# whether the voltage was at a limit since the last turn; legs so far, recent ones that agreed with the line;
# length of this leg at the last look [V], of the longest recent leg [µm]; direction of the last leg; points
# of this leg, of the legs before it, and of both directions together.
LINE = record(
    gain=NUMBER, centre=NUMBER, last_gain=NUMBER, last_centre=NUMBER, held_gain=NUMBER, held_centre=NUMBER,
    first_gain=NUMBER, first_leg=DISTANCE, drift=NUMBER, clipped=FLAG, legs=COUNT, agreed=AMOUNT,
    looked=AMOUNT, longest=DISTANCE, direction=SIGN, now=POINTS, up=LEGS, down=LEGS, both=POINTS,
)  # fmt: skip

# Share of the readings' mean square that a line must explain: for points to be straight, to show a gain, to
# show that a line is too steep, and to show anything at all.
EXPLAINED, SIGNED, TOO_STEEP, ANSWERED = 0.8, 0.5, 0.25, 0.1
# The gain changes by this factor at most at once, and by the second one after CERTAIN legs. In the first leg
# it grows by CHANGE at most in all, until the leg is so many times as long as the way that showed the gain.
CHANGE, LATER_CHANGE, CERTAIN, LONG = 2.0, 1.3, 4.0, 4.0
# In the dead zone after a turn the stage hardly answers: no line is flatter than this part of the first.
FLATTEST = 0.3
# Where no line explains the points, the stage goes too far from this multiple of the line's way on: the first
# if the voltage was at a limit, else the second.
FARTHER, MUCH_FARTHER = 1.5, 2.5
# ... by so many times the first gain at most, unless the voltage was at a limit: with still less voltage the
# stage would hardly follow.
STEEPEST = 4.0
# ... and not far enough below this multiple, if it goes less than half as far as the reference: the mean
# square of an even motion over a length is its square / 12.
EVEN = 12.0
NEARER, STANDS = 0.7, 0.5**2 / EVEN
# After a leg, the length KEPT (longest - leg) + LEFT leg of those before it still counts. At each turn the
# longest recent leg is multiplied by FADES.
LEFT, KEPT, FADES = 1.0 / 3.0, 2.0, 0.9
# Before so many legs only the last two count: the first may lead from rest to the reference. If the mean
# square of the first of the two is so many times larger, it does not count either.
SETTLED, UNLIKE = 4.0, 6.0
# A leg is looked at again when it is so many times as long.
GROWN = 2.0
# A leg agrees with the line within this factor; one shorter than this part of the longest says nothing.
ALIKE, SHORT = 1.6, 0.3


@register_jitable
def begin(line: Any, gain: Any, u: Any, x: Any, leg: Any) -> None:
    """Begin with a line through a point; legs shorter than half of `leg` are not looked at."""
    line.gain = line.last_gain = line.held_gain = line.first_gain = gain
    line.centre = line.last_centre = line.held_centre = x - gain * u
    line.agreed = line.legs = line.longest = line.direction = line.drift = 0.0
    line.first_leg, line.looked = leg, 0.25 * leg
    forget_legs(line)
    forget(line.now)


@register_jitable
def forget(points: Any) -> None:
    """Forget all points."""
    points.count = points.mean_u = points.mean_x = points.square = points.square_x = points.product = 0.0


@register_jitable
def forget_legs(line: Any) -> None:
    """Forget all legs that are over."""
    line.up.length = line.down.length = 0.0


@register_jitable
def add(points: Any, u: Any, x: Any, memory: Any) -> None:
    """Take a point; about the last `memory` points count."""
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
def spread(points: Any) -> float:
    """Spread of the readings over that of the voltage [µm/V]; zero without any."""
    # The least-squares slope is this times the correlation, which a delay or a wide loop reduces.
    return np.sqrt(points.square_x / points.square) if points.square > 0.0 else 0.0


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
def _join(points: Any, more: Any, share: Any) -> None:
    """Add points to others; the new ones get a share of the weight, 0 to 1."""
    keep = 1.0 - share
    du, dx = more.mean_u - points.mean_u, more.mean_x - points.mean_x
    points.mean_u += share * du
    points.mean_x += share * dx
    points.square = keep * (points.square + share * du * du) + share * more.square
    points.square_x = keep * (points.square_x + share * dx * dx) + share * more.square_x
    points.product = keep * (points.product + share * du * dx) + share * more.product


@register_jitable
def _take(legs: Any, now: Any, leg: Any, kept: Any) -> None:
    """Add a leg; of those before it, the length `kept` still counts."""
    legs.length = min(legs.length, kept) + leg
    _join(legs.points, now, leg / legs.length)


@register_jitable
def _draw(line: Any, points: Any, leg: Any, most: Any) -> None:
    """Draw the line through the middle of points; `leg` is how far the reference has gone meanwhile [µm].

    The gain changes by the factor `most` at most.
    """
    square, square_x, product = points.square, points.square_x, points.product
    answers = product * line.gain > 0.0 and product * product > ANSWERED * square * square_x
    nearer, steeper = NEARER * line.gain, np.abs(line.gain) > np.abs(line.first_gain)
    farther = (FARTHER if line.clipped != 0.0 else MUCH_FARTHER) * line.gain
    # The first leg may lead from rest to the reference, where there is no loop yet.
    least = SIGNED if line.legs > 1.0 else EXPLAINED
    if product * product > least * square * square_x and product * line.gain > 0.0:
        line.gain *= min(max(spread(points) / np.abs(line.gain), 1.0 / most), most)
        if np.abs(line.gain) < FLATTEST * np.abs(line.first_gain):
            line.gain = FLATTEST * line.first_gain
        short = line.legs < 1.0 and line.looked < LONG * line.first_leg
        if short and np.abs(line.gain) > CHANGE * np.abs(line.first_gain):
            # A stage that lags goes on while the voltage hardly moves.
            line.gain = CHANGE * line.first_gain
    elif square_x > farther * farther * square > 0.0:
        # Late or ringing, the stage goes much farther than the line says: less voltage is safe.
        steepest = np.inf if line.clipped != 0.0 else STEEPEST * line.first_gain / line.gain
        line.gain *= min(most, max(steepest, 1.0))
    elif square_x < nearer * nearer * square and square_x < STANDS * leg * leg and steeper:
        # The stage hardly moves: what made the line steeper, such as ringing, is over.
        line.gain = np.sign(line.gain) * max(np.abs(line.gain) / most, np.abs(line.first_gain))
    elif steeper and answers and explained(points) > TOO_STEEP and spread(points) < np.abs(line.gain):
        # The loop is wide on the small ways of a line that is too steep.
        line.gain *= max(spread(points) / np.abs(line.gain), 1.0 / most, line.first_gain / line.gain)
    elif not answers:
        # Readings that do not follow the voltage do not show the centre either: it would run away.
        return
    line.centre = points.mean_x - line.gain * points.mean_u


@register_jitable
def _through_both(line: Any, legs: Any, others: Any, direction: Any, leg: Any) -> None:
    """Draw the line through the legs of both directions; both count alike, whatever their readings."""
    unlike = line.legs <= SETTLED and others.points.square > UNLIKE * line.now.square
    # If a quick way back had too few readings, the legs of that direction are old.
    if unlike or direction == line.direction:
        others.length = 0.0
    line.direction = direction
    _join(line.both, legs.points, 1.0)
    if others.length > 0.0:
        _join(line.both, others.points, 0.5)
    _draw(line, line.both, leg, CHANGE if line.legs < CERTAIN else LATER_CHANGE)


@register_jitable
def turn(line: Any, direction: Any, leg: Any) -> None:
    """The reference has turned after a leg in a direction: draw the line through the recent legs."""
    now = line.now
    if now.count < 4.0 or leg <= 0.0:
        return
    line.longest = max(leg, FADES * line.longest) if line.legs >= SETTLED else leg
    kept = KEPT * (line.longest - leg) + LEFT * leg if line.legs >= SETTLED else 0.0
    line.legs += 1.0
    line.held_gain, line.held_centre = line.last_gain, line.last_centre
    line.last_gain, line.last_centre = line.gain, line.centre
    answers = False
    if leg > SHORT * line.longest:
        ratio = np.sign(now.product) * spread(now) / line.gain
        answers = explained(now) > SIGNED and ratio > 1.0 / ALIKE
        line.agreed = line.agreed + 1.0 if answers and ratio < ALIKE else 0.5 * line.agreed
    if direction > 0.0:
        _take(line.up, now, leg, kept)
        _through_both(line, line.up, line.down, direction, leg)
    else:
        _take(line.down, now, leg, kept)
        _through_both(line, line.down, line.up, direction, leg)
    u = line.both.mean_u
    line.drift = at(line, u) - (line.held_gain * u + line.held_centre) if answers else 0.0
    line.clipped = line.looked = 0.0
    forget(now)


@register_jitable
def tilt(line: Any, gain: Any, u: Any) -> None:
    """Give the line another gain; its point at u stays."""
    x = at(line, u)
    line.gain = gain
    line.centre = x - gain * u


@register_jitable
def steepen(line: Any, u: Any) -> None:
    """Let the line be as steep as the way to the reference or the recent legs, through its point at u."""
    steepest = max(np.abs(line.gain), np.abs(line.first_gain))
    if line.both.product * line.gain > 0.0 and explained(line.both) > SIGNED:
        steepest = max(steepest, spread(line.both))
    tilt(line, np.sign(line.gain) * steepest, u)


@register_jitable
def grow(line: Any, leg: Any) -> None:
    """Draw the line when the first leg has grown, or a later one is much longer than the recent ones."""
    now, later, looked = line.now, line.legs >= SETTLED, line.looked
    if later:
        # By the first gain if the line is steeper now, as where a resonance rings: the voltage hardly moves.
        gain = min(np.abs(line.gain), np.abs(line.first_gain))
        looked = max(looked, line.longest / gain)
        leg = min(leg, np.sqrt(EVEN * now.square))
    if 0.0 < line.legs < SETTLED or leg < GROWN * looked or now.count < 16.0:
        return
    line.looked = leg
    # The later one only if the line becomes steeper: small legs are flat, and a flat line leads too far.
    if not (later and (explained(now) < EXPLAINED or spread(now) < np.abs(line.gain))):
        _draw(line, now, 0.0, CHANGE)


@register_jitable
def hold(line: Any) -> None:
    """Return to the line before the last two turns, and forget the points since."""
    line.gain, line.centre = line.held_gain, line.held_centre
    line.last_gain, line.last_centre = line.gain, line.centre
    line.drift = 0.0
    forget(line.now)
    forget_legs(line)


@register_jitable
def follow(line: Any, recent: Any) -> None:
    """Move the line to the middle of the recent points."""
    if recent.count >= 4.0 and (recent.product * line.gain >= 0.0 or explained(recent) < EXPLAINED):
        line.centre = recent.mean_x - line.gain * recent.mean_u
