"""BatchFit: recovery, standard errors, bounds, masks, gaps, outliers, failure, saving."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.estimators.batch import BatchFit
from tests.estimators.shared import TRUE, recorded

RATE = 1000.0
NOISE = 1e-3
METHODS: list[Any] = ["single-shooting", "multiple-shooting"]


def record(seconds: float = 2.0, **given: Any) -> Any:
    return recorded(RATE, 5.0 * seconds, **given)


def test_scatter_is_that_of_the_cramer_rao_bound() -> None:
    """Of alpha, beta and gamma, the start state unknown: sensitivities by finite differences."""
    u, _ = record()
    point, steps = np.array([*TRUE.theta, 0.0]), np.array([1e-7, 1e-7, 1e-9, 1e-5])

    def simulated(p: Any) -> Any:
        return pz.ColemanHodgdon(*p[:3]).simulate(u, initial_state=p[3])

    J = np.array([(simulated(point + h) - simulated(point - h)) / (2.0 * h.sum()) for h in np.diag(steps)]).T
    scale = np.linalg.norm(J, axis=0)
    bound = (NOISE**2 * np.linalg.inv((J / scale).T @ (J / scale)) / np.outer(scale, scale))[:3, :3]
    fits = [BatchFit(RATE).fit(*record(seed=seed)) for seed in range(60)]
    errors = np.array([fit.theta[:3] - TRUE.theta for fit in fits])
    together = np.mean(np.einsum("ki,ij,kj->k", errors, np.linalg.inv(bound), errors)) / 3.0
    assert 0.9 < np.sqrt(together) < 1.1
    # What the fit says of itself is the bound too.
    said = np.mean([fit.P[:3, :3] for fit in fits], axis=0)
    np.testing.assert_allclose(said / bound, 1.0, rtol=0.05)
    inside = np.abs(errors) < 3.0 * np.array([fit.standard_errors[:3] for fit in fits])
    assert np.all(inside, axis=1).mean() >= 0.95
    assert np.mean([fit.noise for fit in fits]) == pytest.approx(NOISE, rel=0.01)


@pytest.mark.parametrize("method", METHODS)
def test_start_state_and_offset(method: Any) -> None:
    """A unipolar voltage and a biased gauge, in the middle of a loop."""
    u, x = record(initial_state=-1.2)
    fit = BatchFit(RATE, offset=True, method=method).fit(u + 60.0, x - 120.0)
    assert fit.success
    names = ("alpha", "beta", "gamma", "offset", "initial_state")
    assert fit.parameter_names == names
    expected = [*TRUE.theta, -120.0 - 60.0 * TRUE.c, -1.2]
    assert np.all(np.abs(fit.theta - expected) < 4.0 * fit.standard_errors)
    assert fit.model.offset == fit.theta[3]


@pytest.mark.parametrize(
    "options", [{}, {"loss": "huber"}, {"offset": True, "creep": pz.Creep([0.0], [0.3])}]
)
def test_multiple_shooting_is_single_shooting(options: dict[str, Any]) -> None:
    u, x = record(1.0)
    single, multiple = (BatchFit(RATE, method=method, **options).fit(u, x) for method in METHODS)
    assert single.success
    assert multiple.success
    assert multiple.message == "IPOPT: Solve_Succeeded"
    assert np.all(np.abs(single.theta - multiple.theta) <= 0.02 * single.standard_errors)
    np.testing.assert_allclose(single.standard_errors, multiple.standard_errors, rtol=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_start_far_off(method: Any) -> None:
    u, x = record(1.0)
    near = BatchFit(RATE, method=method).fit(u, x)
    for model in (pz.ColemanHodgdon(0.002, 1.5, 0.0045), pz.ColemanHodgdon(0.2, 1.5, 0.45)):
        far = BatchFit(RATE, initial_model=model, method=method).fit(u, x)
        np.testing.assert_allclose(far.theta[:3], near.theta[:3], rtol=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_creep(method: Any) -> None:
    creep = pz.Creep([0.02, 0.03], [0.05, 0.5])
    u, x = record(noise=0.0)
    x = x + creep.simulate(x, sample_rate=RATE) + NOISE * np.random.default_rng(3).standard_normal(x.size)
    fit = BatchFit(RATE, creep=pz.Creep([0.0, 0.0], creep.time_constants), method=method).fit(u, x)
    assert fit.creep is not None
    np.testing.assert_array_equal(fit.creep.time_constants, creep.time_constants)
    found = [*fit.theta[:3], *fit.creep.gains]
    errors = fit.standard_errors[[0, 1, 2, 5, 6]]
    assert np.all(np.abs(found - np.array([*TRUE.theta, 0.02, 0.03])) < 4.0 * errors)
    assert fit.noise == pytest.approx(NOISE, rel=0.05)


@pytest.mark.parametrize("method", METHODS)
def test_linear_gain(method: Any) -> None:
    u, x = record(model=pz.LinearGain(0.155, 3.0))
    fit = BatchFit(RATE, initial_model=pz.LinearGain(0.1), offset=True, method=method).fit(u, x)
    columns = np.column_stack([u, np.ones_like(u)])
    expected = np.linalg.lstsq(columns, x, rcond=None)[0]
    np.testing.assert_allclose(fit.theta, expected, rtol=1e-8)
    covariance = NOISE**2 * np.linalg.inv(columns.T @ columns)
    np.testing.assert_allclose(fit.standard_errors, np.sqrt(np.diag(covariance)), rtol=0.05)
    assert fit.model == pz.LinearGain(*fit.theta)


@pytest.mark.parametrize("gamma", [0.021 * 0.147 * 2.2, 0.021 * 0.147 * 0.95])
def test_model_is_admissible_where_the_plant_is_not(gamma: float) -> None:
    plant = pz.ColemanHodgdon(0.021, 0.147, gamma)
    assert not plant.is_admissible
    fit = BatchFit(RATE).fit(*record(1.0, model=plant))
    assert fit.model.is_admissible
    assert "ratio" in fit.at_bound
    assert fit.success


@pytest.mark.parametrize(
    "names", [("alpha",), ("beta",), ("gamma",), ("alpha", "gamma"), ("alpha", "beta", "gamma")]
)
def test_fixed_parameters_stay(names: tuple[str, ...]) -> None:
    u, x = record()
    free = BatchFit(RATE, offset=True).fit(u, x)
    fixed = {name: float(getattr(TRUE, name)) for name in names} | {"offset": 0.0}
    fit = BatchFit(RATE, offset=True, fixed=fixed).fit(u, x)
    for name in fixed:
        i = fit.parameter_names.index(name)
        assert fit.theta[i] == pytest.approx(fixed[name], rel=1e-12)
        assert fit.standard_errors[i] == 0.0
    held = np.array([name in fixed for name in fit.parameter_names])
    assert np.all(np.abs(fit.theta - [*TRUE.theta, 0.0, 0.0])[~held] < 4.0 * fit.standard_errors[~held])
    assert np.all(fit.standard_errors[~held] < free.standard_errors[~held])
    assert fit.model.is_admissible


def test_missing_samples_count_nothing() -> None:
    u, x = record()
    gone = np.random.default_rng(1).random(x.size) < 0.3
    whole = BatchFit(RATE).fit(u, x)
    fit = BatchFit(RATE).fit(u, np.where(gone, np.nan, x))
    assert np.array_equal(np.isnan(fit.residual), gone)
    np.testing.assert_allclose(fit.theta[:3], TRUE.theta, rtol=3e-3)
    ratio = fit.standard_errors / np.where(whole.standard_errors > 0.0, whole.standard_errors, 1.0)
    np.testing.assert_allclose(ratio[:3], 1.0 / np.sqrt(0.7), rtol=0.1)
    wild = BatchFit(RATE).fit(u, np.where(gone, 1e300, x))
    np.testing.assert_array_equal(wild.theta, fit.theta)
    # A voltage unknown between two that are known moved straight from one to the other.
    holes = u.copy()
    holes[[40, 41, 400]] = np.nan
    np.testing.assert_allclose(BatchFit(RATE).fit(holes, x).theta[:3], TRUE.theta, rtol=3e-3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("loss", ["huber", "soft_l1", "cauchy"])
def test_outliers(loss: Any, method: Any) -> None:
    rng = np.random.default_rng(2)
    u, x = record()
    bad = rng.random(x.size) < 0.05
    x[bad] += 2.0 * rng.standard_normal(bad.sum())
    plain = BatchFit(RATE).fit(u, x)
    robust = BatchFit(RATE, loss=loss, method=method).fit(u, x)
    assert robust.success
    assert np.abs(plain.theta[:3] / TRUE.theta - 1.0).max() > 0.02
    np.testing.assert_allclose(robust.theta[:3], TRUE.theta, rtol=5e-3)
    assert np.all(np.abs(robust.theta[:3] - TRUE.theta) < 4.0 * robust.standard_errors[:3])
    assert robust.noise < 1.5 * NOISE


def test_a_failure_is_told_in_the_solvers_words_with_the_best_iterate() -> None:
    u, x = record()
    scipy = BatchFit(RATE, max_iterations=1).fit(u, x)
    assert not scipy.success
    assert scipy.message == "The maximum number of function evaluations is exceeded."
    ipopt = BatchFit(RATE, max_iterations=1, method="multiple-shooting").fit(u, x)
    assert not ipopt.success
    assert ipopt.message == "IPOPT: Maximum_Iterations_Exceeded"
    for fit in (scipy, ipopt):
        np.testing.assert_allclose(fit.theta[:3], TRUE.theta, rtol=0.1)
        assert fit.model.is_admissible
        assert fit.noise < 0.1
    # In a stream nothing is raised either.
    estimator = BatchFit(RATE, max_iterations=1)
    estimator.run(u, x)
    assert estimator.result is not None
    assert not estimator.result.success
    assert estimator.model == scipy.model


def test_collects_and_fits_when_asked() -> None:
    u, x = record(1.0)
    estimator = BatchFit(RATE)
    assert estimator.result is None
    assert estimator.model == pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    for k in range(5):
        estimator.step(u[k], x[k])
    estimator.step(u[5], None)
    estimator.run(u[6:], x[6:])
    direct = BatchFit(RATE)
    given = x.copy()
    given[5] = np.nan
    fit = direct.fit(u, given)
    np.testing.assert_array_equal(estimator.theta, fit.theta[:3])
    assert estimator.result is estimator.result
    assert estimator.status == pz.Status(u.size, u.size - 1, 1, 0, 0, False, "updated")
    assert estimator.y == fit.residual[-1]
    assert fit.noise**2 < estimator.S
    # One more sample like the last would move theta by K y, which is what least squares does.
    more = BatchFit(RATE).fit(np.append(u, u[-1]), np.append(given, x[-1] + 1.0))
    moved = more.theta[:3] - fit.theta[:3]
    expected = estimator.K * (1.0 + estimator.y)
    np.testing.assert_allclose(moved, expected, rtol=0.05)


def test_hop_bounds_the_number_of_fits() -> None:
    u, x = record(0.5)
    estimator, part = BatchFit(RATE, hop=0.2), BatchFit(RATE)
    trace = estimator.run(u, x, record=("y", "S", "P"))
    part.fit(u[:400], x[:400])
    np.testing.assert_array_equal(estimator.theta, part.theta)
    assert len(np.unique(trace.theta[:, 0])) == 3
    np.testing.assert_array_equal(trace.theta[399], part.theta)
    np.testing.assert_array_equal(trace.theta[198], [0.02, 0.12, 0.0036])
    steps, halves = BatchFit(RATE, hop=0.2), BatchFit(RATE, hop=0.2)
    theta = [halves.run(u[:111], x[:111]).theta, halves.run(u[111:], x[111:]).theta]
    np.testing.assert_array_equal(np.concatenate(theta), trace.theta)
    for k in range(u.size):
        steps.step(u[k], x[k])
    np.testing.assert_array_equal(steps.theta, estimator.theta)
