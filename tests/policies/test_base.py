"""A policy that is asked for does what it says, or is refused: never silently ignored."""

import contextlib
import dataclasses
import functools
import itertools
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies as p
from piezoest.policies import base
from tests.estimators.shared import TRUE, recorded

RATE, FS = 2000.0, 5000.0
AT = base.Conditions(1.0, np.eye(3), by_period=True, has_swings=True, has_loop=True)

# Numbers with which a policy has something to do in the record below, where its own, and any near, have not.
SETTINGS: dict[str, dict[str, Any]] = {
    "CovarianceResetting": {"floor": 0.5},
    "DeadZone": {"threshold": 10.0},
    "DirectionalForgetting": {"memory": 0.4, "unit": "second"},
    "ExcitationGate": {"least": 1e-3},
    "NormBound": {"limit": 1.0},
    "Projection": {"margin": 0.4},
    "VariableForgetting": {"memory": 0.4, "unit": "second"},
}
# Options of the estimator that a policy needs.
OPTIONS: dict[str, dict[str, Any]] = {
    "RandomWalk": {"memory": "period"},
    "PeriodicForgetting": {"memory": "period"},
    "Normalisation": {"time_base": "continuous"},
    "NormBound": {"memory": 0.1},
}
POLICIES = {cls.__name__: cls(**SETTINGS.get(cls.__name__, {})) for cls in base.REGISTERED.values()}


def eventful() -> tuple[Any, Any]:
    """A record with a spike, a dwell, other amplitudes and another gain: something for every policy."""
    waves = [pz.signals.triangle(volts, 5.0, 4, RATE).values for volts in (33.0, 15.0, 33.0)]
    u = np.concatenate([waves[0], np.full(200, waves[0][-1]), *waves[1:]])
    x = TRUE.simulate(u) + 1e-3 * np.random.default_rng(0).standard_normal(u.size)
    x[u.size // 2 :] *= 0.7
    x[700] += 5.0
    return u, x


def near(policy: Any) -> Iterator[Any]:
    """The policy, and others with one number up to a thousand times as large or as small."""
    yield policy
    for name, factor in itertools.product(policy.numbers(AT), (0.1, 10.0, 0.01, 100.0, 1e-3, 1e3)):
        if hasattr(policy, name):
            with contextlib.suppress(ValueError):
                yield dataclasses.replace(policy, **{name: getattr(policy, name) * factor})


@pytest.mark.parametrize("name", sorted(POLICIES))
@pytest.mark.slow_but_first
def test_every_policy_is_carried_out(name: str) -> None:
    options = {"memory": None, **OPTIONS.get(name, {})}
    # Forgetting is what a memory alone asks for.
    is_memory = name == "Forgetting"
    with_memory = {**options, "memory": 0.4} if is_memory else options
    candidates: Any = [()] if is_memory else ((each,) for each in near(POLICIES[name]))
    u, x = eventful()
    # Without a policy a memory in periods is none.
    plain = {"memory": None} if options["memory"] == "period" else options
    without = pz.HysteresisRLS(RATE, policies=(), **plain)
    without.run(u, x)

    def differs(policies: Any) -> bool:
        with_it = pz.HysteresisRLS(RATE, policies=policies, **with_memory)
        with_it.run(u, x)
        same = np.array_equal(with_it.theta, without.theta[: with_it.theta.size])
        return with_it.status.updates > 10 and not same

    assert any(map(differs, candidates)), (
        f"{POLICIES[name]!r} changes nothing, nor with numbers up to a thousand times as large or as small: "
        "it does nothing, or eventful() has nothing for it"
    )


Maker = Callable[..., Any]


@pytest.fixture
def policy_of(monkeypatch: pytest.MonkeyPatch) -> Iterator[Maker]:
    """Makes a policy of one's own, of the functions in its module; all is forgotten afterwards."""
    monkeypatch.setattr(base, "note_source", lambda function: None)

    def make(name: str, **functions: Any) -> Any:
        module = ModuleType(f"own_{name.lower()}")
        vars(module).update(functions)
        monkeypatch.setitem(sys.modules, module.__name__, module)
        body = {"__module__": module.__name__, "__annotations__": {"gain": float}, "gain": 2.0}
        return dataclasses.dataclass(frozen=True)(type(name, (base.Policy,), body))

    with patch.dict(base.REGISTERED), patch.dict(base._chained):
        yield make


def hook(own: Any, fixed: Any, state: Any, settings: Any) -> Any:
    return True


def other_arguments(own: Any, numbers: Any, state: Any, settings: Any) -> Any:
    return True


@pytest.mark.parametrize(
    ("functions", "words"),
    [
        ({}, "Mine does nothing: its file has none of prepare, permits"),
        ({"prepair": hook, "permits": hook}, "prepair are no hooks, these are prepare"),
        ({"permits": other_arguments}, "must have the arguments own, fixed"),
        ({"permits": functools.partial(hook)}, "permits must be a plain function, marked @inlined"),
        ({"prepare": hook}, r"Mine was defined after the estimators.* not call its prepare"),
    ],
)
def test_what_cannot_be_carried_out_is_refused(policy_of: Maker, functions: Any, words: str) -> None:
    policies = (policy_of("Mine", **functions)(),)
    for make in (
        lambda: pz.HysteresisRLS(RATE, memory=None, policies=policies),
        lambda: pz.RecursiveLeastSquares(2, policies=policies),
    ):
        with pytest.raises(ValueError, match=words):
            make()
    # Those of the package work beside it.
    estimator = pz.RecursiveLeastSquares(2, policies=(p.DeadZone(),))
    estimator.update(1.0, [1.0, 1.0])
    assert estimator.theta.sum() == pytest.approx(1.0, rel=1e-3)


def test_policies_are_saved_by_their_fields() -> None:
    for policy in POLICIES.values():
        assert p.policy_from_dict(p.policy_to_dict(policy)) == policy


def made(*policies: Any, **options: Any) -> Any:
    return pz.HysteresisRLS(FS, policies=(*policies, p.DeadZone(), p.OutlierRejection()), **options)


def error(estimator: Any, theta: Any) -> Any:
    return np.abs(estimator.theta[:3] / theta - 1.0).max()


@pytest.mark.parametrize("forgetting", [p.RandomWalk(), p.PeriodicForgetting(2.0)])
@pytest.mark.slow_but_first
def test_a_step_of_the_gain_is_detected_once(forgetting: Any) -> None:
    u, x = recorded(FS, 20.0)
    half = u.size // 2
    with_it, without = made(forgetting, p.ChangeDetection()), made(forgetting)
    with_it.run(u[:half], x[:half])
    assert with_it.status.resets == 0
    without.run(u[:half], x[:half])
    for estimator in (with_it, without):
        estimator.run(u[half : half + 1500], 0.8 * x[half : half + 1500])
    assert with_it.status.resets == 1
    expected = TRUE.theta * [1.0, 0.8, 0.8]
    assert error(with_it, expected) < error(without, expected)


@pytest.mark.slow
def test_projection_keeps_theta_admissible() -> None:
    """A straight line has no admissible Coleman-Hodgdon model: the data pull theta out of the set."""
    u, x = recorded(FS, 4.0, model=pz.LinearGain(0.15))
    inside, free = made(p.RandomWalk(), p.Projection(0.02)), made(p.RandomWalk())
    theta = inside.run(u, x).theta
    free.run(u, x)
    assert free.status.projected
    assert not inside.status.projected
    ratio = theta[:, 2] / (theta[:, 0] * theta[:, 1])
    assert 1.02 * (1.0 - 1e-12) <= ratio.min() <= ratio.max() <= 1.98 * (1.0 + 1e-12)
    np.testing.assert_array_equal(inside.model.theta, inside.theta[:3])


@pytest.mark.slow
def test_amplitudes_are_remembered(tmp_path: Path) -> None:
    """Another loop at each amplitude: a long memory then starts from what was learnt there."""
    small, path = pz.ColemanHodgdon(0.024, 0.14, 0.0046), tmp_path / "profile.json"
    (u, x), large = (recorded(FS, 8.0, volts=volts, model=m) for volts, m in ((15.0, small), (45.0, TRUE)))
    known, unknown = made(p.PeriodicForgetting(1.0), p.AmplitudeMemory()), made(p.PeriodicForgetting(1.0))
    for estimator in (known, unknown):
        estimator.run(u, x)
        estimator.run(*large)
    profile = known.profile
    np.testing.assert_allclose(profile.swings, [30.0, 90.0], rtol=0.05)
    np.testing.assert_allclose(profile.at(30.0).theta, small.theta, rtol=0.25)
    np.testing.assert_allclose(profile.at(90.0).theta, TRUE.theta, rtol=0.15)
    between = profile.at(60.0).theta
    np.testing.assert_array_equal(np.median([*profile.theta, between], axis=0), between)
    profile.save(path)
    fresh = made(p.PeriodicForgetting(1.0), p.AmplitudeMemory())
    fresh.profile = pz.AmplitudeProfile.load(path)
    np.testing.assert_array_equal(pz.AmplitudeProfile.load(path).theta, profile.theta)
    np.testing.assert_allclose(fresh.profile.theta, profile.theta, rtol=1e-14)

    resets = known.status.resets
    for estimator in (known, unknown):
        estimator.run(u[:600], x[:600])
    assert known.status.resets > resets
    assert error(known, small.theta) < error(unknown, small.theta)
