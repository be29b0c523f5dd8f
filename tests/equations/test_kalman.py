"""The filter's steps against the textbook's matrices, and as NumPy, Numba and CasADi."""

from typing import Any

import numpy as np
import pytest

from piezoest.compile import Record, compiled
from piezoest.equations import kalman
from piezoest.layout import NUMBER, numbers, record
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
