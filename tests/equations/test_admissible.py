"""Projections: onto the admissible set, and of a Kalman filter onto a face of it."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from piezoest.equations import kalman
from piezoest.equations.admissible import is_admissible, project_admissible

THETA = np.array([0.021, 0.147, 0.0043])


@given(st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3), st.integers(0, 2**32 - 1))
def test_projection_is_admissible(factors: list[float], seed: int) -> None:
    theta = THETA * np.array(factors)
    L = np.random.default_rng(seed).normal(size=(3, 3)) * THETA[:, None]
    project_admissible(theta, L @ L.T, 1e-4, 1e-3, 1e-3)
    assert is_admissible(theta[0], theta[1], theta[2], 1e-4, 1e-3, 0.999e-3) == 1.0


@pytest.mark.parametrize("seed", range(20))
def test_projection_is_the_nearest_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta = THETA * np.exp(rng.normal(0.0, 0.25, 3))
    theta[2] = THETA[2] * rng.choice([0.6, 2.5])
    L = (np.eye(3) + 0.3 * rng.normal(size=(3, 3))) * THETA[:, None]
    projected = theta.copy()
    project_admissible(projected, L @ L.T, 1e-4, 1e-3, 1e-6)

    def distance(parts: Any) -> float:
        difference = parts * THETA - theta
        return float(difference @ np.linalg.solve(L @ L.T, difference))

    def faces(parts: Any) -> Any:
        alpha, beta, gamma = parts * THETA
        return np.array([gamma - alpha * beta, 2.0 * alpha * beta - gamma]) / THETA[2]

    best = minimize(
        distance, projected / THETA, method="SLSQP", constraints={"type": "ineq", "fun": faces},
        bounds=[(1e-2, None)] * 3, options={"ftol": 1e-14, "maxiter": 500},
    )  # fmt: skip
    assert distance(projected / THETA) <= best.fun * 1.02 + 1e-6


@pytest.mark.parametrize("least", [0.5, 0.08])
def test_a_filters_projection_is_the_nearest_point(least: float) -> None:
    """The least (s' - s)' P^-1 (s' - s) under g s' >= least, from the stationarity conditions."""
    root = np.random.default_rng(3).normal(size=(5, 5))
    P, s = root @ root.T + 0.1 * np.eye(5), np.array([0.4, 0.021, 0.057, 0.204, 0.1])
    g = np.array([0.0, 0.0, -2.0, 1.0, 0.0])
    system = np.block([[2.0 * np.linalg.inv(P), g[:, None]], [g, 0.0]])
    nearest = np.linalg.solve(system, np.append(2.0 * np.linalg.solve(P, s), least))[:5]
    outside, moved = g @ s < least, s.copy()
    assert kalman.project(moved, P, g, least) == float(outside)
    np.testing.assert_allclose(moved, nearest if outside else s, rtol=1e-9)
    assert g @ moved >= least - 1e-12
