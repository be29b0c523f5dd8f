"""The filter's steps against the textbook's matrices."""

from typing import Any

import numpy as np
import pytest

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
