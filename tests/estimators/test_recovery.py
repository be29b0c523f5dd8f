"""Readings that a stage cannot have made are left out; after a fault an estimator finds back to the stage."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray

FS, PERIODS, FAULT = 4000.0, 20, 5.3
PERIOD = int(FS / 5.0)
U = pz.signals.triangle(33.0, 5.0, 6 + PERIODS, FS).values
X = np.asarray(pz.PaperStage(FS, seed=3).run(U))
START = int(FAULT * PERIOD)


def misfit(estimator: Any) -> float:
    """Greatest error of the loop, but for its offset, relative to half the swing."""
    error = (estimator.model.simulate(U) - X)[-PERIOD:]
    return float(np.max(np.abs(error - error.mean())) / np.ptp(X) * 2.0)


def after(estimator: Any, seconds: float, fault: Any, start: int = START) -> float:
    """Misfit after readings that `fault` has changed for some time, and right ones for twenty periods."""
    x = X.copy()
    faulty = slice(start, start + max(1, int(seconds * FS)))
    x[faulty] = fault(x[faulty])
    estimator.run(U, x, every=U.size)
    return misfit(estimator)


HUM = 3.0 * np.sin(2.0 * np.pi * 80.0 * np.arange(600) / FS)


@pytest.mark.parametrize(
    ("seconds", "fault"), [(0.15, lambda x: x + HUM), (0.2, np.negative), (0.04, lambda x: x + 20.0)]
)
def test_least_squares_learns_again(seconds: float, fault: Callable[[FloatArray], FloatArray]) -> None:
    """A slope near zero is neither taken for a stage without signal nor a place without a way out."""
    assert after(pz.HysteresisRLS(FS), seconds, fault) < 0.04


def test_output_error_learns_again() -> None:
    assert after(pz.OutputErrorRLS(FS), 0.04, np.negative, int(5.15 * PERIOD)) < 0.05


@pytest.mark.parametrize(
    "kind", [pz.PrandtlIshlinskiiRLS, pz.OutputErrorRLS, pz.HysteresisRLS, pz.HysteresisEKF]
)
@pytest.mark.parametrize("seconds", [0.003, 0.04])
def test_way_back_from_a_wrong_level_is_not_learnt(kind: Any, seconds: float) -> None:
    """The glitch lasts long enough to be taken for a new level; so does the way back."""
    undisturbed = kind(FS)
    undisturbed.run(U, X, every=U.size)
    assert after(kind(FS), seconds, lambda x: np.full_like(x, 50.0)) < misfit(undisturbed) + 0.02


@pytest.mark.parametrize("offset", [False, True])
@pytest.mark.parametrize("jump", [3.0, -50.0, 1e6])
def test_one_wrong_reading_is_nothing_to_a_kalman_filter(offset: bool, jump: float) -> None:
    estimator = pz.HysteresisEKF(FS, offset=offset)
    x = X.copy()
    x[START] += jump
    estimator.run(U, x, every=U.size)
    assert estimator.status.outliers == 1
    left_out = pz.HysteresisEKF(FS, offset=offset)
    x[START] = np.nan
    left_out.run(U, x, every=U.size)
    np.testing.assert_array_equal(estimator.theta, left_out.theta)


@pytest.mark.parametrize("offset", [False, True])
def test_dead_sensor_leaves_a_kalman_filters_decay_within_reach(offset: bool) -> None:
    estimator = pz.HysteresisEKF(FS, offset=offset)
    x = X.copy()
    x[START : START + PERIOD] = x[START]
    estimator.run(U[: START + PERIOD], x[: START + PERIOD], every=PERIOD)
    assert estimator.theta[0] < 1.0
    estimator.run(U[START + PERIOD :], x[START + PERIOD :], every=U.size)
    assert misfit(estimator) < 0.03


def test_decay_of_a_kalman_filter_is_bounded() -> None:
    """White readings of nothing: without a bound the decay winds up to where no data would bring it back."""
    estimator = pz.HysteresisEKF(FS, offset=True)
    x = X.copy()
    x[START : START + 1200] = np.random.default_rng(0).normal(0.0, 5.0, 1200)
    theta = estimator.run(U[: START + 1200], x[: START + 1200]).theta
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
