"""The filter's steps against the textbook's matrices, and as NumPy, Numba and CasADi."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import pytest
from numba import njit

from piezoest.equations import coleman_hodgdon as hysteresis
from piezoest.equations import kalman
from tests.reference import kalman as reference

THETA = (0.021, 0.057, 0.204)


def covariance(n: int, seed: int = 0) -> Any:
    root = np.random.default_rng(seed).normal(size=(n, n))
    return root @ root.T + 0.1 * np.eye(n)


def state(n: int) -> Any:
    return np.array([0.4, *THETA, 0.1, -0.3][:n])


@pytest.mark.parametrize("n", [1, 2, 4, 5])
def test_predict_covariance_is_the_textbook(n: int) -> None:
    P, q = covariance(n), np.linspace(0.1, 0.5, n)
    row = np.array([0.9, -0.2, 0.3, 0.0, 0.0][:n])
    F = np.eye(n)
    F[0] = row
    flat = P.ravel().copy()
    kalman.predict_covariance(flat, row, n, q, n, np.empty(n))
    np.testing.assert_allclose(
        flat.reshape(n, n), reference.predict_covariance(P, F, np.diag(q)), rtol=1e-13, atol=1e-14
    )
    assert np.array_equal(flat.reshape(n, n), flat.reshape(n, n).T)


@pytest.mark.parametrize("n", [1, 2, 4, 5])
def test_update_is_the_textbook(n: int) -> None:
    s, P = state(n), covariance(n)
    h = np.array([1.0, 0.0, 0.0, 21.0, 1.0][:n])
    flat, gain = P.ravel().copy(), np.empty(n)
    moved = s.copy()
    S = kalman.update(moved, flat, h, 0.7, 0.04, n, gain, np.empty(2 * n))
    expected_s, expected_P, K, expected_S = reference.update(s, P, h, 0.7, 0.04)
    assert pytest.approx(expected_S, rel=1e-13) == S
    np.testing.assert_allclose(gain, K, rtol=1e-12)
    np.testing.assert_allclose(moved, expected_s, rtol=1e-12)
    np.testing.assert_allclose(flat.reshape(n, n), expected_P, rtol=1e-10, atol=1e-13)
    assert np.array_equal(flat.reshape(n, n), flat.reshape(n, n).T)


def test_a_whole_record_is_the_textbook() -> None:
    n, R = 4, 1e-6
    q = np.array([1e-7, 1e-12, 1e-11, 1e-10])
    u = 33.0 * np.sin(np.linspace(0.0, 20.0, 400))
    rng = np.random.default_rng(1)
    s = np.array([0.0, 0.02, 0.06, 0.18])
    flat = np.diag([1.0, 1e-4, 1e-3, 1e-2]).ravel().copy()
    expected, P = s.copy(), flat.reshape(n, n).copy()
    plant = np.array([0.3, *THETA])
    row, gain, work = np.zeros(n), np.empty(n), np.empty(n * n)
    for k in range(1, u.size):
        du = u[k] - u[k - 1]
        h = np.array([1.0, 0.0, 0.0, u[k]])
        plant, _ = reference.transition(plant, du)
        x = float(h @ plant) + 1e-3 * rng.standard_normal()
        row[:3] = hysteresis.hysteresis_jacobian(s[0], du, s[1], s[2])
        s[0] = hysteresis.hysteresis_step(s[0], du, s[1], s[2])
        kalman.predict_covariance(flat, row, n, q, n, work)
        kalman.update(s, flat, h, x - kalman.measure(s, h, n), R, n, gain, work)
        expected, F = reference.transition(expected, du)
        P = reference.predict_covariance(P, F, np.diag(q))
        expected, P, _, _ = reference.update(expected, P, h, float(x - h @ expected), R)
    np.testing.assert_allclose(s, expected, rtol=1e-8)
    np.testing.assert_allclose(flat.reshape(n, n), P, rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(s[1:], THETA, rtol=0.01)


@pytest.mark.parametrize("n", [4, 5])
def test_projection_is_the_nearest_point(n: int) -> None:
    s, P = state(n), covariance(n, 3)
    g = np.zeros(n)
    g[2], g[3] = -2.0, 1.0
    for least in (0.5, float(g @ s) - 0.01):
        moved = s.copy()
        said = kalman.project(moved, P.ravel(), g, least, n, np.empty(n))
        np.testing.assert_allclose(moved, reference.project(s, P, g, least), rtol=1e-9)
        assert said == float(g @ s < least)
        assert g @ moved >= least - 1e-12


def test_projection_without_any_variance_stays() -> None:
    s = state(4)
    g = np.array([0.0, 1.0, 0.0, 0.0])
    moved = s.copy()
    assert kalman.project(moved, np.zeros(16), g, 1.0, 4, np.empty(4)) == 1.0
    np.testing.assert_array_equal(moved, s)


def test_variance_of_the_product_is_that_of_gaussians() -> None:
    """A product of zero-mean Gaussians has the variance P_aa P_ww + P_aw²: sampled."""
    P = np.eye(4)
    P[:2, :2] = [[0.09, 0.002], [0.002, 1e-4]]
    draws = np.random.default_rng(0).multivariate_normal([0.0, 0.0], P[:2, :2], size=400_000)
    sampled = np.var(draws[:, 0] * draws[:, 1])
    travel = 3.0
    got = kalman.bilinear_variance(P.ravel(), -travel, 0.02, 4) / (travel / 0.02)
    assert got == pytest.approx(sampled, rel=0.02)
    assert kalman.bilinear_variance(P.ravel(), 0.0, 0.02, 4) == 0.0
    assert np.isfinite(kalman.bilinear_variance(P.ravel(), 1.0, 0.0, 4))


@njit
def filtered(P: Any, q: Any, R: float, samples: int) -> float:
    """Run P through so many samples of a sine; the least variance on the way."""
    n = 4
    row, h, s = np.zeros(n), np.zeros(n), np.array([0.0, 0.021, 0.057, 0.204])
    gain, work = np.empty(n), np.empty(n * n)
    least, u_last = np.inf, 0.0
    for k in range(samples):
        u = 33.0 * np.sin(6e-4 * k)
        du = u - u_last
        u_last = u
        row[0], row[1], row[2] = hysteresis.hysteresis_jacobian(s[0], du, s[1], s[2])
        s[0] = hysteresis.hysteresis_step(s[0], du, s[1], s[2])
        kalman.predict_covariance(P, row, n, q, n, work)
        h[0], h[3] = 1.0, u
        kalman.update(s, P, h, 0.0, R, n, gain, work)
        for i in range(n):
            least = min(least, P[i * n + i])
    return float(least)


@pytest.mark.parametrize("noise", [1.5e-3, 1e-6])
@pytest.mark.parametrize("walk", [0.0, 0.3])
def test_stays_symmetric_positive_definite_over_a_million_samples(noise: float, walk: float) -> None:
    flat = np.diag([1.0, 1e-4, 1e-3, 1e-2]).ravel().copy()
    q = (walk * np.array([1.0, 0.021, 0.057, 0.204])) ** 2 / 50_000.0
    assert filtered(flat, q, noise**2, 1_000_000) > 0.0
    P = flat.reshape(4, 4)
    assert np.array_equal(P, P.T)
    scale = np.sqrt(np.diag(P))
    # Without process noise w_h becomes a function of a and b, and P truly singular: but for
    # rounding its least eigenvalue is then zero.
    assert np.linalg.eigvalsh(P / np.outer(scale, scale))[0] > (0.0 if walk else -1e-12)


# ---------------------------------------------------------------- one source, three ways


def predicted(P: Any, row: Any, q: Any) -> Any:
    kalman.predict_covariance(P, row, 4, q, 4, row * 0.0)
    return P


def updated(s: Any, P: Any, h: Any, y: Any) -> Any:
    kalman.update(s, P, h, y, 0.04, 4, h * 0.0, P * 0.0)
    return s, P


def projected(s: Any, P: Any, g: Any, least: Any) -> Any:
    kalman.project(s, P, g, least, 4, g * 0.0)
    return s


def widened(P: Any, du: Any, a: Any) -> Any:
    return kalman.bilinear_variance(P, du, a, 4)


P4 = covariance(4).ravel()
CASES: list[tuple[Any, tuple[Any, ...]]] = [
    (predicted, (P4, np.array([0.9, -0.2, 0.3, 0.0]), np.linspace(0.1, 0.5, 4))),
    (updated, (state(4), P4, np.array([1.0, 0.0, 0.0, 21.0]), 0.7)),
    (projected, (state(4), P4, np.array([0.0, 0.0, -2.0, 1.0]), 0.5)),
    (projected, (state(4), P4, np.array([0.0, 0.0, -2.0, 1.0]), -0.5)),
    (widened, (P4, -2.0, 0.02)),
]


def flat(results: Any) -> Any:
    return np.concatenate([np.ravel(r) for r in (results if isinstance(results, tuple) else (results,))])


def copies(arguments: Any) -> Any:
    return [a.copy() if isinstance(a, np.ndarray) else a for a in arguments]


@pytest.mark.parametrize(("function", "arguments"), CASES)
def test_numpy_numba_and_casadi_agree(function: Any, arguments: Any) -> None:
    casadi.GlobalOptions.setNumpyMode(1)
    plain = flat(function(*copies(arguments)))
    compiled = flat(njit(function)(*copies(arguments)))
    symbols = [casadi.SX.sym(f"v{i}", np.size(a)) for i, a in enumerate(arguments)]
    results = function(*(casadi.SX(symbol) for symbol in symbols))
    stacked = casadi.vertcat(*(results if isinstance(results, tuple) else (results,)))
    symbolic = casadi.Function("f", symbols, [stacked])(*arguments).full().ravel()
    np.testing.assert_allclose(compiled, plain, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(symbolic, plain, rtol=1e-14, atol=1e-15)
