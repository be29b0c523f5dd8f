"""A saved estimator that was changed is refused in words, or works: no crash, no hang, nothing infinite."""

from __future__ import annotations

import copy
import itertools
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies
from piezoest.estimators import saved_state
from piezoest.layout import by_name, leaves

RATE = 2000.0
MUTATIONS = Path(__file__).with_name("mutated_states.py")


def used(estimator: Any, samples: int = 400) -> Any:
    """The estimator after a record of a stage, so that its state is nowhere at its start."""
    u = pz.signals.triangle(33.0, 20.0, samples * 20.0 / RATE, RATE).values[:samples]
    x = pz.ColemanHodgdon(0.021, 0.147, 0.00429).simulate(u)
    estimator.run(u, x + 1e-3 * np.random.default_rng(0).standard_normal(u.size))
    return estimator


def with_value(data: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A saved estimator with another value at a path of names, ``"law.theta"``."""
    data = copy.deepcopy(data)
    *above, name = path.split(".")
    holder = data["state"]
    for each in above:
        holder = holder[each]
    assert name in holder
    holder[name] = value
    return data


def value_at(data: dict[str, Any], path: str) -> Any:
    """The value at a path of names."""
    holder = data["state"]
    for each in path.split("."):
        holder = holder[each]
    return holder


def covariance_of(estimator: Any) -> str:
    """Path of the first covariance within a state."""
    found = leaves(estimator.layout, estimator.state)
    return next(path for path, kind, _ in found if kind.square)


ALL = (
    pz.HysteresisRLS(RATE, delay=7.0),
    pz.HysteresisRLS(RATE, policies=(policies.RandomWalk(), policies.AmplitudeMemory())),
    pz.OutputErrorRLS(RATE),
    pz.HysteresisEKF(RATE, offset=True),
    pz.PrandtlIshlinskiiRLS(RATE, thresholds=4, bends=1),
    pz.FilterPyEKF(RATE),
    pz.MovingHorizon(RATE, window=0.05, hop=0.02),
)


@pytest.mark.parametrize("value", [1e9, -1e9, -2.0, 0.5])
@pytest.mark.parametrize(
    ("estimator", "path"),
    [
        (pz.HysteresisRLS(RATE, delay=7.0), "line.position"),
        (pz.OutputErrorRLS(RATE), "member"),
        (pz.OutputErrorRLS(RATE, delay=7.0), "line.position"),
        (pz.HysteresisEKF(RATE, delay=7.0), "line.position"),
        (pz.PrandtlIshlinskiiRLS(RATE), "plays.memory.count"),
        (pz.PrandtlIshlinskiiRLS(RATE, delay=7.0), "line.position"),
    ],
    ids=lambda value: type(value).__name__ if hasattr(value, "step") else None,
)
def test_what_becomes_an_index_is_refused(estimator: Any, path: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"state: {path} must be a whole number"):
        type(estimator).from_dict(with_value(estimator.to_dict(), path, value))


def test_lengths_must_be_as_arguments_make_them() -> None:
    for estimator in (pz.PrandtlIshlinskiiRLS(RATE, thresholds=4), pz.HysteresisRLS(RATE, delay=7.5)):
        data = estimator.to_dict()
        lengths = {
            path: float(value)
            for path, kind, (value,) in leaves(estimator.layout, estimator.state)
            if kind.fixed and np.ndim(value) == 0
        }
        assert lengths
        for path, value in itertools.product(lengths, (1e9, -1.0, 0.0, 2.5, 3.0)):
            if value != lengths[path]:
                with pytest.raises(ValueError, match=f"state: {path} must be as the arguments make it"):
                    type(estimator).from_dict(with_value(data, path, value))


@pytest.mark.parametrize("estimator", ALL, ids=lambda estimator: type(estimator).__name__)
def test_names_and_shapes_must_be_its_own(estimator: Any) -> None:
    """Every name, in every record within the state: dropped, renamed, added, of another shape or type."""
    saved = used(estimator.copy()).to_dict()["state"]

    def refused(words: str) -> None:
        with pytest.raises(ValueError, match=words):
            saved_state.check(saved, estimator.layout, estimator.state, estimator._rules)

    def refuse(holder: dict[str, Any]) -> None:
        for name, value in list(holder.items()):
            if isinstance(value, dict):
                refuse(value)
            del holder[name]
            refused(f"state.* has no '{name}'")
            holder[name + "_"] = value
            refused(f"'{name}'")
            holder[name] = value
            refused(f"unknown fields.*'{name}_'")
            del holder[name + "_"]
            for wrong in (None, "1", [], [value], {"a": 1.0}, np.nan, 10**400, [[1.0], [2.0, 3.0]]):
                holder[name] = wrong
                refused("state")
            holder[name] = value

    refuse(saved)
    state = saved_state.check(saved, estimator.layout, estimator.state, estimator._rules)
    assert by_name(estimator.layout, state) == saved


@pytest.mark.parametrize("estimator", ALL, ids=lambda estimator: type(estimator).__name__)
def test_a_covariance_must_be_one(estimator: Any) -> None:
    estimator = used(estimator.copy())
    path, data = covariance_of(estimator), estimator.to_dict()
    P = np.array(value_at(data, path))
    n = len(P)
    swapped, negative, lopsided = P[[1, 0, *range(2, n)]], -P, P.copy()
    lopsided[0, 1] += 0.01 * np.sqrt(P[0, 0] * P[1, 1])
    for wrong in (swapped, negative, lopsided):
        with pytest.raises(ValueError, match=f"state: {path} must"):
            type(estimator).from_dict(with_value(data, path, wrong.tolist()))


@pytest.mark.parametrize("estimator", ALL, ids=lambda estimator: type(estimator).__name__)
def test_counters_must_agree(estimator: Any) -> None:
    data = with_value(used(estimator.copy()).to_dict(), "samples", 1.0)
    with pytest.raises(ValueError, match="counters"):
        type(estimator).from_dict(with_value(data, "missing", 2.0))


def test_work_space_is_not_saved() -> None:
    switched = (policies.Projection(), policies.ExcitationGate())
    estimator = pz.HysteresisRLS(RATE, policies=(policies.RandomWalk(), *switched))
    for k in range(3):
        estimator.step(0.1 * k, 0.01 * k)
    idle = [path for path, kind, _ in leaves(estimator.layout, estimator.state) if kind.idle]
    assert "law.product" in idle
    saved = estimator.to_dict()
    assert saved["state"] == by_name(estimator.layout, estimator.state)
    for path in idle:
        with pytest.raises(KeyError):
            value_at(saved, path)


@pytest.mark.parametrize("word", ["data", "text", 7, None, []])
def test_models_and_policies_refuse_what_is_no_dictionary(word: Any) -> None:
    for read in (pz.models.model_from_dict, policies.policy_from_dict, pz.models.AmplitudeProfile.from_dict):
        with pytest.raises(ValueError, match=r"unknown|no AmplitudeProfile"):
            read(word)
    for kind in (pz.ColemanHodgdon, pz.PrandtlIshlinskii, pz.models.Creep, pz.models.MassSpringDamper):
        with pytest.raises(ValueError, match="must be a dictionary"):
            kind.from_dict(word)


@pytest.mark.parametrize("value", ["text", None, [1.0], {}, 10**400, np.nan])
def test_models_and_policies_refuse_wrong_fields(value: Any) -> None:
    profile = pz.models.AmplitudeProfile(np.array([1.0]), np.array([[1.0, 2.0, 3.0]]))
    described = (
        (pz.models.model_from_dict, pz.ColemanHodgdon(0.02, 0.12, 0.0036).to_dict(), "alpha"),
        (pz.models.model_from_dict, pz.PrandtlIshlinskii(0.1, [1.0], [0.1]).to_dict(), "thresholds"),
        (policies.policy_from_dict, policies.policy_to_dict(policies.RandomWalk()), "memory"),
        (policies.policy_from_dict, policies.policy_to_dict(policies.NormBound()), "limit"),
        (policies.policy_from_dict, policies.policy_to_dict(policies.ExcitationGate()), "least"),
        (policies.policy_from_dict, policies.policy_to_dict(policies.Forgetting(1.0)), "memory"),
        (pz.models.AmplitudeProfile.from_dict, profile.to_dict(), "theta"),
    )  # fmt: skip
    for read, data, name in described:
        if not (name == "thresholds" and value == [1.0]):
            with pytest.raises(ValueError, match=name):
                read(data | {name: value})
        with pytest.raises(ValueError, match=f"has no '{name}'"):
            read({key: inner for key, inner in data.items() if key != name})
        with pytest.raises(ValueError, match="no_such_field"):
            read(data | {"no_such_field": value})


def mutate(count: int, seed: int, seconds: float) -> None:
    """Run `mutated_states` in a process of its own, which a crash ends and not this one."""
    command = [sys.executable, "-X", "faulthandler", str(MUTATIONS), str(count), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    assert done.returncode == 0, f"exit code {done.returncode}\n{done.stdout}\n{done.stderr}"
    assert f"0 of {count} dictionaries" in done.stdout


def test_changed_dictionaries_are_refused_or_work() -> None:
    mutate(400, 1, 600.0)


@pytest.mark.slow
def test_many_changed_dictionaries_are_refused_or_work() -> None:
    mutate(30_000, 2, 3600.0)
