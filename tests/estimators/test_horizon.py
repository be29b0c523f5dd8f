"""MovingHorizon: one solve a hop, parity, tracking, arrival cost, thinning, bad solves."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.estimators.thinning import thinned
from tests.estimators.shared import START, TRUE, recorded

RATE = 2000.0
NOISE = 1e-3


def record(seconds: float = 1.0, **given: Any) -> tuple[Any, Any]:
    return recorded(RATE, 5.0 * seconds, **given)


def taught(u: Any, x: Any, **options: Any) -> Any:
    estimator = pz.MovingHorizon(RATE, **options)
    estimator.run(u, x)
    return estimator


def test_solves_once_a_hop_and_holds_between() -> None:
    u, x = record(0.5)
    estimator = pz.MovingHorizon(RATE, hop=0.05)
    assert (estimator.solves, estimator.solver_message) == (0, "")
    last = estimator.theta
    for k in range(1, u.size + 1):
        estimator.step(u[k - 1], x[k - 1])
        due = k % 100 == 0
        assert (estimator.solves, estimator.status.last) == (k // 100, "updated" if due else "held")
        assert np.array_equal(estimator.theta, last) != due
        last = estimator.theta
    assert (estimator.status.updates, estimator.status.held) == (10, u.size - 10)
    assert estimator.failures == 0
    assert "satisfied" in estimator.solver_message


def test_tracks_a_step_of_the_gain() -> None:
    u, before = record(2.0)
    later = pz.ColemanHodgdon(0.021, 0.147 * 1.2, 0.00429 * 1.2)
    x = np.where(np.arange(u.size) < 2000, before, record(2.0, model=later)[1])
    estimator = pz.MovingHorizon(RATE)
    theta = estimator.run(u, x).theta
    np.testing.assert_allclose(theta[1999], TRUE.theta, rtol=0.01)
    # A window and a hop after the step, nothing of the old plant is left in the window.
    np.testing.assert_allclose(theta[2000 + 1000 + 200 :], np.tile(later.theta, (800, 1)), rtol=0.02)
    assert np.abs(theta[2000 + 100, :] / later.theta - 1.0).max() > 0.05
    assert estimator.failures == 0


def test_arrival_cost_keeps_what_has_left_the_window() -> None:
    """Without process noise the window and its arrival cost are the whole record."""
    u, x = record(2.0)
    options: Any = {"window": 0.2, "hop": 0.05, "decimation": 1, "noise": NOISE, "uncertainty": 50.0}
    keeping, forgetting = (taught(u, x, process_noise=each, **options) for each in (0.0, 10.0))
    whole = pz.BatchFit(RATE, noise=NOISE).fit(u, x)
    errors = whole.standard_errors[:3]
    assert np.all(keeping.standard_errors < 1.6 * errors)
    assert np.all(forgetting.standard_errors > 2.5 * errors)
    assert np.all(np.abs(keeping.theta - whole.theta[:3]) < 1.5 * errors)


def test_offset_and_linear_gain() -> None:
    u, x = record()
    estimator = taught(u + 60.0, x - 120.0, offset=True)
    assert estimator.parameter_names == ("alpha", "beta", "gamma", "offset")
    np.testing.assert_allclose(estimator.theta[:3], TRUE.theta, rtol=0.02)
    assert estimator.model.offset == pytest.approx(-120.0 - 60.0 * TRUE.c, abs=0.05)
    line = record(model=pz.LinearGain(0.155, 3.0))
    estimator = taught(*line, offset=True, initial_model=pz.LinearGain(0.1))
    np.testing.assert_allclose(estimator.theta, [0.155, 3.0], rtol=1e-4)


def test_a_bad_solve_keeps_the_last_good_model() -> None:
    estimator = pz.MovingHorizon(RATE, max_iterations=1)
    trace = estimator.run(*record())
    assert estimator.solves == estimator.failures == 10
    assert estimator.solver_message == "The maximum number of function evaluations is exceeded."
    assert estimator.status.updates == 0
    assert np.all(trace.theta == START.theta)
    assert np.all(np.isfinite(estimator.P))


def test_missing_samples_and_nothing_at_all() -> None:
    u, x = record()
    lost, none = np.where(np.random.default_rng(1).random(x.size) < 0.3, np.nan, x), np.full(x.size, np.nan)
    for voltage, displacement, model, within in (
        (u, lost, TRUE, 0.01),
        (none, x, START, 1e-9),
        (u, none, START, 1e-9),
    ):
        estimator = taught(voltage, displacement)
        np.testing.assert_allclose(estimator.theta, model.theta, rtol=within)
        assert estimator.status.missing == np.count_nonzero(np.isnan(voltage + displacement))


def test_decimation_costs_no_accuracy() -> None:
    full, few = (taught(*record(), decimation=n, noise=NOISE) for n in (1, 5))
    np.testing.assert_allclose(few.standard_errors, full.standard_errors, rtol=0.15)


def test_thinning_loses_neither_path_nor_displacement() -> None:
    """Without noise each mean is the model's output at its point, path and turning points kept."""
    turns = 2.0 * np.pi * np.arange(30_000) / 50_000.0
    u = 25.0 * np.sin(5.0 * turns) + 8.0 * np.sin(15.0 * turns)
    x = TRUE.simulate(u)
    x[4321] = np.nan
    points, shift, mean, root_weight = thinned(u, x, 7, 9, 333)
    assert points.size < u.size / 8
    assert {0, 333, u.size - 1} <= set(points.tolist())
    there = TRUE.simulate(u)[points]
    np.testing.assert_allclose(TRUE.simulate(u[points], allow_jumps=True), there, atol=1e-12)
    assert np.abs(mean - TRUE.c * shift - there)[root_weight > 0.0].max() < 1e-5
    assert np.sum(root_weight**2) > 0.97 * u.size
    # A voltage that turns all the time is taken at full rate.
    noise = np.random.default_rng(0).standard_normal(500)
    points, shift, _, root_weight = thinned(noise, noise, 0, 10, 0)
    np.testing.assert_array_equal(points, np.arange(500))
    assert np.all(root_weight == 1.0)
    assert not shift.any()
