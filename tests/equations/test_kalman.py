"""The filter's steps against the textbook's matrices, and as NumPy, Numba and CasADi."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from piezoest.compile import Record, compiled
from piezoest.equations import coleman_hodgdon as hysteresis
from piezoest.equations import kalman
from piezoest.layout import NUMBER, new, numbers, record
from tests.equations.three_ways import three_ways
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
    got = P.copy()
    kalman.predict_covariance(got, row, n, q)
    expected = reference.predict_covariance(P, F, np.diag(q))
    np.testing.assert_allclose(got, expected, rtol=1e-13, atol=1e-14)
    assert np.array_equal(got, got.T)


@pytest.mark.parametrize("n", [1, 2, 4, 5])
def test_update_is_the_textbook(n: int) -> None:
    s, P = state(n), covariance(n)
    h = np.array([1.0, 0.0, 0.0, 21.0, 1.0][:n])
    got, gain = P.copy(), np.empty(n)
    moved = s.copy()
    S = kalman.update(moved, got, h, 0.7, 0.04, gain)
    expected_s, expected_P, K, expected_S = reference.update(s, P, h, 0.7, 0.04)
    assert pytest.approx(expected_S, rel=1e-13) == S
    np.testing.assert_allclose(gain, K, rtol=1e-12)
    np.testing.assert_allclose(moved, expected_s, rtol=1e-12)
    np.testing.assert_allclose(got, expected_P, rtol=1e-10, atol=1e-13)
    assert np.array_equal(got, got.T)


@pytest.mark.parametrize("n", [4, 5])
def test_projection_is_the_nearest_point(n: int) -> None:
    s, P = state(n), covariance(n, 3)
    g = np.zeros(n)
    g[2], g[3] = -2.0, 1.0
    for least in (0.5, float(g @ s) - 0.01):
        moved = s.copy()
        said = kalman.project(moved, P, g, least)
        np.testing.assert_allclose(moved, reference.project(s, P, g, least), rtol=1e-9)
        assert said == float(g @ s < least)
        assert g @ moved >= least - 1e-12


def test_projection_without_any_variance_stays() -> None:
    s = state(4)
    g = np.array([0.0, 1.0, 0.0, 0.0])
    moved = s.copy()
    assert kalman.project(moved, np.zeros((4, 4)), g, 1.0) == 1.0
    np.testing.assert_array_equal(moved, s)


def test_variance_of_the_product_is_that_of_gaussians() -> None:
    """A product of zero-mean Gaussians has the variance P_aa P_ww + P_aw²: sampled."""
    P = np.eye(4)
    P[:2, :2] = [[0.09, 0.002], [0.002, 1e-4]]
    draws = np.random.default_rng(0).multivariate_normal([0.0, 0.0], P[:2, :2], size=400_000)
    sampled = np.var(draws[:, 0] * draws[:, 1])
    travel = 3.0
    got = kalman.bilinear_variance(P, -travel, 0.02) / (travel / 0.02)
    assert got == pytest.approx(sampled, rel=0.02)
    assert kalman.bilinear_variance(P, 0.0, 0.02) == 0.0
    assert np.isfinite(kalman.bilinear_variance(P, 1.0, 0.0))


FILTER = record(
    R=NUMBER, least=NUMBER, s=numbers(4), P=numbers(4, 4), q=numbers(4), row=numbers(4), h=numbers(4),
    gain=numbers(4),
)  # fmt: skip


@compiled
def filtered(case: Record, samples: int) -> None:
    """Run P through so many samples of a sine; the least variance on the way goes into `least`."""
    u_last = 0.0
    s, P, row = case.s, case.P, case.row
    for k in range(samples):
        u = 33.0 * np.sin(6e-4 * k)
        du = u - u_last
        u_last = u
        row[0], row[1], row[2] = hysteresis.hysteresis_jacobian(s[0], du, s[1], s[2])
        s[0] = hysteresis.hysteresis_step(s[0], du, s[1], s[2])
        kalman.predict_covariance(P, row, 4, case.q)
        case.h[0], case.h[3] = 1.0, u
        kalman.update(s, P, case.h, 0.0, case.R, case.gain)
        for i in range(4):
            case.least = min(case.least, P[i, i])


@pytest.mark.parametrize("noise", [1.5e-3, 1e-6])
@pytest.mark.parametrize("walk", [0.0, 0.3])
def test_stays_symmetric_positive_definite_over_a_million_samples(noise: float, walk: float) -> None:
    q = (walk * np.array([1.0, 0.021, 0.057, 0.204])) ** 2 / 50_000.0
    s, P = np.array([0.0, 0.021, 0.057, 0.204]), np.diag([1.0, 1e-4, 1e-3, 1e-2])
    case = new(FILTER, R=noise**2, least=np.inf, s=s, P=P, q=q)
    filtered.of(FILTER)(case, 1_000_000)
    assert case["least"] > 0.0
    P = case["P"]
    assert np.array_equal(P, P.T)
    scale = np.sqrt(np.diag(P))
    # Without process noise w_h becomes a function of a and b, and P truly singular: but for
    # rounding its least eigenvalue is then zero.
    assert np.linalg.eigvalsh(P / np.outer(scale, scale))[0] > (0.0 if walk else -1e-12)


# ---------------------------------------------------------------- one source, three ways


CASE = record(
    y=NUMBER, least=NUMBER, s=numbers(4), P=numbers(4, 4), h=numbers(4), q=numbers(4), gain=numbers(4)
)


@compiled
def predicted(case: Record) -> None:
    kalman.predict_covariance(case.P, case.h, 4, case.q)


@compiled
def updated(case: Record) -> None:
    case.y = kalman.update(case.s, case.P, case.h, case.y, 0.04, case.gain)


@compiled
def projected(case: Record) -> None:
    case.y = kalman.project(case.s, case.P, case.h, case.least)


@compiled
def widened(case: Record) -> None:
    case.y = kalman.bilinear_variance(case.P, case.y, case.least)


CASES: list[tuple[Any, dict[str, Any]]] = [
    (predicted, {"h": [0.9, -0.2, 0.3, 0.0], "q": np.linspace(0.1, 0.5, 4)}),
    (updated, {"h": [1.0, 0.0, 0.0, 21.0], "y": 0.7}),
    (projected, {"h": [0.0, 0.0, -2.0, 1.0], "least": 0.5}),
    (projected, {"h": [0.0, 0.0, -2.0, 1.0], "least": -0.5}),
    (widened, {"y": -2.0, "least": 0.02}),
]


@pytest.mark.parametrize(("function", "values"), CASES)
def test_numpy_numba_and_casadi_agree(function: Any, values: dict[str, Any]) -> None:
    plain, machine, symbolic = three_ways(function, CASE, s=state(4), P=covariance(4), **values)
    np.testing.assert_allclose(machine, plain, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(symbolic, plain, rtol=1e-14, atol=1e-15)
