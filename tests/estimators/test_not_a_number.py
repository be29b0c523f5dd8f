"""Whatever comes in, nothing that is not a number comes out: of any estimator, with any settings."""

from functools import partial
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies as p
from tests.estimators.shared import START, assert_finite
from tests.wild import wild

RATE = 1000.0
LINE = pz.LinearGain(0.15)
RLS, EKF = partial(pz.HysteresisRLS, RATE), partial(pz.HysteresisEKF, RATE)
PLAYS = partial(pz.PrandtlIshlinskiiRLS, RATE)
HORIZON = partial(pz.MovingHorizon, RATE, window=0.03, hop=0.01)
MAKERS: dict[str, Any] = {
    "rls": RLS,
    "rls-bare": partial(RLS, memory=0.4, policies=(), errors=False),
    "rls-continuous": partial(RLS, time_base="continuous", policies=(p.NormBound(), p.DeadZone())),
    "rls-continuous-bare": partial(RLS, time_base="continuous", policies=()),
    "rls-line": partial(RLS, initial_model=LINE, offset=True),
    "rls-line-bare": partial(RLS, initial_model=LINE, memory=0.4, policies=()),
    "rls-all": partial(RLS, policies=(
        p.RandomWalk(), p.OutlierRejection(1), p.Projection(), p.ChangeDetection(), p.AmplitudeMemory()
    )),
    "output-error": partial(pz.OutputErrorRLS, RATE),
    "ekf": EKF,
    "ekf-free": partial(EKF, project=False, offset=True),
    "ekf-line": partial(EKF, initial_model=LINE, offset=True),
    "plays": PLAYS,
    "plays-line": partial(PLAYS, initial_model=LINE),
    "filterpy-ekf": partial(pz.FilterPyEKF, RATE),
    "filterpy-ukf": partial(pz.FilterPyUKF, RATE),
    "horizon": HORIZON,
    "horizon-line": partial(HORIZON, initial_model=LINE, offset=True),
    "batch": partial(pz.BatchFit, RATE, offset=True),
    "batch-line": partial(pz.BatchFit, RATE, initial_model=LINE),
}  # fmt: skip
# Too slow for many rounds, or for many samples.
ROUNDS = {"filterpy": 2, "horizon": 4, "batch": 4}


@pytest.mark.slow
def test_covariance_that_winds_up_starts_anew() -> None:
    estimator = RLS(memory=0.4, policies=())
    u = 33.0 * np.sin(np.arange(2000) / 50.0)
    x = START.simulate(u)
    estimator.run(u, x)
    learnt = estimator.theta
    estimator.run(np.full(300_000, u[-1]), np.full(300_000, x[-1]))
    assert_finite(estimator)
    assert estimator.status.resets > 0
    np.testing.assert_allclose(estimator.theta, learnt, rtol=1e-3)
    estimator.run(u, x)
    np.testing.assert_allclose(estimator.theta, START.theta, rtol=0.05)


@pytest.mark.parametrize(
    "kind",
    ["rls-line", "rls-line-bare", "ekf-line", "plays-line", "rls", "ekf", "horizon-line", "batch-line"],
)
@pytest.mark.slow_but_first
def test_a_sensor_that_reads_zero_leaves_a_gain(kind: str) -> None:
    windows = kind.split("-")[0] in ROUNDS
    estimator = MAKERS[kind]()
    start = estimator.model
    u = 33.0 * np.sin(np.arange(100) / 5.0 if windows else np.arange(20_000) / 50.0)
    estimator.run(u, np.zeros(u.size))
    slopes = [getattr(each, "c", None) or each.gain for each in (estimator.model, start)]
    assert slopes[0] >= (0.99e-2 if windows else 1e-3) * slopes[1]
    assert_finite(estimator)


def overwhelm(estimator: Any, rng: Any, counts: Any) -> None:
    for count in counts:
        estimator.run(wild(rng, count), wild(rng, count))
        assert_finite(estimator)


@pytest.mark.parametrize("kind", MAKERS)
@pytest.mark.slow_but_first
def test_any_bits(kind: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(ROUNDS.get(kind.split("-")[0], 60)):
        estimator = MAKERS[kind]()
        if "horizon" not in kind and "batch" not in kind:
            for u, x in zip(wild(rng, 8).tolist(), wild(rng, 8).tolist(), strict=True):
                estimator.step(u, x)
                assert_finite(estimator)
        overwhelm(estimator, rng, rng.integers(1, 60, 4).tolist())


@pytest.mark.parametrize("kind", [pz.HysteresisEKF, pz.OutputErrorRLS, pz.PrandtlIshlinskiiRLS])
def test_any_start_that_is_taken(kind: Any) -> None:
    rng, made = np.random.default_rng(6), 0
    while made < 40:
        rate, a, beta = (10.0 ** rng.uniform([-3.0, -20.0, -20.0], [12.0, 20.0, 20.0])).tolist()
        uncertainty, noise = (10.0 ** rng.uniform(-9.0, 9.0, 2)).tolist()
        model = pz.ColemanHodgdon(a, beta, rng.uniform(1.01, 1.99) * a * beta)
        try:
            estimator = kind(rate, initial_model=model, uncertainty=uncertainty, noise=noise)
        except ValueError:
            continue
        made += 1
        overwhelm(estimator, rng, rng.integers(1, 80, 3).tolist())
