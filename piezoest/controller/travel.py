"""How far a signal goes from one turn to the next: the unit in which a controller counts.

Hysteresis depends on travel and not on time, so everything is counted in swings of the voltage.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.layout import COUNT, DISTANCE, FLAG, MEASURED, SIGN, record

# Direction of travel, furthest value in it, where this leg began, length of the last leg; usual swing, least
# one before two turns; turns so far, the last value, whether it has just turned; samples of this leg, those
# since it went on clearly, those of the last leg, and of the leg before; the farthest way back since it went
# on, the path to and fro since then, and where that was; the largest recent change from sample to sample; the
# recent extremes, and the widest swing, forgotten more slowly; whether this leg and the last one are each no
# longer than the leg before, and whether the last two were about as long as each other.
TRAVEL = record(
    direction=SIGN, furthest=MEASURED, turned=MEASURED, leg=DISTANCE, swing=DISTANCE, least=DISTANCE,
    turns=COUNT, last=MEASURED, turned_now=FLAG, count=COUNT, waits=COUNT, usual=COUNT,
    past=COUNT, back=DISTANCE, path=DISTANCE, mark=MEASURED, fastest=DISTANCE, highest=MEASURED,
    lowest=MEASURED, wide=DISTANCE, nested=FLAG, alike=FLAG,
)  # fmt: skip

# A way back of TURN swings is a turn. Before SHOWN turns a smaller one is: the first way may lead to a bias
# with small waves on it.
TURN, SHOWN, FIRST_TURN = 0.05, 2.0, 0.02
# A leg is longer than another by this part at least; it takes long from so many times its samples on.
LONGER, LONG = 0.1, 2.0
# Of two legs that are alike, the shorter one is at least this part of the longer one.
ALIKE = 0.95
# The least motion to and fro that is not noise, in swings and in noises of a reading.
SMALL, NOISE = 1e-3, 10.0
# A motion to and fro is noise if it goes on average farther from sample to sample than this part of the
# farthest way back: a scan has more samples in a leg.
JAGGED = 0.1
# So many samples tell noise from a single way to and fro. The noise of a rest is little if it goes to and fro
# by at most so many swings.
MANY, TREMBLES = 64.0, 4e-3
# No swing is below this fraction of the last one: noise at rest would be a swing.
LEAST = 0.02
# At each turn the largest recent change is multiplied by SLOWER, and the extremes come nearer to the present
# leg by FADES of the distance. The widest swing for the corridor is multiplied by NARROWER: a line that has
# seen wide legs comes to the small ones behind them more slowly than these extremes do.
SLOWER, FADES, NARROWER = 0.7, 0.1, 0.95


@register_jitable
def begin(travel: Any, value: Any, least: Any) -> None:
    """Begin, or start again, at a value; no swing is smaller than `least` before two turns."""
    travel.mark = travel.furthest = travel.turned = travel.last = travel.highest = travel.lowest = value
    travel.direction = travel.leg = travel.turns = travel.back = travel.path = 0.0
    travel.count = travel.waits = travel.usual = travel.past = travel.fastest = travel.wide = 0.0
    travel.swing = travel.least = least


@register_jitable
def are_alike(one: Any, other: Any, least: Any) -> bool:
    """Whether the shorter one of two lengths is at least this part of the longer one."""
    return min(one, other) >= least * max(one, other)


@register_jitable
def widest(travel: Any) -> float:
    """The widest recent swing: smaller ones do not erase what it has left."""
    return max(travel.swing, travel.highest - travel.lowest)


@register_jitable
def follow(travel: Any, value: Any) -> float:
    """Follow the signal to its next value; how far it has gone since the last one."""
    gone = np.abs(value - travel.last)
    travel.last = value
    travel.fastest = max(travel.fastest, gone)
    travel.turned_now = 0.0
    travel.count += 1.0
    travel.waits += 1.0
    travel.path += gone
    way = value - travel.furthest
    if travel.direction * way >= 0.0:
        if travel.direction == 0.0:
            travel.direction = np.sign(way)
        travel.furthest = value
        # A small scan that drifts does not go on.
        if np.abs(value - travel.mark) > SMALL * travel.swing:
            travel.waits = travel.back = travel.path = 0.0
            travel.mark = value
    elif np.abs(way) > (TURN if travel.turns >= SHOWN else FIRST_TURN) * travel.swing:
        leg = np.abs(travel.furthest - travel.turned)
        travel.turns += 1.0
        swing = max(leg, travel.leg, LEAST * travel.swing, travel.least if travel.turns < SHOWN else 0.0)
        travel.turned_now = 1.0
        travel.fastest *= SLOWER
        travel.past, travel.usual = travel.usual, travel.count
        travel.count = travel.waits = travel.back = travel.path = 0.0
        travel.nested = 1.0 if leg <= (1.0 + LONGER) * travel.leg else 0.0
        travel.alike = 1.0 if are_alike(leg, travel.leg, ALIKE) else 0.0
        travel.wide = max(NARROWER * travel.wide, widest(travel))
        travel.swing, travel.leg = swing, leg
        travel.turned = travel.furthest
        travel.furthest = travel.mark = value
        travel.direction = -travel.direction
        travel.highest += FADES * (max(travel.turned, value) - travel.highest)
        travel.lowest += FADES * (min(travel.turned, value) - travel.lowest)
    travel.back = max(travel.back, np.abs(value - travel.furthest))
    if np.abs(value - travel.turned) > (1.0 + LONGER) * travel.leg:
        travel.nested = 0.0
    travel.highest, travel.lowest = max(travel.highest, value), min(travel.lowest, value)
    travel.swing = max(travel.swing, np.abs(value - travel.turned))
    return gone


@register_jitable
def _smallest(travel: Any, noise: Any) -> float:
    """The least way to and fro that is not noise."""
    return max(SMALL * travel.swing, NOISE * noise)


@register_jitable
def _is_jagged(travel: Any) -> bool:
    """Whether the motion to and fro is noise, by how far it goes from sample to sample."""
    # The way forth to a smooth turn is none to and fro.
    fro = travel.path - np.abs(travel.furthest - travel.mark)
    return fro > JAGGED * travel.waits * travel.back


@register_jitable
def is_over(travel: Any, noise: Any) -> bool:
    """Whether a motion after a wide leg is too small for a turn; `noise` is that of a reading."""
    if travel.waits <= LONG * max(travel.usual, travel.count - travel.waits, 8.0):
        return False
    fro = travel.back - np.abs(travel.last - travel.furthest)
    return fro > _smallest(travel, noise) and not _is_jagged(travel)


@register_jitable
def narrow(travel: Any, waits: Any, least: Any) -> None:
    """Start again with a small swing, at the last value; a leg may take `waits` samples."""
    begin(travel, travel.last, least)
    travel.usual = waits


@register_jitable
def progress(travel: Any, gone: Any) -> float:
    """The weight of a sample: about one in all for a leg as long as the widest swing, else less."""
    # Half by travel, half by time; rests soon count nothing.
    usual = max(travel.usual, 8.0)
    by_time = 1.0 / max(usual, travel.count) if travel.count < 2.0 * usual else 0.0
    wide = widest(travel)
    return 0.5 * (in_swings(travel, gone) + by_time) * (travel.swing / wide if wide > 0.0 else 1.0)


@register_jitable
def _takes_long(travel: Any) -> bool:
    """Whether this leg takes much longer than usual."""
    # Of the last two legs the slower one: many steps up take longer than one step back.
    return travel.count > LONG * max(travel.usual, travel.past, 8.0)


@register_jitable
def rests(travel: Any, gone: Any) -> bool:
    """Whether a leg takes long, and the last sample has gone no farther: a rest is no part of a leg."""
    return _takes_long(travel) and (gone == 0.0 or travel.furthest != travel.last)


@register_jitable
def in_swings(travel: Any, gone: Any) -> float:
    """A distance as a fraction of a usual swing."""
    return min(gone / travel.swing, 1.0) if travel.swing > 0.0 else 0.0


@register_jitable
def trembles(travel: Any) -> bool:
    """Whether a leg takes long, and the signal now goes to and fro by little noise."""
    little = 0.0 < travel.back <= TREMBLES * travel.swing
    return _takes_long(travel) and little and travel.waits > MANY and _is_jagged(travel)


@register_jitable
def dithers(travel: Any, gone: Any, noise: Any) -> bool:
    """Whether a signal at rest moves to and fro by no more than noise."""
    small = travel.back <= _smallest(travel, noise) or _is_jagged(travel)
    return gone > 0.0 and rests(travel, gone) and small
