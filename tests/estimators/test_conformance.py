"""Every estimator keeps every promise of the face. All public classes on `EstimatorBase` are found.

One that cannot keep a promise says so: its `conformance_exceptions` maps the test's name here, without
`test_`, to the reason.
"""

import copy
import inspect
import itertools
import json
import pickle
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.estimators.base import EstimatorBase
from tests.estimators.shared import START, TRUE, assert_finite, recorded
from tests.wild import wild

RATE = 1000.0
FOUND = {
    name: value for name, value in ((name, getattr(pz, name)) for name in pz.__all__)
    if inspect.isclass(value) and issubclass(value, EstimatorBase) and not inspect.isabstract(value)
}  # fmt: skip
# A prediction without a measurement may round the parameters, as the sigma points of a UKF do.
ROUNDING = 1e-12
# An offset that is zero has no relative error: a slope of so much is a centre off by 0.5 nm.
NO_OFFSET = 1e-5


@pytest.fixture(params=sorted(FOUND), autouse=True)
def kind(request: pytest.FixtureRequest) -> Any:
    """Class of one estimator; skips the test if the class declares an exception to it."""
    cls = FOUND[request.param]
    promise = request.node.originalname.removeprefix("test_")
    if promise in cls.conformance_exceptions:
        pytest.skip(f"{request.param}: {cls.conformance_exceptions[promise]}")
    return cls


def record(periods: float = 1.0, model: Any = TRUE) -> Any:
    return recorded(RATE, periods, model=model)


def face(estimator: Any) -> dict[str, Any]:
    """All that an estimator shows, for comparison by bits."""
    names = ("theta", "P", "y", "S", "K", "standard_errors")
    shown = {name: np.asarray(getattr(estimator, name)).tolist() for name in names}
    return shown | {"status": estimator.status, "model": estimator.model.to_dict()}


def through_json(estimator: Any) -> Any:
    return type(estimator).from_dict(json.loads(json.dumps(estimator.to_dict(), allow_nan=False)))


def assert_sound(estimator: Any) -> None:
    """Finite numbers, a covariance that is one, and a model that can be inverted."""
    assert_finite(estimator)
    P, n = estimator.P, len(estimator.parameter_names)
    assert estimator.theta.shape == estimator.standard_errors.shape == (n,)
    assert estimator.theta.dtype == np.float64
    assert P.shape == (n, n)
    assert estimator.K.ndim == 1
    assert type(estimator.y) is type(estimator.S) is float
    assert np.all(np.diag(P) >= 0.0)
    scale = np.sqrt(np.fmax(np.diag(P), 1e-300))
    assert np.linalg.eigvalsh(P / np.outer(scale, scale))[0] >= -1e-9


def test_refuses_wrong_arguments(kind: Any) -> None:
    for rate in (0.0, np.nan, np.inf, "fast", None):
        with pytest.raises(ValueError, match="sample_rate"):
            kind(rate)
    u, x = record(0.2)
    estimator = kind(RATE)
    for given, options, words in (
        ((u[:, None], x), {}, r"u must have shape \(N,\).*pass u\.ravel\(\)"),
        ((u, x.reshape(2, -1)), {}, r"x must have shape \(N,\)"),
        ((1.0, x), {}, r"u must have shape \(N,\)"),
        ((u, x[:-1]), {}, "u and x must have the same length"),
        ((u, x), {"every": 0}, "every"),
        ((u, x), {"record": ("theta",)}, "record"),
    ):
        with pytest.raises(ValueError, match=words):
            estimator.run(*given, **options)
    assert face(estimator) == face(kind(RATE))


def test_run_and_predict_with_update_are_steps(kind: Any) -> None:
    u, x = record()
    x[50] = u[77] = np.nan
    ran, sparse, stepped, parted = (kind(RATE) for _ in range(4))
    full, thin = ran.run(u, x, record=("y", "S", "P")), sparse.run(u, x, every=7)
    for u_k, x_k in zip(u.tolist(), x.tolist(), strict=True):
        stepped.step(u_k, x_k)
        parted.predict(u_k)
        parted.update(x_k)
    assert face(ran) == face(sparse) == face(stepped) == face(parted)
    assert full.parameter_names == ran.parameter_names
    assert full.theta.shape == (u.size, ran.theta.size)
    assert full.y.shape == full.S.shape == (u.size,)
    assert (full.y[-1], full.S[-1]) == (ran.y, ran.S)
    np.testing.assert_array_equal(full.theta[-1], ran.theta)
    np.testing.assert_array_equal(full.P[-1], ran.P)
    np.testing.assert_array_equal(full.index, np.arange(u.size))
    assert thin.y is thin.S is thin.P is None
    np.testing.assert_array_equal(thin.index, np.arange(6, u.size, 7))
    np.testing.assert_array_equal(thin.theta, full.theta[thin.index])
    assert_sound(ran)
    np.testing.assert_allclose(ran.P, ran.P.T, rtol=1e-12, atol=0.0)
    assert ran.S > 0.0
    assert np.all(ran.standard_errors > 0.0)
    assert (ran.status.samples, ran.status.missing) == (u.size, 2)


def test_run_in_parts_is_one_run(kind: Any) -> None:
    u, x = record()
    x[99:102] = np.nan
    whole, parts = kind(RATE), kind(RATE)
    theta = whole.run(u, x).theta
    edges = [0, 1, 1, 100, 101, 137, u.size]
    pieces = [parts.run(u[a:b], x[a:b]).theta for a, b in itertools.pairwise(edges)]
    assert face(parts) == face(whole)
    np.testing.assert_array_equal(np.concatenate(pieces), theta)


class Sulking:
    def __float__(self) -> float:
        raise RuntimeError("no reading")


# What drivers return for a number: all take 3.
NUMBERS: tuple[Any, ...] = (
    float, int, np.float64, np.float32, np.float16, np.longdouble, np.int64, np.uint8, Fraction, Decimal,
    lambda v: [v], lambda v: (int(v),), np.array, lambda v: np.array([v]), lambda v: np.array([v], np.int16),
    lambda v: np.array(v, np.float32), lambda v: np.array([v], object), np.ma.array,
    lambda v: np.ma.array([v]), lambda v: np.ma.array([v], mask=[False]), lambda v: [np.int32(v)],
)  # fmt: skip
# What is none of theirs.
NO_READINGS: tuple[Any, ...] = (
    "1.5", "", b"1", bytearray(b"1"), np.str_("1"), np.array(["1"]), 10**400, -(10**400), 1.0 + 0.0j,
    np.complex64(1.0), np.array([1.0j]), [], (), [1.0, 2.0], [[1.0]], [None], ["1"], {}, {1.0}, object(),
    Sulking(), float, np.zeros(2), np.zeros((1, 1)), np.zeros(0), np.ma.masked, np.ma.array([1.0], mask=True),
    np.ma.array(1.0, mask=True), [np.ma.masked], np.datetime64("2020-01-01"), np.timedelta64(5, "s"),
    np.nan, np.inf, -np.inf, 1e300,
)  # fmt: skip


def test_takes_a_number_of_any_kind(kind: Any) -> None:
    plain, stepped, parted = (kind(RATE) for _ in range(3))
    samples: list[Any] = [
        (made(float(k)), other(float(k // 4)), float(k), float(k // 4))
        for k, (made, other) in enumerate(zip(NUMBERS, reversed(NUMBERS), strict=True))
    ]
    samples += [(flag, flag, float(flag), float(flag)) for flag in (True, np.True_, np.bool_(False))]
    for u, x, plain_u, plain_x in samples:
        plain.step(plain_u, plain_x)
        stepped.step(u, x)
        parted.predict(u)
        parted.update(x)
    assert face(plain) == face(stepped) == face(parted)
    assert plain.status.missing == 0


def test_what_is_no_number_is_missing(kind: Any) -> None:
    """Any of it is as good as None: a sample that counts as missing and by itself leaves theta."""
    u, x = record(0.5)
    plain, other = kind(RATE), kind(RATE)
    with pytest.raises(ValueError, match="predict"):
        other.update(0.0)  # nothing was predicted
    for estimator in (plain, other):
        estimator.run(u[:30], x[:30])
    theta = other.theta
    for k, nothing in enumerate(NO_READINGS):
        u_k, x_k = float(u[30 + k]), float(x[30 + k])
        for estimator, value in ((plain, None), (other, nothing)):
            estimator.step(u_k, value)
            estimator.step(value, x_k)
            estimator.predict(value)
            estimator.step(u_k, value)
            estimator.predict(u_k)
            estimator.update(value)
        assert other.status == plain.status, repr(nothing)
        assert (other.status.last, other.status.missing) == ("missing", 5 * k + 5)
        if k == 0:
            np.testing.assert_allclose(other.theta, theta, rtol=ROUNDING)
        assert_sound(other)
    with pytest.raises(ValueError, match="predict"):
        other.update(0.0)  # nothing was left waiting
    for estimator in (plain, other):
        estimator.run(u[70:], x[70:])
    assert other.status.last != "missing"
    assert face(other) == face(plain)


def test_learns_the_parameters(kind: Any) -> None:
    u, x = record(6.0)
    estimator = kind(RATE)
    start = np.abs(estimator.theta[:3] / TRUE.theta - 1.0).max()
    estimator.run(u, x)
    assert np.abs(estimator.theta[:3] / TRUE.theta - 1.0).max() < min(0.12, start)
    model = estimator.model
    assert isinstance(model, pz.ColemanHodgdon)
    assert np.abs(model.simulate(u) - TRUE.simulate(u))[-200:].max() < 0.1


@pytest.mark.slow
def test_learns_a_linear_gain(kind: Any) -> None:
    estimator = kind(RATE, initial_model=pz.LinearGain(0.1))
    assert estimator.parameter_names == ("gain",)
    estimator.run(*record(4.0, model=pz.LinearGain(0.155)))
    np.testing.assert_allclose(estimator.model.theta, [0.155], rtol=0.05)
    assert isinstance(estimator.model, pz.LinearGain)
    assert estimator.P.shape == (1, 1)
    assert face(through_json(estimator)) == face(estimator)


def test_a_dwell_moves_nothing(kind: Any) -> None:
    u, x = record(3.0)
    estimator = kind(RATE)
    estimator.run(u, x)
    before = estimator.theta
    noise = 1e-3 * np.random.default_rng(1).standard_normal(400)
    estimator.run(np.full(400, u[-1]), TRUE.simulate(u)[-1] + noise)
    np.testing.assert_allclose(estimator.theta, before, rtol=0.05, atol=NO_OFFSET)
    assert_sound(estimator)


N = 300
RNG = np.random.default_rng(2)
HELD, WAVE = recorded(RATE, 1.5, noise=0.0)
# Records that no stage makes.
HOSTILE: dict[str, tuple[Any, Any]] = {
    "noise": (RNG.normal(0.0, 50.0, N), RNG.normal(0.0, 10.0, N)),
    "backwards": (HELD, -WAVE),
    "stuck sensor": (HELD, np.full(N, 3.0)),
    "stuck voltage": (np.zeros(N), 5.0 * np.sin(np.arange(N))),
    "spikes": (HELD, WAVE + 1e4 * (RNG.random(N) < 0.05)),
    "huge": (1e8 * RNG.standard_normal(N), 1e8 * RNG.standard_normal(N)),
    "tiny": (1e-12 * HELD, 1e-12 * WAVE),
    "any bits": (wild(RNG, N), wild(RNG, N)),
    "holes": (np.where(RNG.random(N) < 0.5, HELD, np.nan), np.where(RNG.random(N) < 0.5, WAVE, np.inf)),
    "biased": (HELD + 80.0, WAVE - 100.0),
}


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("model", [None, pz.LinearGain(0.1)])
def test_model_is_admissible_after_anything(kind: Any, name: str, model: Any) -> None:
    if model is not None and "learns_a_linear_gain" in kind.conformance_exceptions:
        pytest.skip(f"{kind.__name__}: {kind.conformance_exceptions['learns_a_linear_gain']}")
    u, x = HOSTILE[name]
    estimator = kind(RATE) if model is None else kind(RATE, initial_model=model)
    compensator: Any = pz.InverseCompensator(TRUE) if model is None else pz.LinearCompensator(model)
    for start in range(0, u.size, 25):
        estimator.run(u[start : start + 25], x[start : start + 25])
        assert_sound(estimator)
        compensator.model = estimator.model
        assert np.isfinite(compensator.step(0.1))
    assert face(through_json(estimator)) == face(estimator)


def test_a_missing_sample_changes_nothing_but_itself(kind: Any) -> None:
    u, x = record(2.0)
    whole, gappy = kind(RATE), kind(RATE)
    whole.run(u, x)
    x[300] = np.nan
    trace = gappy.run(u, x)
    np.testing.assert_allclose(trace.theta[300], trace.theta[299], rtol=ROUNDING)
    np.testing.assert_allclose(gappy.theta, whole.theta, rtol=0.03, atol=NO_OFFSET)
    assert gappy.status.missing == 1
    assert gappy.status.samples == whole.status.samples == u.size


def test_works_in_the_ring(kind: Any) -> None:
    """The ring teaches it what the record does."""
    reference, stage = pz.signals.triangle(5.0, 5.0, 1.5, RATE), pz.SimulatedStage(RATE, TRUE, seed=0)
    estimator, alone = kind(RATE), kind(RATE)
    parts: Any = {"compensator": pz.InverseCompensator(START), "estimator": estimator, "update_interval": 25}
    record = pz.track(reference, stage=stage, **parts)
    assert record.theta.shape == (len(reference), len(record.parameter_names))
    assert np.all(np.isfinite(record.voltage))
    assert record.max_error() < 2.0
    for k in range(0, len(reference), 25):
        alone.run(record.voltage[k : k + 25], record.measured[k : k + 25])
    assert face(estimator) == face(alone)


def test_reset_equals_new(kind: Any) -> None:
    u, x = record()
    new, used = kind(RATE), kind(RATE)
    saved = used.to_dict()
    assert list(saved["arguments"]) == list(inspect.signature(kind).parameters)
    used.run(u + 10.0, 0.5 * x)
    used.predict(3.0)
    used.reset()
    assert_sound(used)
    assert face(used) == face(new)
    assert used.to_dict() == new.to_dict() == saved
    resumed = through_json(new)
    for each in (new, used, resumed):
        each.run(u, x)
    assert face(used) == face(new) == face(resumed)


@pytest.mark.parametrize(
    "duplicate",
    [lambda each: each.copy(), copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each)),
     through_json],
)  # fmt: skip
def test_copies_and_files_go_on_bit_for_bit(kind: Any, duplicate: Any) -> None:
    u, x = record()
    x[150] = np.nan
    estimator = kind(RATE)
    estimator.run(u[:100], x[:100])
    estimator.predict(float(u[100]))
    before, saved = face(estimator), estimator.to_dict()
    other = duplicate(estimator)
    assert type(other) is kind
    for each in (other, estimator):
        assert face(each) == before
        assert each.to_dict() == saved
        each.update(float(x[100]))
        each.run(u[101:], x[101:])
    assert face(other) == face(estimator)


def test_refuses_a_save_that_is_not_its_own(kind: Any) -> None:
    data = kind(RATE).to_dict()
    arguments, state = data["arguments"], data["state"]

    def without(holder: dict[str, Any], name: str) -> dict[str, Any]:
        return {key: value for key, value in holder.items() if key != name}

    odd: tuple[Any, ...] = ("7", np.nan, 10**400, {})
    words = r"data|arguments|state|pending|numbers"
    wrong: list[tuple[Any, str]] = [
        ([data], "dictionary"),
        (data | {"estimator": "Other"}, f"not of a {kind.__name__}"),
        (data | {"format": 99}, "format"),
        (data | {"no_such_key": 1}, "no_such_key"),
        (data | {"state": state | {"no_such_name": 0.0}}, "state"),
        (data | {"arguments": arguments | {"no_such_argument": 1}}, "arguments has unknown fields"),
        (data | {"arguments": arguments | {"initial_model": [1.0]}}, "model"),
        *((data | {"arguments": without(arguments, name)}, f"arguments has no '{name}'")
          for name in arguments),
        *((data | {"state": state | {"samples": value}}, "state") for value in odd),
        *((without(data, name), words) for name in data),
        *((data | {name: {"a": [1]}}, words) for name in data),
    ]  # fmt: skip
    for changed, message in wrong:
        with pytest.raises(ValueError, match=message):
            kind.from_dict(changed)
