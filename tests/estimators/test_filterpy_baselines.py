"""The baselines on filterpy: equal to the compiled filter, and open to filterpy's own tools."""

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, UnscentedKalmanFilter

import piezoest as pz
from tests.estimators.shared import recorded


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"offset": True, "delay": 2.5, "drift": 0.0},
        {"initial_model": pz.LinearGain(0.1), "mismatch": 0.0},
    ],
)
@pytest.mark.slow_but_first
def test_compiled_filter_equals_filterpy(options: dict[str, Any]) -> None:
    """At 50 kHz, with single and long gaps."""
    fs, samples = 50_000.0, 4000
    u, x = recorded(fs, samples / fs * 5.0)
    gaps = np.random.default_rng(1).random(samples) < 0.01
    gaps[1000:1500] = True
    x[gaps] = np.nan
    compiled = pz.HysteresisEKF(fs, project=False, **options)
    baseline = pz.FilterPyEKF(fs, **options)
    ours = compiled.run(u, x, record=("y", "S", "P"))
    theirs = baseline.run(u, x, record=("y", "S", "P"))
    for name in ("theta", "y", "S", "P"):
        mine, other = getattr(ours, name), getattr(theirs, name)
        scale = np.abs(other).max(axis=0)
        assert np.max(np.abs(mine - other) / scale) < 1e-9, name
    np.testing.assert_allclose(compiled.theta, baseline.theta, rtol=1e-9)
    np.testing.assert_allclose(compiled.standard_errors, baseline.standard_errors, rtol=1e-7)
    np.testing.assert_allclose(compiled.K, baseline.K, rtol=1e-5, atol=1e-9)
    assert compiled.status == baseline.status


@pytest.mark.parametrize(
    ("kind", "base"), [(pz.FilterPyEKF, ExtendedKalmanFilter), (pz.FilterPyUKF, UnscentedKalmanFilter)]
)
def test_filter_is_filterpys_own(kind: Any, base: Any) -> None:
    u, x = recorded(2000.0, 0.5)
    estimator = kind(2000.0)
    assert isinstance(estimator.filter, base)
    assert type(estimator.filter).update.__module__.startswith("filterpy."), "its cost must be filterpy's"
    estimator.run(u, x)
    np.testing.assert_array_equal(estimator.filter.x, estimator.s)
    np.testing.assert_array_equal(estimator.filter.P, estimator.state_covariance)
    assert np.isfinite(estimator.filter.log_likelihood)


def test_unscented_of_a_linear_gain_is_the_kalman_filter() -> None:
    u, x = recorded(2000.0, 1.0)
    options: dict[str, Any] = {"initial_model": pz.LinearGain(0.1), "mismatch": 0.0}
    extended, unscented = pz.FilterPyEKF(2000.0, **options), pz.FilterPyUKF(2000.0, **options)
    extended.run(u, x)
    unscented.run(u, x)
    np.testing.assert_allclose(unscented.theta, extended.theta, rtol=1e-9)
    np.testing.assert_allclose(unscented.P, extended.P, rtol=1e-6)
