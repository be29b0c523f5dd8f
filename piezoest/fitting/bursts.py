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
    """Readings so far beyond the range of the others that no stage moves there, shape (N,).

    Parameters
    ----------
    u, x : ndarray, shape (N,)
        Voltage [V] and displacement [µm], NaN where they are missing.
    """
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

    Parameters
    ----------
    h : ndarray, shape (N,)
        Displacement less what a straight line makes of the voltage, without gaps [µm].
    explained : ndarray, shape (N,)
        What the voltage may do to a sample [µm].
    extent : float
        Range of the displacement [µm].
    stuck : ndarray, shape (N,), bool
        Samples that are known to be wrong.
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

    first = np.arange(BESIDE, h.size - count - BESIDE + 1)
    if first.size < BLOCK:
        return first[:0]
    before = 0.5 * (h[first - 1] + h[first - 2])
    after = 0.5 * (h[first + count] + h[first + count + 1])
    off = np.empty((count, first.size))
    for j in range(count):
        part = (j + 1.5) / (count + 2.0)
        off[j] = h[first + j] - (1.0 - part) * before - part * after
    size, most = np.abs(off).min(axis=0), np.abs(off).max(axis=0)
    reach = count + 2 * BESIDE
    moved = maximum_filter1d(explained, reach)[first + count // 2] * count
    limit = np.maximum(np.maximum(UNUSUAL * scale_of(most, BLOCK), SMALLEST * extent), moved)
    apart = np.max([np.abs(after - before), np.abs(h[first - 1] - h[first - 2]),
                    np.abs(h[first + count + 1] - h[first + count])], axis=0)  # fmt: skip
    return np.asarray(first[(size > limit) & (apart < BACK * size)])
