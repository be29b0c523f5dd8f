"""Gaps of the voltage: until it is known again what a stage remembers of them."""

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.runs import BoolArray, runs

# The voltage moves about as fast as this quantile of its changes.
FAST = 0.99
# An excursion of this part of the range is no matter; an extreme is reached that is nearer than this part.
SMALL, NEAR = 0.1, 0.02
# After a travel of so many ranges a stage is known well enough in any case.
LONGEST = 4.0
# Samples behind gaps are only left out if this part of all remains.
ENOUGH = 0.5


def remembered(u: FloatArray, bridged: FloatArray, counts: BoolArray) -> BoolArray:
    """Of the samples that count, those at which no turn in a gap is remembered; all of them if those are few.

    `u`: voltage, NaN where it is missing [V]; `bridged`: the same with straight lines there.
    """
    known = counts & ~forgotten(u, bridged)
    return known if np.count_nonzero(known) > ENOUGH * np.count_nonzero(counts) else counts


def forgotten(u: FloatArray, bridged: FloatArray) -> BoolArray:
    """Samples behind a gap of the voltage at which a turn in the gap may still be remembered.

    In a gap the voltage may have turned. What a stage remembers of that is wiped out when the voltage has
    gone as far, both ways. `u` and `bridged` are as in `remembered`.
    """
    found = np.zeros(u.size, dtype=np.bool_)
    starts, ends = runs(~np.isfinite(u))
    inner = (starts > 0) & (ends < u.size)
    low, high = float(bridged.min()), float(bridged.max())
    steps = np.abs(np.diff(u))
    fast = float(np.nanquantile(steps, FAST)) if np.any(np.isfinite(steps)) else high - low
    for start, end in zip(starts[inner], ends[inner], strict=True):
        sides = sorted((bridged[start - 1], bridged[end]))
        # A way of this length may lead so far beyond both sides.
        farther = 0.5 * (fast * (end - start + 1) - (sides[1] - sides[0]))
        if farther <= SMALL * (high - low):
            continue
        least, most = max(sides[0] - farther, low), min(sides[1] + farther, high)
        behind, near = bridged[end:], NEAR * (high - low)
        both = (np.minimum.accumulate(behind) <= least + near) & (
            np.maximum.accumulate(behind) >= most - near
        )
        far = np.cumsum(np.abs(np.diff(behind, prepend=behind[0]))) > LONGEST * (high - low)
        known = both | far
        found[end : end + (int(np.argmax(known)) if known.any() else behind.size)] = True
    return found
