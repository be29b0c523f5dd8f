"""Readings that are off together for a few samples, and error codes: what is far beyond all others."""

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.lost_voltage import LONGEST_DELAY, WILD
from piezoest.fitting.runs import BoolArray, IntArray
from piezoest.fitting.surprise import scale_of

# So many readings together are a burst. More of them are two jumps, or a dropout.
SHORTEST, LONGEST = 2, 6
# Readings on either side that say where the displacement should be, and how much it may differ between both
# sides, relative to the burst.
BESIDE, BACK = 2, 0.4
# A burst is off by so many standard deviations, and by this part of the range.
UNUSUAL, SMALLEST = 8.0, 0.02
# How far windows are off otherwise, as so many of them say: a burst is in a few.
BLOCK = 96
# No more than this part of a log is in bursts, or beyond the range.
MOST, RARE = 0.02, 0.02


def wild(u: FloatArray, x: FloatArray) -> BoolArray:
    """Readings [µm] so far beyond the range of the others that no stage moves there, shape (N,)."""
    known = np.isfinite(x)
    low, high = np.quantile(x[known], [RARE, 1.0 - RARE])
    beyond = np.where(known, np.maximum(low - x, x - high), 0.0)
    found = beyond > WILD * (high - low)
    if not found.any():
        return found
    from scipy.ndimage import maximum_filter1d

    # In a log of hardly anything but a rest the voltage goes as far beyond its own range.
    least, most = np.nanquantile(u, [RARE, 1.0 - RARE])
    driven = np.fmax(np.maximum(least - u, u - most), 0.0) > most - least
    about = maximum_filter1d(driven.astype(np.int8), 2 * LONGEST_DELAY + 1) > 0
    return np.asarray(found & ~about)


def bursts(
    h: FloatArray, explained: FloatArray, extent: float, stuck: BoolArray
) -> tuple[IntArray, IntArray]:
    """Stretches [start, end) of a few samples that are all off by far, after which all is as it was.

    `h` (N,): displacement less what a straight line makes of the voltage, without gaps [µm]. `explained`
    (N,): what the voltage may do to a sample [µm]. `extent`: range of the displacement [µm]. `stuck` (N,):
    samples that are known to be wrong.
    """
    starts, ends = np.empty((2, 0), np.int64)
    for count in range(SHORTEST, LONGEST + 1):
        found = _of_length(h, explained, extent, count)
        within = found[:, None] + np.arange(-BESIDE, count + BESIDE)
        found = found[~np.any(stuck[within], axis=1)]
        starts, ends = np.append(starts, found), np.append(ends, found + count)
    order = np.argsort(starts, kind="stable")
    starts, ends = starts[order], ends[order]
    apart = np.append(True, starts[1:] >= np.maximum.accumulate(ends)[:-1])[: starts.size]
    few = np.sum(ends - starts) <= MOST * h.size
    return (starts[apart], ends[apart]) if few else (starts[:0], ends[:0])


def _of_length(h: FloatArray, explained: FloatArray, extent: float, count: int) -> IntArray:
    """First samples of bursts of so many readings."""
    from scipy.ndimage import maximum_filter1d

    windows = h.size - count - 2 * BESIDE + 1
    if windows < BLOCK:
        return np.empty(0, np.int64)

    def reading(j: int) -> FloatArray:
        """That many samples after the first one of each window."""
        return h[BESIDE + j : BESIDE + j + windows]

    before = 0.5 * (reading(-1) + reading(-2))
    after = 0.5 * (reading(count) + reading(count + 1))
    off = np.empty((count, windows))
    for j in range(count):
        part = (j + 1.5) / (count + 2.0)
        off[j] = np.abs(reading(j) - (1.0 - part) * before - part * after)
    size = off.min(axis=0)
    if not np.any(size > SMALLEST * extent):
        return np.empty(0, np.int64)
    reach = count + 2 * BESIDE
    middle = BESIDE + count // 2
    moved = maximum_filter1d(explained, reach)[middle : middle + windows] * count
    usual = UNUSUAL * scale_of(off.max(axis=0), BLOCK)
    limit = np.maximum(np.maximum(usual, SMALLEST * extent), moved)
    apart = np.max([np.abs(after - before), np.abs(reading(-1) - reading(-2)),
                    np.abs(reading(count + 1) - reading(count))], axis=0)  # fmt: skip
    return np.flatnonzero((size > limit) & (apart < BACK * size)) + BESIDE
