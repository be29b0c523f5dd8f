"""Samples that no model is to follow, as a fit's residual shows them."""

from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.runs import BoolArray

# The start is left out as long as it is off by this many robust standard deviations, at most this fraction.
UNSETTLED, LONGEST_UNSETTLED = 4.0, 0.1
# A sample is a spike that is off from its neighbours by this many robust standard deviations, and this many
# times as far as the nearest two are: about a kink they are half as far as the sample itself.
SPIKE, ALONE = 8.0, 3.0
# At a step the voltage moves by so many times what it does in the mean, and by this part of its range; so
# many samples beside it a lag or creep may look like a jump or a spike of the sensor.
STEP, LEAST_STEP, BESIDE = 8.0, 0.02, 5
# Standard deviation of a normal distribution whose median is one from zero.
NORMAL = 1.4826


def unsettled(residual: FloatArray) -> int:
    """Samples at the start that are off by far more than the rest, because the stage had not settled."""
    known = np.flatnonzero(np.isfinite(residual))
    values = residual[known]
    deviation = NORMAL * float(np.median(np.abs(values)))
    longest = int(LONGEST_UNSETTLED * residual.size)
    off = np.abs(values[known < longest]) > UNSETTLED * deviation
    if deviation == 0.0 or not np.any(off[:3]):
        return 0
    # A stage that settles may cross zero: ten quiet samples in a row are the end.
    quiet = np.convolve(off, np.ones(10), mode="valid") == 0.0
    end = int(known[np.argmax(quiet)]) if np.any(quiet) else longest
    # Twice as long, for what has fallen below the threshold is not yet gone.
    return min(2 * end, longest)


def beside_steps(u: FloatArray) -> BoolArray:
    """Which samples are near a step of a voltage, shape (N,)."""
    moves = np.abs(np.diff(u, prepend=u[0]))
    steps = (moves > STEP * np.mean(moves)) & (moves > LEAST_STEP * np.ptp(u))
    return np.convolve(steps, np.ones(2 * BESIDE + 1), mode="same") > 0.5


def lonely(residual: FloatArray) -> Any:
    """Which samples alone are far from those about them, shape (N,); neither slopes nor kinks count."""
    from scipy.ndimage import median_filter

    known = np.flatnonzero(np.isfinite(residual))
    found = np.zeros(residual.size, bool)
    values = residual[known]
    # Half-way between the medians of the three before and of the three after: a slope cancels.
    medians = np.pad(median_filter(values, 3, mode="nearest"), 2, mode="edge")
    apart = np.abs(values - 0.5 * (medians[:-4] + medians[4:]))
    deviation = NORMAL * float(np.median(apart))
    beside = np.pad(apart, 1)
    beside = np.maximum(beside[:-2], beside[2:])
    if deviation > 0.0:
        found[known] = (apart > SPIKE * deviation) & (apart > ALONE * beside)
    return found
