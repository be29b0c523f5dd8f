"""Whatever comes in, nothing that is not a number comes out: of any estimator, with any settings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import piezoest as pz
from piezoest import policies as p
from piezoest.equations import admissible

FloatArray = NDArray[np.float64]

RATE = 1000.0
LINE = pz.LinearGain(0.15)
LOOP = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
SPECIAL = np.array(
    [0.0, -0.0, 5e-324, -5e-324, 1e-310, 1e-160, -1e-20, 1.0, -33.0, 1e8, -9e8, 1e9, 1e155, -1e308,
     np.nan, np.inf, -np.inf]
)  # fmt: skip


def rls(**options: Any) -> pz.HysteresisRLS:
    return pz.HysteresisRLS(options.pop("rate", RATE), **options)


MAKERS: dict[str, Any] = {
    "rls": rls,
    "rls-bare": lambda: rls(memory=0.4, policies=(), errors=False),
    "rls-continuous": lambda: rls(time_base="continuous", policies=(p.NormBound(), p.DeadZone())),
    "rls-continuous-bare": lambda: rls(time_base="continuous", policies=()),
    "rls-line": lambda: rls(initial_model=LINE, offset=True),
    "rls-line-bare": lambda: rls(initial_model=LINE, memory=0.4, policies=()),
    "rls-all": lambda: rls(
        policies=(
            p.RandomWalk(),
            p.OutlierRejection(1),
            p.Projection(),
            p.ChangeDetection(),
            p.AmplitudeMemory(),
        )
    ),
    "output-error": lambda: pz.OutputErrorRLS(RATE),
    "ekf": lambda: pz.HysteresisEKF(RATE),
    "ekf-free": lambda: pz.HysteresisEKF(RATE, project=False, offset=True),
    "ekf-line": lambda: pz.HysteresisEKF(RATE, initial_model=LINE, offset=True),
    "plays": lambda: pz.PrandtlIshlinskiiRLS(RATE),
    "plays-line": lambda: pz.PrandtlIshlinskiiRLS(RATE, initial_model=LINE),
    "filterpy-ekf": lambda: pz.FilterPyEKF(RATE),
    "filterpy-ukf": lambda: pz.FilterPyUKF(RATE),
}
SLOW_MAKERS: dict[str, Any] = {
    "horizon": lambda: pz.MovingHorizon(RATE, window=0.03, hop=0.01),
    "horizon-line": lambda: pz.MovingHorizon(RATE, window=0.03, hop=0.01, initial_model=LINE, offset=True),
    "batch": lambda: pz.BatchFit(RATE, offset=True),
    "batch-line": lambda: pz.BatchFit(RATE, initial_model=LINE),
}


def wild(rng: np.random.Generator, count: int) -> FloatArray:
    """Numbers from all over float64: any bits, all sizes a stage takes, special ones, a wave between them."""
    bits = rng.integers(0, 2**64, count, dtype=np.uint64).view(np.float64)
    sizes = rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-30.0, 9.0, count)
    wave = 33.0 * np.sin(np.arange(count) / rng.uniform(1.0, 50.0))
    kinds = np.stack([bits, sizes, rng.choice(SPECIAL, count), wave, np.full(count, rng.choice(SPECIAL))])
    share = rng.dirichlet(np.full(len(kinds), 0.4))
    return np.asarray(kinds[rng.choice(len(kinds), count, p=share), np.arange(count)])


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


def slope(model: Any) -> float:
    return float(model.c if isinstance(model, pz.ColemanHodgdon) else model.gain)


# ---------------------------------------------------------------- what was seen to fail


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


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_projection_says_when_it_has_no_model(place: int, bad: float) -> None:
    theta, P = LOOP.theta, np.eye(3)
    assert admissible.project_admissible(theta, P, 2e-4, 1.2e-3, 1e-3)
    theta[place] = bad
    with np.errstate(all="ignore"):
        assert not admissible.project_admissible(theta, P, 2e-4, 1.2e-3, 1e-3)
        P[0, place] = np.nan
        assert not admissible.project_admissible(np.array([-1.0, 0.1, 5.0]), P, 2e-4, 1.2e-3, 1e-3)


@pytest.mark.parametrize(
    "kind", ["rls-line", "rls-line-bare", "ekf-line", "plays-line", "rls", "ekf", "ekf-free"]
)
def test_a_sensor_that_reads_zero_leaves_a_gain(kind: str) -> None:
    estimator = MAKERS[kind]()
    start = slope(estimator.model)
    u = 33.0 * np.sin(np.arange(20_000) / 50.0)
    estimator.run(u, np.zeros(u.size))
    assert slope(estimator.model) >= 1e-3 * start
    assert_numbers(estimator)


@pytest.mark.parametrize("kind", ["horizon", "horizon-line", "batch-line"])
def test_a_sensor_that_reads_zero_leaves_a_gain_in_windows(kind: str) -> None:
    estimator = SLOW_MAKERS[kind]()
    start = slope(estimator.model)
    u = 33.0 * np.sin(np.arange(100) / 5.0)
    estimator.run(u, np.zeros(u.size))
    assert slope(estimator.model) >= 0.99e-2 * start
    assert_numbers(estimator)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0])
def test_spoilt_covariance_starts_anew(bad: float) -> None:
    u = 33.0 * np.sin(np.arange(300) / 10.0)
    x = LOOP.simulate(u, allow_jumps=True)
    for kind in ("rls", "rls-bare", "ekf", "output-error"):
        estimator = MAKERS[kind]()
        estimator.run(u, x)
        theta, resets = estimator.theta, estimator.status.resets
        estimator.state["filter" if kind == "ekf" else "law"]["P"][0, 0] = bad
        estimator.step(u[-1] + 0.5, x[-1] + 0.05)
        assert_numbers(estimator)
        assert estimator.status.resets == resets + 1
        np.testing.assert_allclose(estimator.theta[:3], theta[:3], rtol=0.5)


# ---------------------------------------------------------------- all of float64


def feed(kind: str, seed: int, rounds: int, longest: int) -> None:
    """Wild numbers by `step`, then by `run`, over and over."""
    rng = np.random.default_rng(seed)
    for _ in range(rounds // 30 if kind.startswith("filterpy") else rounds):
        estimator = MAKERS[kind]()
        for u, x in zip(wild(rng, 8).tolist(), wild(rng, 8).tolist(), strict=True):
            estimator.step(u, x)
            assert_numbers(estimator)
        for _ in range(4):
            count = int(rng.integers(1, longest))
            estimator.run(wild(rng, count), wild(rng, count))
            assert_numbers(estimator)


@pytest.mark.parametrize("kind", sorted(MAKERS))
def test_any_bits(kind: str) -> None:
    feed(kind, 1, 60, 60)


@pytest.mark.parametrize("kind", sorted(SLOW_MAKERS))
def test_any_bits_in_windows(kind: str) -> None:
    rng = np.random.default_rng(2)
    for _ in range(6):
        estimator = SLOW_MAKERS[kind]()
        estimator.run(wild(rng, 35), wild(rng, 35))
        assert_numbers(estimator)


# ---------------------------------------------------------------- settings


def size(rng: np.random.Generator, low: float, high: float) -> float:
    """A number of any size between powers of ten."""
    return float(10.0 ** rng.uniform(low, high))


def sweep(rng: np.random.Generator, drawn: Callable[[], Any], count: int) -> None:
    """Wild records for so many estimators as are drawn."""
    made = 0
    while made < count:
        try:
            estimator = drawn()
        except ValueError:
            continue
        made += 1
        for _ in range(3):
            samples = int(rng.integers(1, 80))
            estimator.run(wild(rng, samples), wild(rng, samples))
            assert_numbers(estimator)


@pytest.mark.parametrize("kind", [pz.HysteresisEKF, pz.OutputErrorRLS, pz.PrandtlIshlinskiiRLS])
def test_extreme_starts_of_the_others(kind: Any) -> None:
    rng = np.random.default_rng(6)

    def drawn() -> Any:
        a, beta = size(rng, -20.0, 20.0), size(rng, -20.0, 20.0)
        return kind(
            size(rng, -3.0, 12.0),
            initial_model=pz.ColemanHodgdon(a, beta, rng.uniform(1.01, 1.99) * a * beta),
            uncertainty=size(rng, -9.0, 9.0),
            noise=size(rng, -9.0, 9.0),
        )

    sweep(rng, drawn, 40)
