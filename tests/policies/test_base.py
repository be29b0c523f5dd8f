"""A policy that is asked for is carried out, or refused: never silently ignored."""

import contextlib
import dataclasses
import functools
import itertools
import sys
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies as p
from piezoest.policies import base

RATE = 2000.0
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
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
OPTIONS: dict[str, dict[str, Any]] = {
    "RandomWalk": {"memory": "period"},
    "PeriodicForgetting": {"memory": "period"},
    "Normalisation": {"time_base": "continuous"},
    "NormBound": {"memory": 0.1},
}
ALL = sorted(policy.__name__ for policy in base.REGISTERED.values())


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


@pytest.mark.parametrize("name", ALL)
@pytest.mark.slow_but_first
def test_every_policy_is_carried_out(name: str) -> None:
    options = OPTIONS.get(name, {})
    memory = 0.4 if name == "Forgetting" else None
    u, x = eventful()
    others = {"policies": (), **options, "memory": options.get("memory")}
    by_period = others["memory"] == "period"
    without = pz.HysteresisRLS(RATE, **{"memory": None, "policies": ()} if by_period else others)
    without.run(u, x)

    def differs(*policies: Any) -> bool:
        with_it = pz.HysteresisRLS(RATE, **{"memory": memory, **options, "policies": policies})
        with_it.run(u, x)
        same = np.array_equal(with_it.theta, without.theta[: with_it.theta.size])
        return with_it.status.updates > 10 and not same

    policy = getattr(p, name)(**SETTINGS.get(name, {}))
    candidates = [()] if name == "Forgetting" else ((each,) for each in near(policy))
    assert any(differs(*each) for each in candidates), (
        f"{policy!r} changes nothing, nor with numbers up to a thousand times as large or as small: it "
        "does nothing, or eventful() has nothing for it"
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
    ],
)
def test_what_cannot_be_carried_out_is_refused(policy_of: Maker, functions: Any, words: str) -> None:
    policy = policy_of("Mine", **functions)
    with pytest.raises(ValueError, match=words):
        base.layouts((policy(),), AT)


def test_a_policy_defined_after_the_estimators_is_refused(policy_of: Maker) -> None:
    policy = policy_of("Late", prepare=hook)
    for make in (
        lambda: pz.HysteresisRLS(RATE, memory=None, policies=(policy(),)),
        lambda: pz.RecursiveLeastSquares(2, policies=(policy(),)),
    ):
        with pytest.raises(ValueError, match=r"Late was defined after the estimators.* not call its prepare"):
            make()
    estimator = pz.RecursiveLeastSquares(2, policies=(p.DeadZone(),))
    estimator.update(1.0, [1.0, 1.0])
    assert estimator.theta.sum() == pytest.approx(1.0, rel=1e-3)


def test_all_policies_are_saved_by_their_fields() -> None:
    for cls in base.REGISTERED.values():
        policy: Any = cls(**SETTINGS.get(cls.__name__, {}))
        assert p.policy_from_dict(p.policy_to_dict(policy)) == policy
