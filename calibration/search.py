"""The search: the smoothest shape within the tolerances, on the surrogate."""

from __future__ import annotations

from typing import Any

import numpy as np
import shape
import surrogate
import targets
from scipy.optimize import least_squares

ROWS = tuple(surrogate.row(*row) for row in targets.ROWS)
STEEPNESS = 30.0
FAILED = 50.0


def rows(p: Any, lags: tuple[float, float], start: Any, rounds: int = 5) -> Any:
    """Numbers (4, 6) of the calibration rows on the surrogate, iterated from those of `start`."""
    plant = shape.plant(p)
    return np.array(
        [surrogate.stationary(plant, row, lags, near, rounds) for row, near in zip(ROWS, start, strict=True)]
    )


def approach(p: Any, lags: tuple[float, float], correction: Any, power: float, evaluations: int) -> Any:
    """Least sum of the deviations to the power of 2·`power`: from afar, the way into the tolerances."""

    def residuals(found: Any) -> Any:
        d = np.clip(targets.deviations(found), -8.0, 8.0)
        return np.concatenate(
            (np.sign(d) * np.abs(d) ** power, np.minimum(targets.differences(found) - 0.3, 0.0))
        )

    return _solve(p, lags, correction, residuals, 1e-3, evaluations)


def smooth(
    p: Any, lags: tuple[float, float], correction: Any, weight: float, limit: float, evaluations: int
) -> Any:
    """Least penalty times `weight`, with deviations beyond `limit` punished by `STEEPNESS`."""

    def residuals(found: Any) -> Any:
        d = np.maximum(np.abs(targets.deviations(found)) - limit, 0.0)
        same = np.minimum(targets.differences(found) - targets.LEAST_DIFFERENCE, 0.0)
        return STEEPNESS * np.concatenate((d, 0.3 * same))

    return _solve(p, lags, correction, residuals, weight, evaluations)


def _solve(
    p: Any, lags: tuple[float, float], correction: Any, residuals: Any, weight: float, evaluations: int
) -> Any:
    near = [rows(p, lags, targets.PAPER, 20)]
    best = [np.inf]
    count = residuals(near[0] * correction).size

    def cost(p: Any) -> Any:
        try:
            found = rows(p, lags, near[0])
            value = residuals(found * correction)
        except ArithmeticError:
            value = np.full(count, FAILED)
        value = np.concatenate((value, np.sqrt(weight) * shape.penalty(p)))
        if value @ value < best[0] and value[0] != FAILED:
            best[0], near[0] = value @ value, found  # a warm start for the fixed point, no more
        return value

    return least_squares(
        cost,
        np.clip(p, shape.LOWEST + 1e-6, shape.HIGHEST - 1e-6),
        bounds=(shape.LOWEST, shape.HIGHEST),
        x_scale="jac",
        diff_step=1e-3,
        max_nfev=evaluations,
    ).x
