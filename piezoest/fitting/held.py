"""What stands still: a voltage that rests, and readings of a sensor that is slower than the log."""

from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.runs import BoolArray, IntArray, runs
from piezoest.fitting.surprise import noise_in
from piezoest.signals.turns import TURN, turns

REPEATED, STEADY, FEWEST_CHANGES = 2, 0.8, 10
# Steps of the sensor that a changed reading moves by, where it is held and not coarse.
HELD_STEPS = 5.0
# A voltage that is held for so many times as long as the reading explains it.
ALIKE = (0.5, 1.5)
# So many readings must be left.
FEWEST_READINGS = 64
# A rest lasts for so many samples, and for this part of a swing; the voltage moves by this part of its
# range in it.
SHORTEST_REST, REST_OF_SWING = 20, 0.1
RESTING = 1e-3
# In the inner half of a rest the voltage rises or bends by no more than this part of that, and so many
# standard deviations of what noise makes of it: the top of a slow or small swing, where it does by a quarter,
# is none. Where noise hides that, a rest must last for so much longer.
STANDS, BENT, LONGER_IN_NOISE = 0.1, 6.0, 5


def repeats(u: FloatArray, x: FloatArray) -> int:
    """How many times in a row each reading [µm] stands where all are held alike; 1 if they are not.

    Where the voltage [V] stands as long, the stage stands still.
    """
    changed = np.flatnonzero(np.diff(x) != 0.0)
    if changed.size < FEWEST_CHANGES:
        return 1
    lengths: Any = np.diff(changed)
    usual = int(np.median(lengths))
    steady = float(np.mean(np.abs(lengths - usual) <= 1)) > STEADY
    if usual < REPEATED or not steady:
        return 1
    # Coarse steps repeat values too, but then each change is by one step.
    moved = np.abs(np.diff(x)[changed])
    fine = float(np.median(moved)) > HELD_STEPS * float(np.min(moved))
    if not fine and np.unique(x).size <= 0.5 * changed.size:
        return 1
    stood = np.diff(np.flatnonzero(np.diff(u) != 0.0))
    longest = float(np.median(stood)) if stood.size else float(u.size)
    alike = longest >= REPEATED and ALIKE[0] * usual <= longest <= ALIKE[1] * usual
    return 1 if alike else usual


def held(u: FloatArray, x: FloatArray) -> BoolArray:
    """Which samples only repeat the reading before, shape (N,); none if the log is of no slow sensor.

    Of a reading that stands far longer than the others, as that of a sensor that is lost does, one sample is
    taken in the usual time. Voltage [V] and displacement [µm] are NaN where they are missing.
    """
    nothing = np.zeros(x.size, dtype=np.bool_)
    known = np.flatnonzero(np.isfinite(u) & np.isfinite(x))
    usual = repeats(u[known], x[known])
    if usual < REPEATED:
        return nothing
    y = x[known]
    first = np.append(True, np.diff(y) != 0.0)
    index = np.arange(y.size)
    age = index - np.maximum.accumulate(np.where(first, index, 0))
    read = first | ((age >= 2 * usual) & (age % usual == 0))
    if np.count_nonzero(read) < FEWEST_READINGS:
        return nothing
    nothing[known[~read]] = True
    return nothing


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
