"""BatchFit: recovery, standard errors, bounds, masks, gaps, outliers, failure, saving."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.estimators.shared import START, TRUE, recorded

RATE, NOISE = 1000.0, 1e-3
METHODS: list[Any] = ["single-shooting", "multiple-shooting"]


def record(seconds: float = 2.0, **given: Any) -> Any:
    return recorded(RATE, 5.0 * seconds, **given)


def fitted(u: Any, x: Any, **options: Any) -> Any:
    return pz.BatchFit(RATE, **options).fit(u, x)


def fitted_both_ways(u: Any, x: Any, **options: Any) -> Any:
    """The fit by single shooting, to which that by multiple shooting is equal."""
    single, multiple = (fitted(u, x, method=method, **options) for method in METHODS)
    assert single.success
    assert multiple.message == "IPOPT: Solve_Succeeded"
    assert np.all(np.abs(single.theta - multiple.theta) <= 0.02 * single.standard_errors)
    np.testing.assert_allclose(single.standard_errors, multiple.standard_errors, rtol=1e-3)
    return single


def test_start_state_and_offset() -> None:
    u, x = record(initial_state=-1.2)
    fit = fitted_both_ways(u + 60.0, x - 120.0, offset=True)
    assert fit.parameter_names == ("alpha", "beta", "gamma", "offset", "initial_state")
    expected = [*TRUE.theta, -120.0 - 60.0 * TRUE.c, -1.2]
    assert np.all(np.abs(fit.theta - expected) < 4.0 * fit.standard_errors)
    assert fit.model.offset == fit.theta[3]


@pytest.mark.parametrize("method", METHODS)
def test_start_far_off(method: Any) -> None:
    u, x = record(1.0)
    near = fitted(u, x, method=method)
    for model in (pz.ColemanHodgdon(0.002, 1.5, 0.0045), pz.ColemanHodgdon(0.2, 1.5, 0.45)):
        far = fitted(u, x, initial_model=model, method=method)
        np.testing.assert_allclose(far.theta[:3], near.theta[:3], rtol=1e-5)


def test_creep() -> None:
    creep = pz.Creep([0.02, 0.03], [0.05, 0.5])
    u, x = record(noise=0.0)
    x = x + creep.simulate(x, sample_rate=RATE) + NOISE * np.random.default_rng(3).standard_normal(x.size)
    fit = fitted_both_ways(u, x, creep=pz.Creep([0.0, 0.0], creep.time_constants))
    np.testing.assert_array_equal(fit.creep.time_constants, creep.time_constants)
    errors = np.array([*fit.theta[:3], *fit.creep.gains]) - [*TRUE.theta, 0.02, 0.03]
    assert np.all(np.abs(errors) < 4.0 * fit.standard_errors[[0, 1, 2, 5, 6]])
    assert fit.noise == pytest.approx(NOISE, rel=0.05)


def test_linear_gain_is_that_of_least_squares() -> None:
    u, x = record(model=pz.LinearGain(0.155, 3.0))
    columns = np.column_stack([u, np.ones_like(u)])
    variances = NOISE**2 * np.diag(np.linalg.inv(columns.T @ columns))
    for method in METHODS:
        fit = fitted(u, x, initial_model=pz.LinearGain(0.1), offset=True, method=method)
        np.testing.assert_allclose(fit.theta, np.linalg.lstsq(columns, x, rcond=None)[0], rtol=1e-8)
        np.testing.assert_allclose(fit.standard_errors, np.sqrt(variances), rtol=0.05)
        assert fit.model == pz.LinearGain(*fit.theta)


@pytest.mark.parametrize("factor", [2.2, 0.95])
def test_model_is_admissible_where_the_plant_is_not(factor: float) -> None:
    plant = pz.ColemanHodgdon(0.021, 0.147, 0.021 * 0.147 * factor)
    assert not plant.is_admissible
    fit = fitted(*record(1.0, model=plant))
    assert fit.model.is_admissible
    assert "ratio" in fit.at_bound
    assert fit.success


def test_fixed_parameters_stay() -> None:
    u, x = record()
    free, true = fitted(u, x, offset=True), np.array([*TRUE.theta, 0.0, 0.0])
    for names in ({"alpha"}, {"beta"}, {"gamma"}, {"alpha", "gamma"}, {"alpha", "beta", "gamma"}):
        fixed = {name: float(getattr(TRUE, name)) for name in names} | {"offset": 0.0}
        fit = fitted(u, x, offset=True, fixed=fixed)
        held = np.array([name in fixed for name in fit.parameter_names])
        np.testing.assert_allclose(fit.theta[held], true[held], rtol=1e-12)
        assert np.all(fit.standard_errors[held] == 0.0)
        assert np.all(np.abs(fit.theta - true)[~held] < 4.0 * fit.standard_errors[~held])
        assert np.all(fit.standard_errors[~held] < free.standard_errors[~held])


def test_missing_samples_count_nothing() -> None:
    u, x = record()
    gone = np.random.default_rng(1).random(x.size) < 0.3
    whole, fit = fitted(u, x), fitted(u, np.where(gone, np.nan, x))
    assert np.array_equal(np.isnan(fit.residual), gone)
    np.testing.assert_allclose(fit.theta[:3], TRUE.theta, rtol=3e-3)
    ratio = fit.standard_errors[:3] / whole.standard_errors[:3]
    np.testing.assert_allclose(ratio, 1.0 / np.sqrt(0.7), rtol=0.1)
    np.testing.assert_array_equal(fitted(u, np.where(gone, 1e300, x)).theta, fit.theta)
    # A voltage unknown between two that are known moved straight from one to the other.
    u[[40, 41, 400]] = np.nan
    np.testing.assert_allclose(fitted(u, x).theta[:3], TRUE.theta, rtol=3e-3)


def test_outliers() -> None:
    rng, (u, x) = np.random.default_rng(2), record()
    bad = rng.random(x.size) < 0.05
    x[bad] += 2.0 * rng.standard_normal(bad.sum())
    assert np.abs(fitted(u, x).theta[:3] / TRUE.theta - 1.0).max() > 0.02
    for loss in ("huber", "soft_l1", "cauchy"):
        robust = fitted_both_ways(u, x, loss=loss)
        np.testing.assert_allclose(robust.theta[:3], TRUE.theta, rtol=5e-3)
        assert np.all(np.abs(robust.theta[:3] - TRUE.theta) < 4.0 * robust.standard_errors[:3])
        assert robust.noise < 1.5 * NOISE


def test_a_failure_is_told_in_the_solvers_words_with_the_best_iterate() -> None:
    u, x = record()
    words = ["The maximum number of function evaluations is exceeded.", "IPOPT: Maximum_Iterations_Exceeded"]
    for method, message in zip(METHODS, words, strict=True):
        fit = fitted(u, x, max_iterations=1, method=method)
        assert (fit.success, fit.message) == (False, message)
        np.testing.assert_allclose(fit.theta[:3], TRUE.theta, rtol=0.1)
        assert fit.model.is_admissible
        assert fit.noise < 0.1
        # In a stream nothing is raised either.
        estimator = pz.BatchFit(RATE, max_iterations=1, method=method)
        estimator.run(u, x)
        assert estimator.result is not None
        assert not estimator.result.success
        assert estimator.model == fit.model


def test_collects_and_fits_when_asked() -> None:
    u, x = record(1.0)
    estimator = pz.BatchFit(RATE)
    assert estimator.result is None
    assert estimator.model == START
    for k in range(5):
        estimator.step(u[k], x[k])
    estimator.step(u[5], None)
    estimator.run(u[6:], x[6:])
    x[5] = np.nan
    fit = fitted(u, x)
    np.testing.assert_array_equal(estimator.theta, fit.theta[:3])
    assert estimator.result is estimator.result
    assert estimator.status == pz.Status(u.size, u.size - 1, 1, 0, 0, False, "updated")
    assert estimator.y == fit.residual[-1]
    assert fit.noise**2 < estimator.S
    # One more sample like the last would move theta by K y, which is what least squares does.
    more = fitted(np.append(u, u[-1]), np.append(x, x[-1] + 1.0))
    moved = more.theta[:3] - fit.theta[:3]
    np.testing.assert_allclose(moved, estimator.K * (1.0 + estimator.y), rtol=0.05)


def test_hop_bounds_the_number_of_fits() -> None:
    u, x = record(0.5)
    estimator, steps, halves = (pz.BatchFit(RATE, hop=0.2) for _ in range(3))
    theta = estimator.run(u, x, record=("y", "S", "P")).theta
    assert len(np.unique(theta[:, 0])) == 3
    np.testing.assert_array_equal(theta[198], START.theta)
    np.testing.assert_array_equal(theta[399], fitted(u[:400], x[:400]).theta[:3])
    np.testing.assert_array_equal(theta[-1], estimator.theta)
    parts = [halves.run(u[:111], x[:111]).theta, halves.run(u[111:], x[111:]).theta]
    np.testing.assert_array_equal(np.concatenate(parts), theta)
    for k in range(u.size):
        steps.step(u[k], x[k])
    np.testing.assert_array_equal(steps.theta, estimator.theta)


def test_scatter_is_that_of_the_cramer_rao_bound() -> None:
    """Of alpha, beta and gamma, the start state unknown: sensitivities by finite differences."""
    u, _ = record()
    point, steps = np.array([*TRUE.theta, 0.0]), np.array([1e-7, 1e-7, 1e-9, 1e-5])

    def simulated(p: Any) -> Any:
        return pz.ColemanHodgdon(*p[:3]).simulate(u, initial_state=p[3])

    J = np.array([(simulated(point + h) - simulated(point - h)) / (2.0 * h.sum()) for h in np.diag(steps)]).T
    scale = np.linalg.norm(J, axis=0)
    bound = (NOISE**2 * np.linalg.inv((J / scale).T @ (J / scale)) / np.outer(scale, scale))[:3, :3]
    fits = [pz.BatchFit(RATE).fit(*record(seed=seed)) for seed in range(60)]
    errors = np.array([fit.theta[:3] - TRUE.theta for fit in fits])
    together = np.mean(np.einsum("ki,ij,kj->k", errors, np.linalg.inv(bound), errors)) / 3.0
    assert 0.9 < np.sqrt(together) < 1.1
    # What the fit says of itself is the bound too.
    said = np.mean([fit.P[:3, :3] for fit in fits], axis=0)
    np.testing.assert_allclose(said / bound, 1.0, rtol=0.05)
    inside = np.abs(errors) < 3.0 * np.array([fit.standard_errors[:3] for fit in fits])
    assert np.all(inside, axis=1).mean() >= 0.95
    assert np.mean([fit.noise for fit in fits]) == pytest.approx(NOISE, rel=0.01)
