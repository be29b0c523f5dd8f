"""Do estimators know what they do not know? Their errors against their own standard errors.

A true Coleman-Hodgdon plant with the parameters of Table I, 1 nm of white noise, 2 s of a 5 Hz
triangle, 200 seeds. For a consistent filter the errors lie within three standard errors, the
normalised estimation error squared (NEES) has the mean n, and the normalised innovation squared
(NIS) the mean 1. Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and
Navigation (2001), sec. 5.4.
"""

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

import piezoest as pz

FloatArray = NDArray[np.float64]

FS = 5000.0
NOISE = 1e-3
RUNS = 200
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
VOLTAGE = pz.signals.triangle(33.0, 5.0, 10.0, FS).values
DISPLACEMENT = TRUE.simulate(VOLTAGE)
TRUE_STATE = np.array([DISPLACEMENT[-1] - TRUE.c * VOLTAGE[-1], TRUE.a, TRUE.b, TRUE.c])


class Outcome(NamedTuple):
    """Of each run: errors of theta (RUNS, 3), standard errors, NEES of theta, of the state, mean NIS."""

    errors: FloatArray
    standard_errors: FloatArray
    nees: FloatArray
    state_nees: FloatArray
    nis: FloatArray

    @property
    def within_three(self) -> float:
        """Fraction of the runs in which every parameter lies within three standard errors."""
        return float(np.mean(np.all(np.abs(self.errors) < 3.0 * self.standard_errors, axis=1)))


def squared(error: FloatArray, P: FloatArray) -> float:
    return float(error @ np.linalg.solve(P, error))


def outcome(new: Callable[[], Any], runs: int = RUNS, rate: float = FS) -> Outcome:
    rows = []
    voltage = VOLTAGE if rate == FS else pz.signals.triangle(33.0, 5.0, 10.0, rate).values
    displacement = DISPLACEMENT if rate == FS else TRUE.simulate(voltage)
    settled = slice(voltage.size // 4, None)
    for seed in range(runs):
        x = displacement + NOISE * np.random.default_rng(seed).standard_normal(voltage.size)
        estimator = new()
        trace = estimator.run(voltage, x, record=("y", "S"))
        error = estimator.theta[:3] - TRUE.theta
        state_nees = np.nan
        if isinstance(estimator, pz.HysteresisEKF | pz.FilterPyEKF | pz.FilterPyUKF):
            state_nees = squared(estimator.s - TRUE_STATE, estimator.state_covariance)
        nis = np.mean(trace.y[settled] ** 2 / trace.S[settled])
        errors_said, P = estimator.standard_errors[:3], estimator.P[:3, :3]
        rows.append((error, errors_said, squared(error, P), state_nees, nis))
    return Outcome(*(np.array(column) for column in zip(*rows, strict=True)))


def band(degrees: int, runs: int) -> tuple[float, float]:
    """95 % band of the mean of so many chi-squared numbers."""
    low, high = chi2.ppf([0.025, 0.975], degrees * runs) / runs
    return float(low), float(high)


# ---------------------------------------------------------------- the extended Kalman filter


def test_ekf_of_a_true_plant_is_consistent() -> None:
    found = outcome(lambda: pz.HysteresisEKF(FS, noise=NOISE, drift=0.0, mismatch=0.0))
    assert found.within_three >= 0.95
    low, high = band(3, RUNS)
    assert low < np.mean(found.nees) < high
    low, high = band(4, RUNS)
    assert low < np.mean(found.state_nees) < high
    # Of one run of 7500 innovations, and of all runs together.
    each = 1.96 * np.sqrt(2.0 / (0.75 * VOLTAGE.size))
    assert np.mean(np.abs(found.nis - 1.0) < each) >= 0.9
    assert abs(np.mean(found.nis) - 1.0) < each / np.sqrt(RUNS)
    # The errors are those that it says, not only within them, and are not biased.
    scatter = found.errors.std(axis=0)
    np.testing.assert_allclose(found.standard_errors.mean(axis=0), scatter, rtol=0.1)
    assert np.all(np.abs(found.errors.mean(axis=0)) < 3.0 * scatter / np.sqrt(RUNS))


FAR = {
    factors: start
    for factors in itertools.product((0.5, 1.5), repeat=3)
    if (start := pz.ColemanHodgdon.from_loop(*(np.array(factors) * [TRUE.a, TRUE.b, TRUE.c]))).is_admissible
}


@pytest.mark.parametrize("factors", FAR)
def test_ekf_stays_consistent_from_a_far_start(factors: tuple[float, float, float]) -> None:
    """Where linearisation alone would claim errors too small by a factor of a thousand."""
    runs = 40
    found = outcome(
        lambda: pz.HysteresisEKF(FS, noise=NOISE, drift=0.0, mismatch=0.0, initial_model=FAR[factors]), runs
    )
    assert found.within_three >= 0.95
    low, high = band(3, runs)
    assert low < np.mean(found.nees) < high


# ---------------------------------------------------------------- the baselines


@pytest.mark.slow
@pytest.mark.parametrize("kind", [pz.FilterPyEKF, pz.FilterPyUKF])
def test_filterpy_baselines_are_consistent(kind: Any) -> None:
    """Fewer samples and seeds, for filterpy is slow."""
    runs, rate = 40, 250.0
    found = outcome(lambda: kind(rate, noise=NOISE, drift=0.0, mismatch=0.0), runs, rate)
    assert found.within_three >= 0.95
    low, high = band(3, runs)
    assert low < np.mean(found.nees) < high


# ---------------------------------------------------------------- the moving horizon


def test_moving_horizon_is_consistent() -> None:
    rate = 500.0
    found = outcome(lambda: pz.MovingHorizon(rate, noise=NOISE, hop=0.35), RUNS, rate)
    assert found.within_three >= 0.95
    scatter = found.errors.std(axis=0)
    np.testing.assert_allclose(found.standard_errors.mean(axis=0), scatter, rtol=0.15)
    assert np.all(np.abs(found.errors.mean(axis=0)) < 0.5 * scatter)


# ---------------------------------------------------------------- recursive least squares


def test_rls_with_a_memory_is_consistent() -> None:
    """Differenced, low-passed noise is coloured: P alone says errors 30 times too large."""
    found = outcome(lambda: pz.HysteresisRLS(FS, memory=0.4, noise=NOISE))
    assert found.within_three >= 0.95
    scatter = found.errors.std(axis=0)
    np.testing.assert_allclose(found.standard_errors.mean(axis=0), scatter, rtol=0.1)
    assert np.all(np.abs(found.errors.mean(axis=0)) < 0.3 * scatter)
    assert np.mean(found.nis) == pytest.approx(1.0, abs=0.01)
