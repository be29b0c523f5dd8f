"""The recursions of Appendix A, as `RecursiveLeastSquares` applies them: against textbooks and each other."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies as p
from tests.reference import least_squares as reference

MU, R = float(np.exp(-1.0 / 50.0)), 0.04


def start() -> tuple[Any, Any]:
    L = np.array([[1.0, 0.0, 0.0], [0.3, 2.0, 0.0], [-0.4, 0.1, 0.5]])
    return np.array([0.1, 0.2, -0.3]), L @ L.T


def made(*policies: Any, **options: Any) -> pz.RecursiveLeastSquares:
    theta, P = start()
    return pz.RecursiveLeastSquares(3, **{"theta": theta, "P": P, "policies": policies, **options})


def discrete(mu: float) -> Any:
    return lambda theta, P, phi, z: reference.discrete(theta, P, phi, z, mu, R)


def directional(theta: Any, P: Any, phi: Any, z: float) -> tuple[Any, Any]:
    q = phi @ P @ phi
    information = np.linalg.inv(P) + (MU - (1.0 - MU) * R / q) * np.outer(phi, phi) / R
    return theta + P @ phi / (R + q) * (z - theta @ phi), np.linalg.inv(information)


def variable(theta: Any, P: Any, phi: Any, z: float) -> tuple[Any, Any]:
    y, q = z - theta @ phi, phi @ P @ phi
    mu = max(1.0 - y * y / (R + q) * (1.0 - MU), np.exp(-1.0 / 5.0))
    return reference.discrete(theta, P, phi, z, mu, R)


def continuous(normalised: bool) -> Any:
    step = reference.bogacki_shampine
    return lambda theta, P, phi, z: step(theta, P, 0.01, phi, z, 1.0 / 3.0, normalised)


CONTINUOUS: dict[str, Any] = {"time_base": "continuous", "step": 0.01}


@pytest.mark.parametrize(
    ("law", "textbook"),
    [
        (made(p.Forgetting(50.0), noise_variance=R), discrete(MU)),
        (made(noise_variance=R), discrete(1.0)),
        (made(p.DirectionalForgetting(50.0, "second"), noise_variance=R), directional),
        (made(p.VariableForgetting(50.0, 0.1, "second"), noise_variance=R), variable),
        (made(p.Forgetting(3.0), **CONTINUOUS), continuous(False)),
        (made(p.Forgetting(3.0), p.Normalisation(), **CONTINUOUS), continuous(True)),
    ],
)
@pytest.mark.slow_but_first
def test_laws_are_the_textbooks(law: pz.RecursiveLeastSquares, textbook: Any) -> None:
    rng, (theta, P) = np.random.default_rng(3), start()
    for _ in range(100):
        phi, z = rng.normal(size=3), float(rng.normal())
        y = z - theta @ phi
        theta, P = textbook(theta, P, phi, z)
        law.update(z, phi)
        assert law.y == pytest.approx(y)
    np.testing.assert_allclose(law.theta, theta, rtol=1e-8)
    np.testing.assert_allclose(law.P, P, rtol=1e-7)
    np.testing.assert_array_equal(law.P, law.P.T)


@pytest.mark.parametrize(("law", "memory"), [({}, 100.0), (CONTINUOUS, 20.0)], ids=["discrete", "continuous"])
def test_bound_holds_and_does_not_freeze(law: dict[str, Any], memory: float) -> None:
    normalised = (p.Normalisation(),) if law else ()
    made_ = made(p.Forgetting(memory), *normalised, p.NormBound(1.5), **law)
    bound = 1.5 * float(np.trace(start()[1]))
    for phi in ([1e-3, 0.0, 0.0], [0.0, 0.0, 0.0]):
        for _ in range(1000):
            made_.update(0.0, phi)
            assert np.trace(made_.P) <= bound * (1.0 + 1e-12)
    loud = np.array([1.0, 1.0, -1.0])
    uncertain = loud @ made_.P @ loud
    for _ in range(300):
        made_.update(0.0, loud)
    assert loud @ made_.P @ loud < 0.5 * uncertain


@pytest.mark.parametrize("policies", [(), (p.Forgetting(100.0),)])
def test_a_covariance_spoilt_by_rounding_heals(policies: Any) -> None:
    """A regressor far beyond the noise leaves P - K phi' P to rounding: phi' P phi may be negative."""
    rng = np.random.default_rng(3)
    law, true = made(*policies, P=1e6), rng.normal(size=3)
    for _ in range(3000):
        phi = 1e5 * rng.normal(size=3)
        law.update(float(phi @ true), phi)
    np.testing.assert_allclose(law.theta, true, atol=1e-5)


def test_covariance_resetting_below_the_floor() -> None:
    law = pz.RecursiveLeastSquares(1, P=1.0, policies=(p.CovarianceResetting(0.1),))
    for _ in range(100):
        law.update(1.0, [1.0])
    assert law.resets == pytest.approx(10, abs=2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n": 0}, "n must be a whole number"),
        ({"P": [1.0, 2.0, 3.0]}, r"P must have shape \(2, 2\)"),
        ({"P": [1.0, -1.0]}, "positive definite"),
        ({"P": [[1.0, 0.5], [0.0, 1.0]]}, "symmetric"),
        ({"time_base": "continuous", "noise_variance": 2.0}, "noise_variance must be 1"),
        ({"policies": ("forgetting",)}, "must hold policies"),
        ({"policies": (p.RandomWalk(),)}, "needs the swings of a voltage"),
        ({}, r"phi must have shape \(2,\)"),
    ],
)
def test_wrong_arguments(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pz.RecursiveLeastSquares(**{"n": 2, **options}).update(1.0, [1.0])
