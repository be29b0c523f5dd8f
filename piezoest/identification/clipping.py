"""Readings that end at a limit, or come in coarse steps."""

from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.runs import runs
from piezoest.fitting.surprise import noise_in

# A column is at its limit within this part of its range.
AT_LIMIT = 1e-3
# Of the way on that must be back at the end of a flat top, and of the log that flat tops are looked for in.
BACK, MOST_TOPS, EARLY = 0.3, 10_000, 0.15
# A limit at which noise ends, too: repeated so often where other values are repeated in this part of the log
# at most. Then the other column needs to go on by this part only.
FEWEST_REPEATS, SELDOM, EXACTLY = 10, 0.01, 0.1


class Top(NamedTuple):
    """Stretches in which a column stands at its limit while the other column goes on and comes back."""

    limit: float  # value at which it stands
    times: int  # how many stretches
    beyond: float  # how far the other one goes on, in its unit


def flat_tops(y: FloatArray, other: FloatArray, goes_on: float) -> Top | None:
    """Find where a column is clipped: the other one goes on by a part of its range; None if it is not."""
    for sign in (1.0, -1.0):
        if found := _tops(sign * y, sign * other, goes_on):
            return Top(sign * found.limit, found.times, found.beyond)
    return None


def _tops(y: FloatArray, other: FloatArray, goes_on: float) -> Top | None:
    extent, reach, top = float(np.ptp(y)), float(np.ptp(other)), float(y.max())
    noise = noise_in(np.diff(y, 3))
    tolerance = min(max(AT_LIMIT * extent, 7.0 * noise), 0.02 * extent)
    if _stands_only_at(y, top):
        tolerance, goes_on = 0.0, EXACTLY * goes_on
    starts, ends = runs(y >= top - tolerance)
    beyond = []
    for start, end in zip(starts[:MOST_TOPS], ends[:MOST_TOPS], strict=True):
        part = other[start:end]
        on, back = float(part.max() - part[0]), float(part.max() - part[-1])
        # What overshoots as the column comes to rest has its greatest value at once.
        amid = EARLY < np.argmax(part) / (end - start) < 1.0 - EARLY
        if end - start > 5 and amid and min(on, back) > goes_on * reach and back > BACK * on:
            beyond.append(on)
    return Top(top, len(beyond), max(beyond)) if beyond else None


def _stands_only_at(y: FloatArray, top: float) -> bool:
    """Whether a column with noise repeats its greatest value, and hardly any other."""
    same = np.diff(y) == 0.0
    there = same & (y[1:] == top)
    return bool(np.sum(there) >= FEWEST_REPEATS and np.sum(same & ~there) < SELDOM * y.size)


def levels(y: FloatArray) -> tuple[float, float]:
    """Step of a column's values and how many of them its range holds; the count is infinite without steps."""
    values = np.unique(y)
    apart = np.diff(values)
    extent = float(np.ptp(y))
    apart = apart[apart > 1e-9 * extent]
    if not apart.size:
        return 0.0, np.inf
    step = float(np.min(apart))
    whole = np.abs(apart / step - np.rint(apart / step))
    return (step, extent / step) if np.median(whole) < 0.01 else (0.0, np.inf)
