"""Do estimators know what they do not know? Their errors against their own standard errors.

For a consistent filter the errors lie within three standard errors, the normalised estimation error squared
(NEES) has the mean n, the normalised innovation squared (NIS) the mean 1. Y. Bar-Shalom, X. R. Li,
T. Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), sec. 5.4.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

import piezoest as pz

FloatArray = NDArray[np.float64]

FS = 5000.0
NOISE = 1e-3
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
SURE: dict[str, Any] = {"noise": NOISE, "drift": 0.0, "mismatch": 0.0}


def squared(error: FloatArray, P: FloatArray) -> float:
    return float(error @ np.linalg.solve(P, error))


class Outcome:
    """Of each run: errors of theta and what was said of them, NEES of theta and of a filter's state, NIS."""

    def __init__(self, make: Callable[[], Any], runs: int, rate: float = FS) -> None:
        u = pz.signals.triangle(33.0, 5.0, 10.0, rate).values
        x = TRUE.simulate(u)
        state = np.array([x[-1] - TRUE.c * u[-1], TRUE.a, TRUE.b, TRUE.c])
        rows, self.settled = [], u.size - u.size // 4
        for seed in range(runs):
            estimator, noise = make(), np.random.default_rng(seed).standard_normal(u.size)
            trace = estimator.run(u, x + NOISE * noise, record=("y", "S"))
            error, P = estimator.theta[:3] - TRUE.theta, estimator.P[:3, :3]
            filtered = hasattr(estimator, "s")
            of_state = squared(estimator.s - state, estimator.state_covariance) if filtered else np.nan
            nis = np.mean(trace.y[-self.settled :] ** 2 / trace.S[-self.settled :])
            rows.append((error, estimator.standard_errors[:3], squared(error, P), of_state, nis))
        columns = (np.array(column) for column in zip(*rows, strict=True))
        self.errors, self.said, self.nees, self.state_nees, self.nis = columns
        self.scatter, self.bias = self.errors.std(axis=0), np.abs(self.errors.mean(axis=0))
        # Every parameter lies within three standard errors, but for one run in twenty.
        assert np.mean(np.all(np.abs(self.errors) < 3.0 * self.said, axis=1)) >= 0.95


def assert_chi_squared(values: FloatArray, degrees: int) -> None:
    """The mean of so many chi-squared numbers lies within its 95 % band."""
    low, high = chi2.ppf([0.025, 0.975], degrees * values.size) / values.size
    assert low < np.mean(values) < high


def test_ekf_of_a_true_plant() -> None:
    found = Outcome(lambda: pz.HysteresisEKF(FS, **SURE), 200)
    assert_chi_squared(found.nees, 3)
    assert_chi_squared(found.state_nees, 4)
    # Of the innovations of one run, and of all runs together.
    each = 1.96 * np.sqrt(2.0 / found.settled)
    assert np.mean(np.abs(found.nis - 1.0) < each) >= 0.9
    assert abs(np.mean(found.nis) - 1.0) < each / np.sqrt(200)
    # The errors are those that it says, not only within them, and are not biased.
    np.testing.assert_allclose(found.said.mean(axis=0), found.scatter, rtol=0.1)
    assert np.all(found.bias < 3.0 * found.scatter / np.sqrt(200))


@pytest.mark.parametrize("factors", [(0.5, 0.5, 1.5), (1.5, 0.5, 0.5), (0.5, 0.5, 0.5), (1.5, 1.5, 1.5)])
def test_ekf_from_a_far_start(factors: tuple[float, float, float]) -> None:
    """Where linearisation alone would claim errors too small by a factor of a thousand."""
    start = pz.ColemanHodgdon.from_loop(*(np.array(factors) * [TRUE.a, TRUE.b, TRUE.c]))
    found = Outcome(lambda: pz.HysteresisEKF(FS, initial_model=start, **SURE), 40)
    assert_chi_squared(found.nees, 3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [pz.FilterPyEKF, pz.FilterPyUKF])
def test_filterpy_baselines(kind: Any) -> None:
    assert_chi_squared(Outcome(lambda: kind(250.0, **SURE), 40, 250.0).nees, 3)


def test_moving_horizon() -> None:
    found = Outcome(lambda: pz.MovingHorizon(500.0, noise=NOISE, hop=0.35), 80, 500.0)
    np.testing.assert_allclose(found.said.mean(axis=0), found.scatter, rtol=0.2)
    assert np.all(found.bias < 0.5 * found.scatter)


def test_rls_with_a_memory() -> None:
    """Differenced, low-passed noise is coloured: P alone says errors 30 times too large."""
    found = Outcome(lambda: pz.HysteresisRLS(FS, memory=0.4, noise=NOISE), 200)
    np.testing.assert_allclose(found.said.mean(axis=0), found.scatter, rtol=0.1)
    assert np.all(found.bias < 0.3 * found.scatter)
    assert np.mean(found.nis) == pytest.approx(1.0, abs=0.01)
