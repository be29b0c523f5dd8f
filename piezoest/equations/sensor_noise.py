"""The sensor's noise as seen in a stream of readings, and the memory that keeps it out of an estimate.

White noise behind the low-pass W_p of App. A of Eielsen et al. (2012).
"""

from piezoest.compile import inlined
from piezoest.layout import AMOUNT, MEASURED, record, whole

# Readings that the variance is a mean of, and by how much noise may move the gain.
SAMPLES, PRECISION = 2000.0, 3e-3
# Least square of a swing of the displacement, in its noise's unit.
SMALLEST = 1e-12
# Least slope that a stage is thought to have, relative to the start's: an estimate that a fault has taken to
# zero would else make any noise look like the whole signal, and nothing would ever be learnt again.
LEAST_SLOPE = 0.03

# Variance as seen, the last two changes of x, and the changes seen.
NOISE = record(variance=AMOUNT, change=MEASURED, change_before=MEASURED, seen=whole(0.0, SAMPLES))


@inlined
def measure(noise, change):
    """Learn from the third differences of x, in which the smooth motion of a stage is small."""
    third = change - 2.0 * noise.change + noise.change_before
    noise.change_before = noise.change
    noise.change = change
    noise.seen = min(noise.seen + 1.0, SAMPLES)
    if noise.seen > 3.0:  # of the first differences none is whole
        noise.variance += (third * third / 20.0 - noise.variance) / (noise.seen - 3.0)


@inlined
def memory_squared(noise, swing, slope, unit, factor):
    """Square of the memory in swings with which the noise changes the gain by at most PRECISION.

    Over a swing of the displacement noise behind W_p leaves the slope (`slope`, in the start's, which is
    `unit`) uncertain by sqrt(2) times its relative size; `factor` says how much of it passes the filter.
    """
    if swing.usual == 0.0:
        return 0.0  # nobody knows yet how far a swing goes
    swing_of_x = swing.size * max(abs(slope), LEAST_SLOPE) * unit
    return noise.variance * factor / max(swing_of_x * swing_of_x, SMALLEST)
