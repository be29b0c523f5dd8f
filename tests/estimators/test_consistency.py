"""Do estimators know what they do not know? Their errors against their own standard errors.

A true Coleman-Hodgdon plant with the parameters of Table I, 1 nm of white noise, 2 s of a 5 Hz
triangle, 200 seeds. For a consistent filter the errors lie within three standard errors, the
normalised estimation error squared (NEES) has the mean n, and the normalised innovation squared
(NIS) the mean 1. Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and
Navigation (2001), sec. 5.4.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
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


def test_ekf_told_of_a_mismatch_is_cautious() -> None:
    """By default the plant may stray from the model: on one that does not, the errors said are too large."""
    found = outcome(lambda: pz.HysteresisEKF(FS, noise=NOISE), 50)
    assert found.within_three == 1.0
    assert np.all(found.nees < chi2.ppf(0.95, 3))
    assert np.mean(found.nis) < 1.0


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


def test_rls_of_default_settings_says_what_its_start_may_be_off_by() -> None:
    """Its random walk forgets slowly where the regressor says little: what is left of the start is in it."""
    found = outcome(lambda: pz.HysteresisRLS(FS, noise=NOISE))
    assert found.within_three >= 0.95
    z = np.sqrt(np.mean((found.errors / found.standard_errors) ** 2, axis=0))
    assert np.all(z > 0.1)
    assert np.all(z < 1.0)


def test_rls_with_a_memory_is_consistent() -> None:
    """Differenced, low-passed noise is coloured: P alone says errors 30 times too large."""
    found = outcome(lambda: pz.HysteresisRLS(FS, memory=0.4, noise=NOISE))
    assert found.within_three >= 0.95
    scatter = found.errors.std(axis=0)
    np.testing.assert_allclose(found.standard_errors.mean(axis=0), scatter, rtol=0.1)
    assert np.all(np.abs(found.errors.mean(axis=0)) < 0.3 * scatter)
    assert np.mean(found.nis) == pytest.approx(1.0, abs=0.01)


def test_rls_without_forgetting_counts_its_start_among_the_errors() -> None:
    """The start never fades: what it may be off by is the larger part of what is not known."""
    for start, least, most in (
        (None, 0.3, 0.6),
        (pz.ColemanHodgdon.from_loop(0.0315, 0.0344, 0.245), 0.8, 1.3),
    ):
        found = outcome(partial(pz.HysteresisRLS, FS, memory=None, noise=NOISE, initial_model=start))
        assert found.within_three >= 0.95
        z = found.errors / found.standard_errors
        root_mean_square = np.sqrt(np.mean(z**2, axis=0))
        assert np.all(least < root_mean_square)
        assert np.all(root_mean_square < most)


def test_rls_of_a_linear_gain_is_consistent_but_for_its_filter() -> None:
    """There is nothing differenced in z = x: only W_p correlates the noise, by a known factor."""
    u = pz.signals.triangle(33.0, 5.0, 5.0, FS).values
    gain = 0.155
    errors, said = [], []
    for seed in range(RUNS):
        x = gain * u + NOISE * np.random.default_rng(seed).standard_normal(u.size)
        estimator = pz.HysteresisRLS(
            FS, initial_model=pz.LinearGain(0.1), memory=None, noise=NOISE, cutoff=0.5 * FS
        )
        estimator.run(u, x, every=u.size)
        errors.append(estimator.theta[0] - gain)
        said.append(estimator.standard_errors[0])
    ratio = np.std(errors) / np.mean(said)
    assert 0.85 < ratio < 1.15
    assert np.mean(np.abs(errors) < 3.0 * np.array(said)) >= 0.95
