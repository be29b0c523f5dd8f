"""Samples at which the recorded voltage is not what drove the stage: spikes, zeros, a column that is stuck.

A fit remembers every turn of the voltage, so one wrong sample may spoil all behind it. The displacement tells
a wrong voltage from a steep one: it does not answer.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import bridged
from piezoest.fitting.rows import dot
from piezoest.fitting.runs import BoolArray, IntArray, runs
from piezoest.fitting.surprise import scale_of

# A voltage beyond this part of the samples at either end, and so many of them, says nothing of the range.
RARE, FEWEST = 0.005, 3
# Part of the displacement's variance that a line in the voltage explains, where an answer can be asked for.
RELATED = 0.5
# The displacement may answer up to so many samples late.
LONGEST_DELAY = 30
# Samples that say how the voltage moves; it leaves that by so many standard deviations, and by this part of
# its range; for at most so many samples, until it is back but for this part of the way.
ABOUT, UNUSUAL, SMALLEST, LONGEST, BACK = 9, 6.0, 0.03, 7, 0.3
# ... or longer where it stands still between two steps of this size.
SMALLEST_STEP = 0.1
# The displacement answers by this part of what it should, above so many standard deviations, within so many
# samples behind its delay.
ANSWERED, CLEAR, SOON = 0.15, 3.0, 6
# No stage can answer what is so many times beyond the range.
WILD = 10.0
# So few excursions, for each sample, and so few samples in them are wrong; more of them, or so many changes,
# are the excitation.
FEW, MOST_LOST, MANY = 0.015, 0.05, 0.1
# A voltage stands still for so many samples, and times as long as it usually does. It is wrong if it ends
# with a step of so many times most of the changes, and if the displacement leaves it by so many times as much
# as it does in most of other stretches of that length, and by this part of its range.
SHORTEST, UNLIKELY, CAUGHT_UP, LEFT, MOST, MOVED = 12, 5.0, 3.0, 1.5, 0.95, 0.05
# ... but for a few samples of the stretch: the displacement may be late.
MIDDLE = (0.1, 0.9)
STRETCHES = 100
# Most changes of the voltage are no larger than this quantile of them.
USUALLY = 0.9


def lost_voltage(u: FloatArray, x: FloatArray) -> BoolArray:
    """Samples whose voltage [V] is wrong, shape (N,); NaN is missing, and at least 64 samples are known."""
    rows = (u == 0.0) & (x == 0.0)
    if np.mean(rows) < FEW:
        x = np.where(rows, np.nan, x)
    known, unseen = np.isfinite(u), ~(np.isfinite(x) | rows)
    found = np.zeros(u.size, dtype=np.bool_)
    found[known] = _lost(u[known], bridged(x)[known], unseen[known])
    return found


def _lost(u: FloatArray, x: FloatArray, unseen: BoolArray) -> BoolArray:
    """The same without gaps; where the displacement was not seen, it does not tell."""
    nothing = np.zeros(u.size, dtype=np.bool_)
    rare = max(RARE, FEWEST / u.size)
    low, high = np.quantile(u, [rare, 1.0 - rare])
    clipped = np.clip(u, low, high)
    seen = ~unseen
    about = clipped[seen] - clipped[seen].mean()
    gain = dot(about, x[seen]) / max(dot(about, about), 1e-300)
    steps, still = _steps(u, high - low), _still(u)
    wild = np.abs(u - clipped) > WILD * (high - low)
    suspect = 0 < steps.places.size <= MANY * u.size or still or wild.any()
    if not suspect or gain * np.std(about) <= np.sqrt(RELATED) * np.std(x[seen]):
        return nothing
    delay = delay_of(clipped, x)
    answer = np.where(unseen, np.inf, _off(x)[0])
    found = _excursions(u, steps, answer, gain, high - low, delay) | wild
    late = np.interp(np.arange(u.size) - delay, np.flatnonzero(~found), u[~found])
    left = np.where(unseen, np.nan, x - gain * late)
    return found | _frozen(still, left, gain * (high - low))


def delay_of(u: FloatArray, x: FloatArray) -> int:
    """Samples by which bends of the displacement come after those of the voltage; 0 if that does not show.

    Both are without gaps.
    """
    size = min(u.size, 200_000)
    bent_u, bent_x = np.diff(u[:size], 2), np.diff(x[:size], 2)
    # A spike must not decide.
    bent_x = np.clip(bent_x, *np.quantile(bent_x, [0.01, 0.99]))
    longest = min(LONGEST_DELAY, bent_u.size // 4)
    match = [dot(bent_u[: bent_u.size - d], bent_x[d:]) for d in range(longest + 1)]
    chance = float(np.linalg.norm(bent_u)) * float(np.std(bent_x))
    best = int(np.argmax(match))
    return best if match[best] - match[0] > UNUSUAL * chance else 0


def _off(y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far each change is from those about it, and what those are, shapes (N,); the first one is zero."""
    from scipy.ndimage import median_filter

    change = np.diff(y, prepend=y[0])
    usual = median_filter(change, ABOUT, mode="nearest")
    return np.abs(change - usual), usual


class _Steps(NamedTuple):
    """Changes of the voltage that are unlike those about them: where, how far off, and the usual change."""

    places: IntArray
    off: FloatArray
    usual: FloatArray


def _steps(u: FloatArray, extent: float) -> _Steps:
    off, usual = _off(u)
    return _Steps(np.flatnonzero(off > np.maximum(UNUSUAL * scale_of(off), SMALLEST * extent)), off, usual)


def _still(u: FloatArray) -> list[slice]:
    """Stretches in which the voltage stands still for longer than usual, and then catches up by a step.

    Behind a rest it moves on as before: what the displacement does there is a drift, or a jump of the sensor.
    """
    changes = np.abs(np.diff(u))
    moves = changes > 0.0
    starts, stops = runs(~moves)
    if not moves.any():
        return []
    shortest = max(SHORTEST, UNLIKELY * u.size / float(np.sum(moves)))
    step = CAUGHT_UP * float(np.quantile(changes[moves], USUALLY))
    # The last stretch may be stuck for good.
    ends = np.append(changes, np.inf)[stops] > step
    stuck = (stops + 1 - starts >= shortest) & ends
    return [slice(*each) for each in zip(starts[stuck], stops[stuck] + 1, strict=True)]


def _excursions(
    u: FloatArray, steps: _Steps, answer: FloatArray, gain: float, extent: float, delay: int
) -> BoolArray:
    """A few samples at which the voltage is far off, without an answer."""
    found = np.zeros(u.size, dtype=np.bool_)
    edges, off, usual = steps
    if edges.size > MANY * u.size:
        return found
    clear = CLEAR * scale_of(np.where(np.isfinite(answer), answer, 0.0))
    changes = np.append(np.flatnonzero(np.diff(u)) + 1, u.size)
    next_change = changes[np.searchsorted(changes, edges, side="right")]
    beyond = np.searchsorted(edges, edges + LONGEST, side="right")
    end = count = 0
    for k, (start, following) in enumerate(pairwise(edges)):
        if start <= end:
            continue
        near = edges[k + 1 : beyond[k]]
        way = u[near] - u[start - 1] - usual[start] * (near - start + 1)
        back = near[np.abs(way) <= BACK * np.maximum.accumulate(np.maximum(off[near], off[start]))]
        still = following - start > LONGEST and next_change[k] == following
        if not (back.size or still):
            continue
        stop = int(back[-1] if back.size else following)
        far = float(np.max(off[start : stop + 1]) if back.size else min(off[start], off[stop]))
        soon = np.arange(-1, delay + SOON)
        seen = np.minimum(np.r_[soon + start, soon + stop], u.size - 1)
        expected = ANSWERED * gain * far
        unanswered = clear[start] < expected and np.max(answer[seen]) < expected
        unanswered &= bool(back.size) or far > SMALLEST_STEP * extent
        if unanswered:
            found[start:stop], end, count = True, stop, count + 1
    return found if count < FEW * u.size and np.mean(found) < MOST_LOST else np.zeros_like(found)


def _frozen(still: list[slice], left: FloatArray, moves: float) -> BoolArray:
    """Of stretches those in which the displacement leaves the voltage, by `left`."""
    found = np.zeros(left.size, dtype=np.bool_)
    for part in still:
        size = part.stop - part.start
        places = np.linspace(0, left.size - size, STRETCHES).astype(int)
        others = [_moved(left[k : k + size]) for k in places if k + size <= part.start or k >= part.stop]
        usual = float(np.quantile(others, MOST)) if others else np.inf
        found[part] = _moved(left[part]) > max(LEFT * usual, MOVED * moves)
    return found


def _moved(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.subtract(*np.quantile(known, MIDDLE[::-1]))) if known.size >= SHORTEST else 0.0
