"""RecursiveLeastSquares: the law of App. A for any regression."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.reference import least_squares as reference


def test_without_forgetting_is_lstsq() -> None:
    rng = np.random.default_rng(0)
    phi = rng.normal(size=(200, 4))
    z = phi @ [1.0, -2.0, 0.5, 3.0] + 0.1 * rng.normal(size=200)
    law = pz.RecursiveLeastSquares(4, P=1e8)
    for k in range(200):
        law.update(z[k], phi[k])
    np.testing.assert_allclose(law.theta, np.linalg.lstsq(phi, z)[0], rtol=1e-7)


def test_forgetting_follows_a_change() -> None:
    rng = np.random.default_rng(0)
    law = pz.RecursiveLeastSquares(2, policies=(pz.policies.Forgetting(memory=20.0),))
    for k in range(400):
        phi = rng.normal(size=2)
        law.update(float(phi @ ([1.0, 2.0] if k < 200 else [1.0, -2.0])), phi)
    np.testing.assert_allclose(law.theta, [1.0, -2.0], atol=1e-3)


@pytest.mark.parametrize("normalised", [True, False])
def test_continuous_law_is_the_papers(normalised: bool) -> None:
    rng, P = np.random.default_rng(0), np.array([[2.0, 0.5], [0.5, 1.0]])
    policies = (pz.policies.Forgetting(3.0), pz.policies.Normalisation())[: 1 + normalised]
    law = pz.RecursiveLeastSquares(2, P=P, time_base="continuous", step=0.01, policies=policies)
    theta = np.zeros(2)
    for _ in range(100):
        phi, z = rng.normal(size=2), float(rng.normal())
        law.update(z, phi)
        theta, P = reference.bogacki_shampine(theta, P, 0.01, phi, z, 1.0 / 3.0, normalised)
    np.testing.assert_allclose(law.theta, theta, rtol=1e-10)
    np.testing.assert_allclose(law.P, P, rtol=1e-10)


def test_zero_regressor_for_good() -> None:
    for policies in ((pz.policies.NormBound(10.0),), (pz.policies.DeadZone(),)):
        law = pz.RecursiveLeastSquares(2, P=1.0, policies=(pz.policies.Forgetting(5.0), *policies))
        for _ in range(2000):
            law.update(0.3, [0.0, 0.0])
        assert np.all(np.isfinite(law.P))
        assert np.trace(law.P) <= 20.0


def test_covariance_resetting_below_the_floor() -> None:
    law = pz.RecursiveLeastSquares(1, P=1.0, policies=(pz.policies.CovarianceResetting(0.1),))
    for _ in range(100):
        law.update(1.0, [1.0])
    assert law.resets == pytest.approx(10, abs=2)


def law(n: int = 2, **options: Any) -> Any:
    return lambda: pz.RecursiveLeastSquares(n, **options)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (law(0), "n must be a whole number"),
        (law(P=[1.0, 2.0, 3.0]), r"P must have shape \(2, 2\)"),
        (law(P=[1.0, -1.0]), "positive definite"),
        (law(P=[[1.0, 0.5], [0.0, 1.0]]), "symmetric"),
        (law(time_base="continuous", noise_variance=2.0), "noise_variance must be 1"),
        (law(policies=("forgetting",)), "must be made of policies"),
        (law(policies=(pz.policies.RandomWalk(),)), "needs the swings of a voltage"),
        (lambda: pz.RecursiveLeastSquares(2).update(1.0, [1.0]), r"phi must have shape \(2,\)"),
    ],
)
def test_wrong_arguments(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
