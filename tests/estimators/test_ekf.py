"""HysteresisEKF and the baselines on filterpy: equal to each other, and admissible."""

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, UnscentedKalmanFilter

import piezoest as pz
from tests.estimators.shared import recorded

LINE = pz.LinearGain(0.1)


def test_stays_admissible_while_it_learns() -> None:
    u, x = recorded(2000.0, 2.5)
    far: Any = {"initial_model": pz.ColemanHodgdon.from_loop(0.06, 0.2, 0.45), "uncertainty": 2.0}
    kept, free = (pz.HysteresisEKF(2000.0, project=project, **far) for project in (True, False))
    outside = {kept: 0, free: 0}
    for u_k, x_k in zip(u.tolist(), x.tolist(), strict=True):
        for each in outside:
            each.step(u_k, x_k)
            _, a, b, c = each.s
            outside[each] += not (a > 0.0 and b > 0.0 and c >= 2.0 * b)
            assert each.model.is_admissible
    assert outside[kept] == 0 < outside[free]


@pytest.mark.parametrize(
    "options",
    [{}, {"offset": True, "delay": 2.5, "drift": 0.0}, {"initial_model": LINE, "mismatch": 0.0}],
)
@pytest.mark.slow_but_first
def test_compiled_filter_equals_filterpy(options: dict[str, Any]) -> None:
    fs, samples = 50_000.0, 2500
    u, x = recorded(fs, samples / fs * 5.0)
    gaps = np.random.default_rng(1).random(samples) < 0.01
    gaps[1000:1500] = True
    x[gaps] = np.nan
    compiled, baseline = pz.HysteresisEKF(fs, project=False, **options), pz.FilterPyEKF(fs, **options)
    ours, theirs = (each.run(u, x, record=("y", "S", "P")) for each in (compiled, baseline))
    for name in ("theta", "y", "S", "P"):
        mine, other = getattr(ours, name), getattr(theirs, name)
        assert np.max(np.abs(mine - other) / np.abs(other).max(axis=0)) < 1e-9, name
    np.testing.assert_allclose(compiled.standard_errors, baseline.standard_errors, rtol=1e-7)
    np.testing.assert_allclose(compiled.K, baseline.K, rtol=1e-5, atol=1e-9)
    assert compiled.status == baseline.status


def test_filters_are_filterpys_own() -> None:
    own: Any = {pz.FilterPyEKF: ExtendedKalmanFilter, pz.FilterPyUKF: UnscentedKalmanFilter}
    for kind, base in own.items():
        estimator = kind(2000.0)
        assert isinstance(estimator.filter, base)
        assert type(estimator.filter).update.__module__.startswith("filterpy."), "its cost must be filterpy's"
        estimator.run(*recorded(2000.0, 0.5))
        np.testing.assert_array_equal(estimator.filter.x, estimator.s)
        np.testing.assert_array_equal(estimator.filter.P, estimator.state_covariance)
        assert np.isfinite(estimator.filter.log_likelihood)
