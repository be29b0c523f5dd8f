"""The Kalman filter's projection. Its other steps are those of filterpy: `test_filterpy_baselines`."""

import numpy as np
import pytest

from piezoest.equations import kalman


@pytest.mark.parametrize("n", [4, 5])
def test_projection_is_the_nearest_point(n: int) -> None:
    """The least (s' - s)' P^-1 (s' - s) under g s' >= least, from the stationarity conditions."""
    root = np.random.default_rng(3).normal(size=(n, n))
    P, s, g = root @ root.T + 0.1 * np.eye(n), np.array([0.4, 0.021, 0.057, 0.204, 0.1][:n]), np.zeros(n)
    g[2], g[3] = -2.0, 1.0
    for least in (0.5, float(g @ s) - 0.01):
        system = np.block([[2.0 * np.linalg.inv(P), g[:, None]], [g, 0.0]])
        nearest = np.linalg.solve(system, np.append(2.0 * np.linalg.solve(P, s), least))[:n]
        outside, moved = g @ s < least, s.copy()
        assert kalman.project(moved, P, g, least) == float(outside)
        np.testing.assert_allclose(moved, nearest if outside else s, rtol=1e-9)
        assert g @ moved >= least - 1e-12
