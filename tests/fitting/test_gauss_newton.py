"""Gauss-Newton steps of convex programs against SciPy's trust region, on rows and not on sums."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import piezoest as pz
from piezoest.fitting.coordinates import coordinates
from piezoest.fitting.gauss_newton import single_shooting
from piezoest.fitting.losses import bend
from piezoest.fitting.problem import Prior, Problem

TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
STEEP = pz.ColemanHodgdon(0.021, 0.147, 0.0065)  # not admissible: the fit ends at a bound
VARIED = coordinates(pz.ColemanHodgdon, ())
START = VARIED.of(pz.ColemanHodgdon(0.03, 0.12, 0.005))


def problem(model: Any = TRUE, prior: Prior | None = None) -> Problem:
    u = pz.signals.triangle(33.0, 5.0, 15.0, 500.0).values
    x = model.simulate(u) + 0.3 + 1e-2 * np.random.default_rng(0).standard_normal(u.size)
    x[::50] += 1.0
    x[7:11] = np.nan
    return Problem(u, x, VARIED, np.empty(0), prior=prior)


def by_scipy(given: Problem, loss: str, scale: float) -> Any:
    prior = given.prior or Prior(START, np.empty((0, START.size)))

    def residual(q: Any) -> Any:
        return np.append(-given.residual(q), prior.root @ (q - prior.mean))

    def jacobian(q: Any) -> Any:
        run, by_q = given.simulate(q)
        return np.vstack([(run.jacobian @ by_q) * given.weight[:, None], prior.root])

    return least_squares(
        residual, START, jac=jacobian, bounds=given.bounds(START), x_scale="jac", f_scale=scale,
        loss="linear" if loss == "linear" else partial(bend, loss), ftol=1e-15, xtol=1e-15, gtol=1e-15,
    )  # fmt: skip


@pytest.mark.parametrize("loss", ["linear", "huber", "soft_l1", "cauchy"])
@pytest.mark.parametrize("model", [TRUE, STEEP])
def test_ends_where_scipy_does(loss: str, model: Any) -> None:
    given = problem(model)
    found, other = single_shooting(given, START, loss, 0.05, 100), by_scipy(given, loss, 0.05)
    assert found.success
    assert given.about(found.q, loss, 0.05)[0] == pytest.approx(other.cost, rel=1e-9)
    np.testing.assert_allclose(found.q, other.x, rtol=1e-4, atol=1e-4)
    assert found.evaluations <= 2 * other.nfev
    if loss == "linear":
        assert given.gap(found.q) < 1e-12


@pytest.mark.parametrize("sharp", [1.0, 1e6])
def test_a_prior_counts_as_rows_do_however_closely_it_ties_coordinates(sharp: float) -> None:
    tie = np.eye(START.size)
    tie[0, :] = sharp
    given = problem(prior=Prior(START, 1e2 * tie))
    found = single_shooting(given, START, "linear", 1.0, 100)
    assert found.success
    assert given.cost(found.q) == pytest.approx(by_scipy(given, "linear", 1.0).cost, rel=1e-9)


def test_what_is_not_finite_is_told() -> None:
    given = problem()
    given.x[0] = 1e300
    with np.errstate(all="ignore"):
        found = single_shooting(given, START, "linear", 1.0, 100)
    assert (found.success, found.message) == (False, "The model is not finite.")
    np.testing.assert_array_equal(found.q, START)
