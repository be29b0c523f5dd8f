"""Where a column of a log ends at a limit: a sensor or a recorder at the end of its range, or a stop."""

from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.runs import BoolArray, runs
from piezoest.fitting.surprise import noise_in

# A column is at its limit within this part of its range.
AT_LIMIT = 1e-3
# Of the way on that must be back at the end of a flat top, and of the log that flat tops are looked for in.
BACK, MOST_TOPS, EARLY = 0.3, 10_000, 0.15
# A limit at which noise ends, too: repeated so often where other values are repeated in this part of the log
# at most. Then the other column needs to go on by this part only.
FEWEST_REPEATS, SELDOM, EXACTLY = 10, 0.01, 0.1
# No sensor has less noise than this part of the range.
SILENT = 1e-5


class Top(NamedTuple):
    """Stretches in which a column stands at its limit while the other column goes on and comes back."""

    limit: float  # value at which it stands
    times: int  # how many stretches
    beyond: float  # how far the other one goes on, in its unit
    samples: BoolArray  # marks of their samples, shape (N,)


def flat_tops(y: FloatArray, other: FloatArray, goes_on: float) -> tuple[Top, ...]:
    """Find where a column is clipped, above and below: the other one goes on by a part of its range."""
    above, below = _tops(y, other, goes_on), _tops(-y, -other, goes_on)
    lower = below._replace(limit=-below.limit) if below else None
    return tuple(top for top in (above, lower) if top)


def marked(tops: tuple[Top, ...], size: int) -> BoolArray:
    """Marks of all samples in flat tops of a log of so many samples."""
    marks = np.zeros(size, dtype=np.bool_)
    for top in tops:
        marks |= top.samples
    return marks


def _tops(y: FloatArray, other: FloatArray, goes_on: float) -> Top | None:
    extent, reach, top = float(np.ptp(y)), float(np.ptp(other)), float(y.max())
    noise = noise_in(np.diff(y, 3))
    tolerance = min(max(AT_LIMIT * extent, 7.0 * noise), 0.02 * extent)
    # Both ends of a raster without noise are repeated, too.
    exact = _stands_only_at(y, (top, float(y.min())) if noise > SILENT * extent else (top,))
    if exact:
        tolerance, goes_on = 0.0, EXACTLY * goes_on
    there = y >= top - tolerance
    starts, ends = runs(there)
    beyond, samples = [], there if exact else np.zeros_like(there)
    for start, end in zip(starts[:MOST_TOPS], ends[:MOST_TOPS], strict=True):
        part = other[start:end]
        on, back = float(part.max() - part[0]), float(part.max() - part[-1])
        # What overshoots as the column comes to rest has its greatest value at once.
        amid = EARLY < np.argmax(part) / (end - start) < 1.0 - EARLY
        if end - start > 5 and amid and min(on, back) > goes_on * reach and back > BACK * on:
            beyond.append(on)
            samples[start:end] = True
    return Top(top, len(beyond), max(beyond), samples) if beyond else None


def _stands_only_at(y: FloatArray, limits: tuple[float, ...]) -> bool:
    """Whether a column repeats the first of its limits, and but for these hardly any other value."""
    same, value = np.diff(y) == 0.0, y[1:]
    repeats, others = int(np.sum(same & (value == limits[0]))), same & ~np.isin(value, limits)
    return repeats >= FEWEST_REPEATS and int(np.sum(others)) < SELDOM * y.size
