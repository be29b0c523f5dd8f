"""The steps in which the values of a coarse converter come."""

import numpy as np

from piezoest._checks import FloatArray


def levels(y: FloatArray) -> tuple[float, float]:
    """Step of a column's values and how many of them its range holds; the count is infinite without steps."""
    values = np.unique(y)
    apart = np.diff(values)
    extent = float(np.ptp(y))
    apart = apart[apart > 1e-9 * extent]
    if not apart.size:
        return 0.0, np.inf
    step = float(np.min(apart))
    whole = np.abs(apart / step - np.rint(apart / step))
    return (step, extent / step) if np.median(whole) < 0.01 else (0.0, np.inf)
