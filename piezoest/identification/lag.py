"""Whether a log's voltage can tell a lag of the displacement from the width of the hysteresis loop."""

from typing import Any

import numpy as np

from piezoest._checks import array_1d
from piezoest.fitting.coordinates import bridged
from piezoest.signals.turns import TURN, turns

# Swings whose durations or sizes differ by this factor move at rates that tell.
FACTOR = 1.5
# A voltage whose fastest change is so many times the usual one has steps; a sine has 1.6, a triangle 1.
STEPPED = 2.5


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
