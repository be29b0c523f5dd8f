"""The recursions of Appendix A against the textbook, and against each other."""

from typing import Any

import numpy as np
import pytest

from piezoest.equations import least_squares as ls
from piezoest.layout import Named, new, numbers, record
from tests.reference import least_squares as reference

N = 3
RATES = record(theta=numbers(N), P=numbers(N, N))


def continuous_update(theta: Any, P: Any, phi: Any, z: Any, options: tuple[float, ...]) -> None:
    """One sample of the continuous law; `options`: step, forgetting rate, whether normalised, bound."""
    h, forgetting_rate, normalised, bound = options
    rates = Named(new(RATES), RATES)
    ls.continuous_step(theta, P, phi, z, h, forgetting_rate, normalised, rates)
    ls.continuous_correction(theta, P, h, bound, rates)


def problem(samples: int, seed: int = 0) -> tuple[Any, Any, Any]:
    rng = np.random.default_rng(seed)
    phi = rng.normal(size=(samples, N))
    theta = np.array([0.5, -1.0, 2.0])
    return phi, phi @ theta + 0.1 * rng.normal(size=samples), theta


def start() -> tuple[Any, Any]:
    L = np.array([[1.0, 0.0, 0.0], [0.3, 2.0, 0.0], [-0.4, 0.1, 0.5]])
    return np.array([0.1, 0.2, -0.3]), L @ L.T


def test_discrete_update_is_the_textbook() -> None:
    phi, z, _ = problem(200)
    theta, P = start()
    expected_theta, expected_P = start()
    for k in range(200):
        before = expected_theta @ phi[k]
        y, S = ls.discrete_update(theta, P, phi[k], z[k], 0.98, 0.04, np.inf)
        assert y == pytest.approx(z[k] - before)
        assert pytest.approx(phi[k] @ expected_P @ phi[k] / 0.98 + 0.04) == S
        expected_theta, expected_P = reference.discrete(expected_theta, expected_P, phi[k], z[k], 0.98, 0.04)
    np.testing.assert_allclose(theta, expected_theta, rtol=1e-10)
    np.testing.assert_allclose(P, expected_P, rtol=1e-9)
    assert np.array_equal(P, P.T)


@pytest.mark.parametrize("law", ["discrete", "continuous"])
def test_bound_holds_and_does_not_freeze(law: str) -> None:
    theta, P = start()
    bound = 1.5 * float(np.trace(P))
    quiet, loud = np.array([1e-3, 0.0, 0.0]), np.array([1.0, 1.0, -1.0])

    def update(phi: Any) -> None:
        if law == "discrete":
            ls.discrete_update(theta, P, phi, 0.0, 0.99, 1.0, bound)
        else:
            continuous_update(theta, P, phi, 0.0, (0.01, 0.05, 1.0, bound))

    for _ in range(1000):
        update(quiet)
        assert ls.trace(P) <= bound * (1.0 + 1e-12)
    full = ls.trace(P)
    for _ in range(300):
        update(loud)
    assert ls.trace(P) < full


@pytest.mark.parametrize("mu", [1.0, 0.99])
def test_a_covariance_spoilt_by_rounding_heals(mu: float) -> None:
    """A regressor far beyond the noise leaves P - K phi' P to rounding: phi' P phi may be negative."""
    rng = np.random.default_rng(3)
    theta, P = np.zeros(N), 1e6 * np.eye(N)
    true, negative = rng.normal(size=N), 0
    for _ in range(3000):
        phi = 1e5 * rng.normal(size=N)
        _, S = ls.discrete_update(theta, P, phi, phi @ true, mu, 1.0, np.inf)
        negative += S < 0.0
    assert negative < 30
    np.testing.assert_allclose(theta, true, atol=1e-5)


@pytest.mark.parametrize("seed", range(10))
def test_floor_is_the_least_eigenvalue(seed: int) -> None:
    A = np.random.default_rng(seed).normal(size=(4, 4))
    P = A @ A.T
    least = np.linalg.eigvalsh(P)[0]
    assert ls.above_floor(P, 0.999 * least, np.zeros((4, 4))) == 1.0
    assert ls.above_floor(P, 1.001 * least, np.zeros((4, 4))) == 0.0
