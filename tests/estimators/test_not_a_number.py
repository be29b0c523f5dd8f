"""Whatever comes in, nothing that is not a number comes out: of any estimator, with any settings."""

from __future__ import annotations

import dataclasses
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


def test_continuous_law_without_its_normalisation_stays_a_number() -> None:
    estimator = rls(time_base="continuous", policies=(p.NormBound(), p.DeadZone()))
    u = 33.0 * np.sin(np.arange(200) / 10.0)
    estimator.run(u, LOOP.simulate(u, allow_jumps=True))
    assert_numbers(estimator)
    assert estimator.status.resets > 0
    np.testing.assert_allclose(estimator.theta, LOOP.theta, rtol=1.0)


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


@pytest.mark.parametrize("kind", ["rls", "rls-line"])
def test_theta_that_is_no_number_hands_out_the_start(kind: str) -> None:
    estimator = MAKERS[kind]()
    start = estimator.model
    estimator.state["law"]["theta"][0] = np.nan
    assert slope(estimator.model) == pytest.approx(slope(start))


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


def test_negative_gain_keeps_its_sign_and_floor() -> None:
    estimator = rls(initial_model=pz.LinearGain(-0.15))
    u = 33.0 * np.sin(np.arange(20_000) / 50.0)
    estimator.run(u, 0.15 * u)
    assert slope(estimator.model) == pytest.approx(-0.0015)
    assert estimator.status.projected


def test_what_is_not_taken_is_counted_and_leaves_theta() -> None:
    estimator = pz.RecursiveLeastSquares(2, theta=[1.0, 2.0], P=1.0, policies=())
    estimator.update(3.0, [1.0, 1.0])
    theta = estimator.theta
    estimator.update(9e99, [9e99, -9e99])
    assert np.array_equal(estimator.theta, theta)
    assert np.array_equal(estimator.P, np.eye(2))
    assert estimator.resets == 1
    assert np.isfinite([estimator.y, estimator.S]).all()


def test_directional_forgetting_has_no_direction_in_almost_nothing() -> None:
    estimator = pz.RecursiveLeastSquares(
        2, P=1.0, policies=(p.DirectionalForgetting(100.0, unit="second"), p.NormBound())
    )
    for size in (1e-100, 1e-159, 1e-162, 5e-324, 0.0, 1.0):
        estimator.update(1.0, [size, -size])
        assert np.all(np.isfinite(estimator.P)), size


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


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(MAKERS))
def test_many_bits(kind: str) -> None:
    feed(kind, 5, 3000, 120)


@pytest.mark.parametrize("kind", sorted(SLOW_MAKERS))
def test_any_bits_in_windows(kind: str) -> None:
    rng = np.random.default_rng(2)
    for _ in range(6):
        estimator = SLOW_MAKERS[kind]()
        estimator.run(wild(rng, 35), wild(rng, 35))
        assert_numbers(estimator)


@pytest.mark.parametrize("kind", ["rls-bare", "rls", "ekf"])
def test_any_bits_in_a_bank(kind: str) -> None:
    rng = np.random.default_rng(3)
    bank = pz.EstimatorBank(MAKERS[kind](), 5)
    singles = [MAKERS[kind]() for _ in range(5)]
    for _ in range(20):
        u, x = (wild(rng, 200).reshape(40, 5) for _ in range(2))
        bank.run(u, x)
        for c, single in enumerate(singles):
            single.run(u[:, c], x[:, c])
            assert_numbers(bank.channel(c))
            assert np.array_equal(bank.channel(c).theta, single.theta)
            assert bank.channel(c).status == single.status


# ---------------------------------------------------------------- settings

# Each combination is compiled for itself: these few have every policy, and many of them together. What they
# are drawn with, and all other numbers, are drawn anew for each estimator.
COMBINATIONS: tuple[dict[str, Any], ...] = (
    {},
    {"policies": ()},
    {"policies": (p.RandomWalk, p.OutlierRejection, p.Projection, p.ChangeDetection, p.AmplitudeMemory)},
    {"policies": (p.PeriodicForgetting, p.ExcitationGate, p.DeadZone, p.NormBound), "errors": False},
    {"policies": (p.DirectionalForgetting, p.DeadZone, p.CovarianceResetting), "offset": False},
    {
        "policies": (p.VariableForgetting, p.OutlierRejection, p.ExcitationGate, p.Projection),
        "high_pass": 1.0,
    },
    {
        "policies": (p.Normalisation, p.NormBound, p.DeadZone, p.CovarianceResetting),
        "time_base": "continuous",
    },
    {"policies": (p.PeriodicForgetting, p.NormBound), "line": True, "offset": True},
    {"policies": (p.Normalisation,), "line": True, "time_base": "continuous", "high_pass": 1.0, "delay": 0.5},
)


def size(rng: np.random.Generator, low: float, high: float) -> float:
    """A number of any size between powers of ten."""
    return float(10.0 ** rng.uniform(low, high))


def drawn_policy(rng: np.random.Generator, cls: Any) -> Any:
    """A policy of any numbers; ValueError for those that it refuses."""
    policy = cls(0.1) if cls is p.CovarianceResetting else cls()
    numbers = {name: value for name, value in dataclasses.asdict(policy).items() if type(value) is float}
    far = rng.random() < 0.5
    return dataclasses.replace(
        policy, **{name: value * size(rng, -3.0, 3.0) for name, value in numbers.items() if far}
    )


def drawn(rng: np.random.Generator) -> pz.HysteresisRLS:
    """`HysteresisRLS` of any legal numbers, in one of the combinations; ValueError for others."""
    options = dict(COMBINATIONS[rng.integers(len(COMBINATIONS))])
    far = rng.random() < 0.5
    a, ratio = size(rng, -20.0, 20.0) if far else 0.02, rng.uniform(1.0, 2.1)
    beta = size(rng, -20.0, 20.0) if far else 0.12
    loop = pz.ColemanHodgdon(a, beta, ratio * a * beta, rng.choice([0.0, size(rng, -5.0, 9.0)]))
    line = pz.LinearGain(float(rng.choice([-1.0, 1.0])) * size(rng, -20.0, 20.0))
    if "policies" in options:
        options["policies"] = tuple(drawn_policy(rng, cls) for cls in options["policies"])
        by_swings = any(isinstance(each, p.RandomWalk | p.PeriodicForgetting) for each in options["policies"])
        options["memory"] = "period" if by_swings else (None, size(rng, -12.0, 12.0))[rng.integers(2)]
    if "high_pass" in options:
        options["high_pass"] = size(rng, -6.0, 6.0)
    if "delay" in options:
        options["delay"] = float(rng.uniform(0.0, 5.0))
    return pz.HysteresisRLS(
        size(rng, -3.0, 12.0),
        initial_model=line if options.pop("line", False) else loop,
        uncertainty=size(rng, -12.0, 12.0) if far else 0.5,
        noise=size(rng, -12.0, 12.0) if far else 1.5e-3,
        **options,
    )


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


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 9))
def test_many_settings(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sweep(rng, lambda: drawn(rng), 3000)


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
