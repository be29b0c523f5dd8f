"""The calibration rows of Tables I and II, their tolerances, and how far a stage is from them."""

from __future__ import annotations

from typing import Any

import numpy as np

COLUMNS = ("alpha", "beta", "gamma", "K", "linear_max_error", "compensated_max_error", "error_reduction")
LINEAR, COMPENSATED = 4, 5
ROWS = ((2.5, 5.0), (5.0, 2.5), (5.0, 5.0), (7.5, 5.0))  # µm, Hz
SLOW, FAST = 1, 2  # the rows of one amplitude and two frequencies
PAPER = np.array(
    [
        [3.26e-2, 1.36e-1, 5.96e-3, 0.141, 0.20, 0.016, 92.0],
        [1.91e-2, 1.49e-1, 4.05e-3, 0.156, 0.54, 0.055, 90.0],
        [2.10e-2, 1.47e-1, 4.29e-3, 0.155, 0.54, 0.045, 92.0],
        [1.59e-2, 1.55e-1, 3.55e-3, 0.165, 0.93, 0.053, 94.0],
    ]
)
RELATIVE_TOLERANCES = np.array([0.15, 0.02, 0.15, 0.02, 0.05, 0.25])
REDUCTION_TOLERANCE = 2.0  # points
LEAST_DIFFERENCE = 0.1  # of the paper's between 2.5 Hz and 5 Hz
_DIFFERING = [0, 1, 2, 3, 5]  # the linear errors are equal


def reductions(rows: Any) -> Any:
    """Error reductions [%] of rows of the first six columns."""
    return 100.0 * (1.0 - rows[:, COMPENSATED] / rows[:, LINEAR])


def deviations(rows: Any) -> Any:
    """Deviations from the paper, shape (28,), in parts of their tolerances."""
    relative = (rows / PAPER[:, :6] - 1.0) / RELATIVE_TOLERANCES
    points = (reductions(rows) - PAPER[:, 6]) / REDUCTION_TOLERANCE
    return np.concatenate((relative.ravel(), points))


def differences(rows: Any) -> Any:
    """Log ratios of the 2.5 Hz to the 5 Hz row in parts of the paper's: above 0 for its direction."""
    paper = np.log(PAPER[SLOW, :6] / PAPER[FAST, :6])[_DIFFERING]
    return np.log(rows[SLOW] / rows[FAST])[_DIFFERING] / paper


def worst(rows: Any) -> float:
    """The largest deviation in parts of its tolerance; infinite if a direction is wrong."""
    return float(np.max(np.abs(deviations(rows)))) if np.all(differences(rows) > 0.0) else np.inf
