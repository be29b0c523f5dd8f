"""Holds a reference that rests but for noise: its mean is followed, and the voltage rests, too.

Each small motion to and fro moves some stages, and models, a little towards the middle of their loop; many
of them erase what hysteresis remembers.
"""

from typing import Any

from numba.extending import register_jitable

from piezoest.controller import travel as travels
from piezoest.layout import AMOUNT, COUNT, MEASURED, record

# Samples since the reference began to rest but for noise, zero if it does not; their mean; the mean square of
# the noise; the last value.
STILL = record(count=COUNT, mean=MEASURED, square=AMOUNT, last=MEASURED)
# Weight of a sample in the mean square, and the least one in the mean: a reference may drift.
SLOWEST = 1e-3
# The rest is over where the reference is so many standard deviations away. At first the standard deviation is
# taken to be this part of the way to and fro, which counts as so many samples.
DEVIATIONS, FIRST, SOON = 6.0, 0.25, 16.0


@register_jitable
def held(state: Any, r: Any) -> float:
    """The reference, or its mean while it rests but for noise."""
    still, reference = state.still, state.reference
    step, still.last = r - still.last, r
    if still.count == 0.0:
        if not travels.trembles(reference):
            return r
        still.mean, still.square = r, (FIRST * reference.back) ** 2
    off = r - still.mean
    if off * off > DEVIATIONS * DEVIATIONS * still.square:
        still.count = 0.0
        return r
    still.count += 1.0
    share = max(1.0 / still.count, SLOWEST)
    still.mean += share * off
    # By steps, which have twice the mean square of the noise: slow motion is none.
    still.square += max(1.0 / (still.count + SOON), SLOWEST) * (0.5 * step * step - still.square)
    return still.mean
