"""Readings that a stage cannot have made are left out; after a fault an estimator finds back to the stage."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz

FS, PERIOD = 4000.0, 800
U = pz.signals.triangle(33.0, 5.0, 26, FS).values
X = np.asarray(pz.PaperStage(FS, seed=3).run(U))
START = int(5.3 * PERIOD)


def misfit(estimator: Any) -> float:
    """Greatest error of the loop, but for its offset, relative to half the swing."""
    error = (estimator.model.simulate(U) - X)[-PERIOD:]
    return float(np.max(np.abs(error - error.mean())) / np.ptp(X) * 2.0)


def after(estimator: Any, samples: int, fault: Any, start: int = START) -> Any:
    """The estimator after readings that `fault` has changed, and right ones for twenty periods."""
    x = X.copy()
    x[start : start + samples] = fault(x[start : start + samples])
    estimator.run(U, x, every=U.size)
    return estimator


HUM = 3.0 * np.sin(2.0 * np.pi * 80.0 * np.arange(600) / FS)


@pytest.mark.parametrize(
    ("kind", "samples", "fault", "start", "most"),
    [
        # A slope near zero is neither taken for a stage without signal nor a place without a way out.
        (pz.HysteresisRLS, 600, lambda x: x + HUM, START, 0.04),
        (pz.HysteresisRLS, 800, np.negative, START, 0.04),
        (pz.HysteresisRLS, 160, lambda x: x + 20.0, START, 0.04),
        (pz.OutputErrorRLS, 160, np.negative, int(5.15 * PERIOD), 0.05),
    ],
)
def test_learns_again(kind: Any, samples: int, fault: Any, start: int, most: float) -> None:
    assert misfit(after(kind(FS), samples, fault, start)) < most


@pytest.mark.parametrize(
    "kind", [pz.PrandtlIshlinskiiRLS, pz.OutputErrorRLS, pz.HysteresisRLS, pz.HysteresisEKF]
)
@pytest.mark.parametrize("samples", [12, 160])
def test_way_back_from_a_wrong_level_is_not_learnt(kind: Any, samples: int) -> None:
    """The glitch lasts long enough to be taken for a new level; so does the way back."""
    undisturbed, disturbed = after(kind(FS), 0, np.negative), after(kind(FS), samples, lambda x: 50.0)
    assert misfit(disturbed) < misfit(undisturbed) + 0.02


@pytest.mark.parametrize("offset", [False, True])
def test_faults_of_readings_do_not_mislead_a_kalman_filter(offset: bool) -> None:
    """One that is wrong is as one that is missing; a dead sensor leaves the decay within reach."""
    missing = after(pz.HysteresisEKF(FS, offset=offset), 1, lambda x: np.nan)
    for jump in (3.0, -50.0, 1e6):
        estimator = after(pz.HysteresisEKF(FS, offset=offset), 1, lambda x, jump=jump: x + jump)
        assert estimator.status.outliers == 1
        np.testing.assert_array_equal(estimator.theta, missing.theta)
    estimator = pz.HysteresisEKF(FS, offset=offset)
    x = X.copy()
    x[START : START + PERIOD] = x[START]
    estimator.run(U[: START + PERIOD], x[: START + PERIOD], every=PERIOD)
    assert estimator.theta[0] < 1.0
    estimator.run(U[START + PERIOD :], x[START + PERIOD :], every=U.size)
    assert misfit(estimator) < 0.03


def test_decay_of_a_kalman_filter_is_bounded() -> None:
    """White readings of nothing: without a bound the decay winds up to where no data would bring it back."""
    x = X[: START + 1200].copy()
    x[START:] = np.random.default_rng(0).normal(0.0, 5.0, 1200)
    theta = pz.HysteresisEKF(FS, offset=True).run(U[: x.size], x).theta
    assert np.max(theta[PERIOD:, 0]) < 1.0


LONG = np.asarray(pz.signals.triangle(35.0, 5.0, 8, 20_000.0))
LOOP = pz.ColemanHodgdon(0.021, 0.147, 0.0043).simulate(LONG)


@pytest.mark.parametrize("kind", [pz.HysteresisRLS, pz.PrandtlIshlinskiiRLS])
def test_saturated_readings_are_left_out(kind: Any) -> None:
    saturated = kind(20_000.0)
    saturated.run(LONG, np.clip(LOOP, -4.0, 4.0))
    assert saturated.status.outliers > 0.9 * np.count_nonzero(np.abs(LOOP) > 4.0)
    slope = np.polyfit(LONG, saturated.model.simulate(LONG), 1)[0]
    assert slope == pytest.approx(np.polyfit(LONG, LOOP, 1)[0], rel=0.03)


@pytest.mark.parametrize("bits", [8, 16])
def test_a_coarse_converter_still_teaches(bits: int) -> None:
    code = 2.0 * np.max(np.abs(LOOP)) / 2**bits
    estimator: Any = pz.HysteresisRLS(20_000.0)
    estimator.run(LONG, code * np.round(LOOP / code))
    assert np.max(np.abs(estimator.model.simulate(LONG) - LOOP)[-4000:]) < 0.005 + 0.5 * code
