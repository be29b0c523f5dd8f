"""Rests of a log: stretches in which its voltage stands still."""

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.runs import IntArray, runs
from piezoest.fitting.surprise import noise_in
from piezoest.signals.turns import TURN, turns

# A rest lasts for so many samples, and for this part of a swing; the voltage moves by this part of its
# range in it.
SHORTEST_REST, REST_OF_SWING = 20, 0.1
RESTING = 1e-3
# In the inner half of a rest the voltage rises or bends by no more than this part of that, and so many
# standard deviations of what noise makes of it: the top of a slow or small swing, where it does by a quarter,
# is none. Where noise hides that, a rest must last for so much longer.
STANDS, BENT, LONGER_IN_NOISE = 0.1, 6.0, 5


def rests_of(u: FloatArray) -> IntArray:
    """Stretches [start, end) in which a voltage [V] without gaps stands still, shape (R, 2)."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    extent = float(np.ptp(u))
    noise = noise_in(np.diff(u, 3))
    tolerance = max(RESTING * extent, 7.0 * noise)
    swings = turns(u, max(TURN * extent, tolerance)).size + 1
    longer = LONGER_IN_NOISE if tolerance > RESTING * extent else 1
    shortest = max(SHORTEST_REST, round(longer * REST_OF_SWING * u.size / swings))
    if shortest >= u.size or extent == 0.0 or tolerance > 0.1 * extent:
        return np.empty((0, 2), np.int64)
    # The filters' window ends at its sample: then it begins `shortest - 1` samples before.
    origin = (shortest - 1) // 2
    high = maximum_filter1d(u, shortest, origin=origin, mode="nearest")
    low = minimum_filter1d(u, shortest, origin=origin, mode="nearest")
    still = high - low <= tolerance
    still[: shortest - 1] = False
    starts, ends = runs(still)
    found = np.stack((starts - (shortest - 1), ends), axis=1)
    quarters = np.diff(found, axis=1)[:, 0] // 4
    moved = np.array([_moved(u[a + q : b - q]) for (a, b), q in zip(found, quarters, strict=True)])
    return found[moved <= STANDS * RESTING * extent + BENT * noise / np.sqrt(2.0 * quarters)]


def _moved(u: FloatArray) -> float:
    """How far a parabola through a stretch goes [V]."""
    t = np.linspace(-1.0, 1.0, u.size)
    return float(np.ptp(np.polyval(np.polyfit(t, u, 2), t)))
