"""Where a signal turns: the ends of its swings."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from piezoest._checks import array_1d, non_negative
from piezoest.compile import Vector, compiled

# A voltage has turned when it runs back by this fraction of its range: less is noise, or a minor loop.
TURN = 0.05


def turns(values: Any, threshold: float) -> NDArray[np.intp]:
    """Samples at which a finite signal turns and then runs back by more than a threshold, in one pass.

    Source: the hysteresis filter of rainflow counting (ASTM E1049).
    """
    values = array_1d("values", values).copy()
    places = np.empty(values.size)
    return places[: _turns(values, non_negative("threshold", threshold), places)].astype(np.intp)


@compiled
def _turns(values: Vector, threshold: float, places: Vector) -> int:
    """Write the places of turns; return how many there are."""
    count, direction, place = 0, 0.0, 0
    low = high = extreme = values[0] if len(values) else 0.0
    for k in range(len(values)):
        value = values[k]
        if direction == 0.0:
            low, high = min(low, value), max(high, value)
            if high - low > threshold:
                direction = 1.0 if value == high else -1.0
                extreme, place = value, k
        elif direction * (value - extreme) > 0.0:
            extreme, place = value, k
        elif direction * (extreme - value) > threshold:
            places[count] = place
            count += 1
            direction, extreme, place = -direction, value, k
    return count
