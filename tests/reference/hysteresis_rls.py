"""The paper's estimator written out with matrices: (18)-(20), W_p, discrete least squares."""

import numpy as np
from numpy.typing import NDArray

from tests.reference.least_squares import discrete

Array = NDArray[np.float64]


def coleman_hodgdon(
    u: Array,
    x: Array,
    fs: float,
    start: Array,
    uncertainty: float,
    noise: float,
    memory: float,
    cutoff: float,
) -> Array:
    """Parameters after each sample, shape (N, 3). Missing x are bridged by the samples around them."""
    pole = np.exp(-2.0 * np.pi * cutoff / fs)
    R = noise**2 * 2.0 * (1.0 - pole) ** 2 / (1.0 + pole)
    theta, P = start.copy(), np.diag((uncertainty * start) ** 2)
    filtered = np.zeros(4)
    history = np.tile(start, (u.size, 1))
    last = None
    for k in range(u.size):
        if np.isfinite(x[k]):
            if last is not None:
                du = np.diff(u[last : k + 1])
                middle = 0.5 * (u[last + 1 : k + 1] + u[last:k])
                travel = np.sum(np.abs(du))
                area = np.sum(np.abs(du) * middle)
                raw = np.array([-0.5 * (x[k] + x[last]) * travel, u[k] - u[last], area, x[k] - x[last]])
                filtered = pole * filtered + (1.0 - pole) * raw
                theta, P = discrete(theta, P, filtered[:3], filtered[3], np.exp(-1.0 / (fs * memory)), R)
            last = k
        history[k] = theta
    return history
