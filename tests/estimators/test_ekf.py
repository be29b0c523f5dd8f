"""HysteresisEKF and the baselines on filterpy: equal to each other and the textbooks, and admissible."""

from typing import Any

import casadi
import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, UnscentedKalmanFilter

import piezoest as pz
from piezoest.equations import coleman_hodgdon as equations
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


# At 50 kHz and 5 Hz a sample's travel a |du| is 3e-4.
@pytest.mark.parametrize("travel", [1e-6, 3e-4, 1e-2, 1e-1, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_jacobian_is_casadis_derivative(travel: float, sign: float) -> None:
    casadi.GlobalOptions.setNumpyMode(1)
    w, du, a, b = (casadi.SX.sym(name) for name in ("w", "du", "a", "b"))
    after = equations.hysteresis_step(w, du, a, b)
    derivative = casadi.Function("jacobian", [w, du, a, b], [casadi.jacobian(after, casadi.vertcat(w, a, b))])
    for w_h in (-2.0, 0.3, 2.5):
        for a_, b_ in ((0.021, 0.057), (0.004, 0.01), (0.2, 0.1)):
            du_ = sign * travel / a_
            expected = derivative(w_h, du_, a_, b_).full().ravel()
            got = np.array(equations.hysteresis_jacobian(w_h, du_, a_, b_))
            np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12 * abs(expected).max())


@pytest.mark.parametrize("offset", [False, True])
@pytest.mark.slow_but_first
def test_of_a_linear_gain_is_recursive_least_squares(offset: bool) -> None:
    fs, gain, uncertainty, noise = 2000.0, 0.1, 0.5, 1.5e-3
    u, x = recorded(fs, 5.0, noise, model=pz.LinearGain(0.155, 0.2 * offset))
    # With an offset the filter counts from its first sample.
    u0, x0 = (u[0], x[0]) if offset else (0.0, 0.0)
    given: Any = {"uncertainty": uncertainty, "noise": noise, "drift": 0.0, "mismatch": 0.0}
    filtered = pz.HysteresisEKF(fs, initial_model=pz.LinearGain(gain), offset=offset, **given)
    n = 1 + offset
    P = np.array([uncertainty * gain, 10.0 * gain][:n]) ** 2
    squares = pz.RecursiveLeastSquares(n, theta=[gain, 0.0][:n], P=P, noise_variance=noise**2, policies=())
    for u_k, x_k in zip(u.tolist(), x.tolist(), strict=True):
        filtered.step(u_k, x_k)
        squares.update(x_k - x0, [u_k - u0, 1.0][:n])
    np.testing.assert_allclose(filtered.theta, squares.theta, rtol=1e-9)
    scale = squares.P[0, 0]
    np.testing.assert_allclose(filtered.P, squares.P, rtol=1e-9, atol=1e-9 * scale)
    assert filtered.y == pytest.approx(squares.y, rel=1e-6, abs=1e-12)
    assert pytest.approx(squares.S, rel=1e-9) == filtered.S


def test_unscented_of_a_linear_gain_is_the_kalman_filter() -> None:
    u, x = recorded(2000.0, 1.0)
    options: dict[str, Any] = {"initial_model": pz.LinearGain(0.1), "mismatch": 0.0}
    extended, unscented = pz.FilterPyEKF(2000.0, **options), pz.FilterPyUKF(2000.0, **options)
    extended.run(u, x)
    unscented.run(u, x)
    np.testing.assert_allclose(unscented.theta, extended.theta, rtol=1e-9)
    np.testing.assert_allclose(unscented.P, extended.P, rtol=1e-6)
