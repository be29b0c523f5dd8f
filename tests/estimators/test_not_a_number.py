"""Whatever comes in, nothing that is not a number comes out: of any estimator, with any settings."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies as p
from tests.wild import wild

RATE = 1000.0
LINE = pz.LinearGain(0.15)
LOOP = pz.ColemanHodgdon(0.02, 0.12, 0.0036)


def rls(**options: Any) -> pz.HysteresisRLS:
    return pz.HysteresisRLS(RATE, **options)


MAKERS: dict[str, Any] = {
    "rls": rls,
    "rls-bare": lambda: rls(memory=0.4, policies=(), errors=False),
    "rls-continuous": lambda: rls(time_base="continuous", policies=(p.NormBound(), p.DeadZone())),
    "rls-continuous-bare": lambda: rls(time_base="continuous", policies=()),
    "rls-line": lambda: rls(initial_model=LINE, offset=True),
    "rls-line-bare": lambda: rls(initial_model=LINE, memory=0.4, policies=()),
    "rls-all": lambda: rls(policies=(
        p.RandomWalk(), p.OutlierRejection(1), p.Projection(), p.ChangeDetection(), p.AmplitudeMemory()
    )),
    "output-error": lambda: pz.OutputErrorRLS(RATE),
    "ekf": lambda: pz.HysteresisEKF(RATE),
    "ekf-free": lambda: pz.HysteresisEKF(RATE, project=False, offset=True),
    "ekf-line": lambda: pz.HysteresisEKF(RATE, initial_model=LINE, offset=True),
    "plays": lambda: pz.PrandtlIshlinskiiRLS(RATE),
    "plays-line": lambda: pz.PrandtlIshlinskiiRLS(RATE, initial_model=LINE),
    "filterpy-ekf": lambda: pz.FilterPyEKF(RATE),
    "filterpy-ukf": lambda: pz.FilterPyUKF(RATE),
    "horizon": lambda: pz.MovingHorizon(RATE, window=0.03, hop=0.01),
    "horizon-line": lambda: pz.MovingHorizon(RATE, window=0.03, hop=0.01, initial_model=LINE, offset=True),
    "batch": lambda: pz.BatchFit(RATE, offset=True),
    "batch-line": lambda: pz.BatchFit(RATE, initial_model=LINE),
}  # fmt: skip
# Too slow for many rounds, or for many samples.
ROUNDS = {"filterpy": 2, "horizon": 6, "batch": 6}


def assert_numbers(estimator: Any) -> None:
    """Nothing visible is NaN or infinite, and the model can be inverted."""
    for name in ("theta", "P", "y", "S", "K", "standard_errors"):
        values = np.asarray(getattr(estimator, name))
        assert np.all(np.isfinite(values)), (name, values)
    assert isinstance(estimator.status, pz.Status)
    model = estimator.model
    assert np.all(np.isfinite(model.theta)), model
    assert np.isfinite(model.offset)
    assert model.is_admissible, model


@pytest.mark.slow
def test_covariance_that_winds_up_starts_anew() -> None:
    estimator = rls(memory=0.4, policies=())
    u = 33.0 * np.sin(np.arange(2000) / 50.0)
    x = LOOP.simulate(u)
    estimator.run(u, x)
    learnt = estimator.theta
    estimator.run(np.full(300_000, u[-1]), np.full(300_000, x[-1]))
    assert_numbers(estimator)
    assert estimator.status.resets > 0
    np.testing.assert_allclose(estimator.theta, learnt, rtol=1e-3)
    more = rls(memory=0.4, policies=())
    more._load(estimator._state)
    more.run(u, x)
    np.testing.assert_allclose(more.theta, LOOP.theta, rtol=0.05)


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
    assert_numbers(estimator)


@pytest.mark.parametrize("kind", ["rls", "rls-bare", "ekf", "output-error"])
@pytest.mark.slow_but_first
def test_spoilt_covariance_starts_anew(kind: str) -> None:
    u = 33.0 * np.sin(np.arange(300) / 10.0)
    x = LOOP.simulate(u, allow_jumps=True)
    for bad in (np.nan, np.inf, -1.0):
        estimator = MAKERS[kind]()
        estimator.run(u, x)
        theta, resets = estimator.theta, estimator.status.resets
        estimator.state["filter" if kind == "ekf" else "law"]["P"][0, 0] = bad
        estimator.step(u[-1] + 0.5, x[-1] + 0.05)
        assert_numbers(estimator)
        assert estimator.status.resets == resets + 1
        np.testing.assert_allclose(estimator.theta[:3], theta[:3], rtol=0.5)


@pytest.mark.parametrize("kind", MAKERS)
@pytest.mark.slow_but_first
def test_any_bits(kind: str) -> None:
    """Wild numbers by `step`, then by `run`, over and over."""
    rng = np.random.default_rng(1)
    for _ in range(ROUNDS.get(kind.split("-")[0], 60)):
        estimator = MAKERS[kind]()
        if "horizon" not in kind and "batch" not in kind:
            for u, x in zip(wild(rng, 8).tolist(), wild(rng, 8).tolist(), strict=True):
                estimator.step(u, x)
                assert_numbers(estimator)
        for count in rng.integers(1, 60, 4).tolist():
            estimator.run(wild(rng, count), wild(rng, count))
            assert_numbers(estimator)


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
        for count in rng.integers(1, 80, 3).tolist():
            estimator.run(wild(rng, count), wild(rng, count))
            assert_numbers(estimator)
