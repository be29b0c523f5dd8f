"""The noise floor of a log: by how much periods differ that the voltage repeats."""

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import bridged
from piezoest.records import Record
from piezoest.signals.turns import TURN, turns

# The voltage repeats itself if it differs from its last period by less than this fraction of its range, at so
# many of the samples of a whole period: at a single one two swings of unlike size may cross.
SAME, ALL = 2e-3, 0.95
# So many samples of repeated periods are enough to say something.
FEWEST = 200


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
