"""What swings of the voltage that repeat show of a log, its noise, and what they hide: a lag."""

from typing import Any

import numpy as np

from piezoest._checks import FloatArray, array_1d
from piezoest.fitting.coordinates import bridged
from piezoest.records import Record
from piezoest.signals.turns import TURN, turns

# The voltage repeats itself if it differs from its last period by less than this fraction of its range, at so
# many of the samples of a whole period: at a single one two swings of unlike size may cross.
SAME, ALL = 2e-3, 0.95
# So many samples of repeated periods are enough to say something.
FEWEST = 200
# Swings whose durations or sizes differ by this factor move at rates that tell.
FACTOR = 1.5
# A voltage whose fastest change is so many times the usual one has steps; a sine has 1.6, a triangle 1.
STEPPED = 2.5


def noise_floor(record: Record, fallback: float) -> float:
    """Standard deviation of what no model of the voltage can know [µm].

    Where the voltage repeats itself, displacements a period apart differ by noise twice, after what has
    drifted between them is taken out. Where it does not, `fallback` is all that is known.
    """
    u, x = bridged(record.voltage), record.displacement
    extent = float(np.ptp(u))
    places = turns(u, TURN * extent)
    if places.size < 5:
        return fallback
    period = round(float(np.median(places[2:] - places[:-2])))
    best = min((_differences(u, x, period + k, extent) for k in (-1, 0, 1)), key=lambda found: -found.size)
    if best.size < FEWEST:
        return fallback
    blocks = (
        best[: best.size // period * period].reshape(-1, period) if best.size >= period else best[None, :]
    )
    apart = blocks - np.nanmean(blocks, axis=1, keepdims=True)
    return max(float(1.4826 * np.nanmedian(np.abs(apart)) / np.sqrt(2.0)), fallback)


def _differences(u: FloatArray, x: FloatArray, period: int, extent: float) -> FloatArray:
    """Differences of displacements a period apart, where the voltage was the same for a period."""
    if period < 2 or 2 * period > u.size:
        return np.empty(0)
    same = np.abs(u[period:] - u[:-period]) < SAME * extent
    count = np.cumsum(np.append(0, same))
    same[: period - 1] = False
    same[period - 1 :] &= count[period:] - count[:-period] >= ALL * period
    apart = (x[period:] - x[:-period])[same]
    return apart[np.isfinite(apart)]


def tells_lag(u: Any) -> bool:
    """Whether swings of several frequencies or sizes, or steps, tell a lag from a wider loop.

    The width of a hysteresis loop depends on how far the voltage swings, that of a lag on how fast. Where all
    swings are alike, as in a sine or a triangle of one frequency and one amplitude, the two look the same.
    """
    u = array_1d("u", u, allow_nan=True)
    if np.sum(np.isfinite(u)) < 3:
        return False
    u = bridged(u)
    extent = float(np.ptp(u))
    places = turns(u, TURN * extent)
    if extent == 0.0 or places.size < 2:
        return False
    # The ways before the first and behind the last turn are no whole swings.
    if _differ(np.diff(places)) or _differ(np.abs(np.diff(u[places]))):
        return True
    # Over a few samples, which is what noise does not do.
    apart = max(1, round(float(np.median(np.diff(places))) / 20.0))
    moved = np.abs(u[apart:] - u[:-apart])[places[0] : places[-1]]
    return bool(moved.size and np.quantile(moved, 0.99) > STEPPED * np.mean(moved))


def _differ(values: Any) -> bool:
    """Whether values, but for a few, spread by more than a factor."""
    low, high = np.quantile(values, [0.05, 0.95])
    return bool(high > FACTOR * max(low, 1.0 if values.dtype.kind == "i" else 0.0))
