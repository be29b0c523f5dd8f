"""Samples that no model is to follow, as a fit's residual shows them."""

from __future__ import annotations

from typing import Any

import numpy as np

from piezoest._checks import FloatArray

# The start is left out as long as it is off by this many robust standard deviations, at most this fraction.
UNSETTLED, LONGEST_UNSETTLED = 4.0, 0.2
# It is over once so many samples, and so large a fraction of all, are quiet but for a few.
QUIET, QUIET_PART, RARE = 10, 0.02, 0.05
# A sample is a spike that is off from its neighbours' median by this many robust standard deviations.
SPIKE, NEIGHBOURS = 8.0, 7
# Standard deviation of a normal distribution whose median is one from zero.
NORMAL = 1.4826


def unsettled(residual: FloatArray) -> int:
    """Samples at the start that are off by far more than the rest, because the stage had not settled."""
    known = np.isfinite(residual)
    deviation = NORMAL * float(np.median(np.abs(residual[known])))
    off = np.abs(residual[: int(LONGEST_UNSETTLED * residual.size)]) > UNSETTLED * deviation
    if deviation == 0.0 or not np.any(off[:3]):
        return 0
    # A stage that settles may cross zero: a while of quiet samples is the end.
    while_ = max(QUIET, int(QUIET_PART * residual.size))
    quiet = np.convolve(off, np.ones(while_), mode="valid") <= RARE * while_
    end = int(np.argmax(quiet)) if np.any(quiet) else off.size
    # Twice as long, for what has fallen below the threshold is not yet gone.
    return min(2 * end, off.size)


def lonely(residual: FloatArray) -> Any:
    """Which samples are far from the median of those about them, shape (N,)."""
    from scipy.ndimage import median_filter

    known = np.flatnonzero(np.isfinite(residual))
    found = np.zeros(residual.size, bool)
    values = residual[known]
    apart = np.abs(values - median_filter(values, NEIGHBOURS, mode="nearest"))
    deviation = NORMAL * float(np.median(apart))
    if deviation > 0.0:
        found[known] = apart > SPIKE * deviation
    return found
