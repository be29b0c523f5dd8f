"""The calibration rows of Tables I and II, and the search: the smoothest stage within their tolerances."""

from collections.abc import Callable
from typing import Any

import numpy as np
import surrogate
from scipy.optimize import least_squares

from piezoest.bench.paper import TRIANGLES
from piezoest.bench.paper_tables import CALIBRATION_BOUNDS, published

COLUMNS = ("alpha", "beta", "gamma", "K", "linear_max_error", "compensated_max_error", "error_reduction")
SLOW, FAST = 1, 2  # the rows of one amplitude and two frequencies
_PUBLISHED = {(number.row, number.quantity): number.value for number in published() if number.table != "III"}


def of_paper(row: str) -> Any:
    """What the paper has for a row, in the order of `COLUMNS`."""
    return np.array([_PUBLISHED[row, column] for column in COLUMNS])


PAPER, REDUCTIONS = np.split(np.array([of_paper(each.name) for each in TRIANGLES]), [-1], axis=1)
REDUCTIONS = REDUCTIONS.ravel()  # %
*_relative, REDUCTION_TOLERANCE = (CALIBRATION_BOUNDS[column] for column in COLUMNS)  # the last in points
RELATIVE_TOLERANCES = np.array(_relative)
LEAST_DIFFERENCE = 0.1  # of the paper's between 2.5 Hz and 5 Hz
_DIFFERING = [0, 1, 2, 3, 5]  # the linear errors are equal
STEEPNESS, FAILED = 30.0, 50.0
_PERIODS = tuple(surrogate.period(each.amplitude, each.frequency) for each in TRIANGLES)


def reductions(rows: Any) -> Any:
    """Error reductions [%] of rows."""
    return 100.0 * (1.0 - rows[:, 5] / rows[:, 4])


def deviations(rows: Any) -> Any:
    """Deviations from the paper, shape (28,), in parts of their tolerances."""
    relative = (rows / PAPER - 1.0) / RELATIVE_TOLERANCES
    return np.concatenate((relative.ravel(), (reductions(rows) - REDUCTIONS) / REDUCTION_TOLERANCE))


def differences(rows: Any) -> Any:
    """Log ratios of the 2.5 Hz to the 5 Hz row in parts of the paper's: above 0 for its direction."""
    ours, paper = (np.log(each[SLOW] / each[FAST])[_DIFFERING] for each in (rows, PAPER))
    return ours / paper


def worst(rows: Any) -> float:
    """The largest deviation in parts of its tolerance; infinite if a direction is wrong."""
    return float(np.max(np.abs(deviations(rows)))) if np.all(differences(rows) > 0.0) else np.inf


class Search:
    """Search for a parameter vector on the surrogate, whose numbers are corrected by the ring's."""

    def __init__(self, lags: tuple[float, float]) -> None:
        self._lags = lags
        self._correction: Any = np.ones_like(PAPER)

    def correct(self, p: Any, found: Any) -> None:
        """Take what the ring found for a parameter vector."""
        self._correction = found / self._rows(p, PAPER, 25)

    def approach(self, p: Any, power: float, evaluations: int) -> Any:
        """Least sum of the deviations to the power of 2·`power`: from afar, the way into the tolerances."""

        def residuals(found: Any) -> Any:
            d = np.clip(deviations(found), -8.0, 8.0)
            same = np.minimum(differences(found) - 0.3, 0.0)
            return np.concatenate((np.sign(d) * np.abs(d) ** power, same))

        return self._solve(p, residuals, 1e-3, evaluations)

    def smooth(self, p: Any, weight: float, limit: float, evaluations: int) -> Any:
        """Least penalty times `weight`, with deviations beyond `limit` punished by `STEEPNESS`."""

        def residuals(found: Any) -> Any:
            d = np.maximum(np.abs(deviations(found)) - limit, 0.0)
            same = np.minimum(differences(found) - LEAST_DIFFERENCE, 0.0)
            return STEEPNESS * np.concatenate((d, 0.3 * same))

        return self._solve(p, residuals, weight, evaluations)

    def _rows(self, p: Any, start: Any, rounds: int) -> Any:
        """Numbers (4, 6) of the calibration rows on the surrogate, iterated from those of `start`."""
        plant, rows = surrogate.plant(p), zip(_PERIODS, start, strict=True)
        return np.array([surrogate.stationary(plant, r, self._lags, near, rounds) for r, near in rows])

    def _solve(self, p: Any, residuals: Callable[[Any], Any], weight: float, evaluations: int) -> Any:
        near, best = self._rows(p, PAPER, 20), np.inf
        count = residuals(near * self._correction).size

        def cost(p: Any) -> Any:
            nonlocal near, best
            smooth = np.sqrt(weight) * surrogate.penalty(p)
            try:
                found = self._rows(p, near, 5)
            except ArithmeticError:
                return np.concatenate((np.full(count, FAILED), smooth))
            value = np.concatenate((residuals(found * self._correction), smooth))
            if value @ value < best:
                best, near = value @ value, found  # a warm start for the fixed point, no more
            return value

        bounds = surrogate.LOWEST, surrogate.HIGHEST
        inside = np.clip(p, bounds[0] + 1e-6, bounds[1] - 1e-6)
        options: dict[str, Any] = {"x_scale": "jac", "diff_step": 1e-3, "max_nfev": evaluations}
        return least_squares(cost, inside, bounds=bounds, **options).x
