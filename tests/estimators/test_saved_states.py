"""A saved estimator that was changed is refused in words, or works: no crash, no hang, nothing infinite."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies
from piezoest.estimators import saved_state

RATE = 2000.0
MUTATIONS = Path(__file__).with_name("mutated_states.py")


def used(estimator: Any, samples: int = 400) -> Any:
    """The estimator after a record of a stage, so that its state is nowhere at its start."""
    u = pz.signals.triangle(33.0, 20.0, samples * 20.0 / RATE, RATE).values[:samples]
    x = pz.ColemanHodgdon(0.021, 0.147, 0.00429).simulate(u)
    estimator.run(u, x + 1e-3 * np.random.default_rng(0).standard_normal(u.size))
    return estimator


def blocks(estimator: Any) -> dict[str, slice]:
    """Where the blocks of an estimator's state are."""
    table = estimator._table()
    return {block.name: part for block, part in saved_state._parts(table, estimator._state.size)}


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
    ("estimator", "position", "name"),
    [
        (pz.HysteresisRLS(RATE, delay=7.0), 199, "the delay line's position"),
        (pz.OutputErrorRLS(RATE), 18, "the bank's member in use"),
        (pz.OutputErrorRLS(RATE), 214, "the delay line's position"),
        (pz.HysteresisEKF(RATE), 66, "the delay line's position"),
        (pz.PrandtlIshlinskiiRLS(RATE), 35, "the memory's count"),
        (pz.PrandtlIshlinskiiRLS(RATE), 2516, "the delay line's position"),
        (pz.PrandtlIshlinskiiRLS(RATE), 2420, "the grid must be as"),
    ],
    ids=lambda value: type(value).__name__ if hasattr(value, "step") else None,
)
def test_what_becomes_an_index_is_refused(estimator: Any, position: int, name: str, value: float) -> None:
    data = estimator.to_dict()
    data["state"][position] = value
    with pytest.raises(ValueError, match=name):
        type(estimator).from_dict(data)


def test_the_message_says_what_would_be_right() -> None:
    data = pz.HysteresisRLS(RATE, delay=7.0).to_dict()
    data["state"][199] = 1e9
    words = "state: the delay line's position must be a whole number from -1 to 7, got 1e.09 at position 199"
    with pytest.raises(ValueError, match=words):
        pz.HysteresisRLS.from_dict(data)


@pytest.mark.parametrize("estimator", ALL, ids=lambda estimator: type(estimator).__name__)
def test_shifted_states_are_refused(estimator: Any) -> None:
    data = used(estimator.copy()).to_dict()
    for shift in range(1, len(data["state"])):
        rolled = data["state"][shift:] + data["state"][:shift]
        with pytest.raises(ValueError, match="state: "):
            type(estimator).from_dict(data | {"state": rolled})


@pytest.mark.parametrize("estimator", ALL, ids=lambda estimator: type(estimator).__name__)
def test_a_covariance_must_be_one(estimator: Any) -> None:
    estimator = used(estimator.copy())
    parts = blocks(estimator)
    name = next(name for name in ("the covariance P", "the covariance") if name in parts)
    size = parts[name].stop - parts[name].start
    n = round(np.sqrt(size))
    data = estimator.to_dict()
    P = np.array(data["state"][parts[name]]).reshape(n, n)
    swapped, negative, lopsided = P[[1, 0, *range(2, n)]], -P, P.copy()
    lopsided[0, 1] += 0.01 * np.sqrt(P[0, 0] * P[1, 1])
    for wrong in (swapped, negative, lopsided):
        state = list(data["state"])
        state[parts[name]] = wrong.ravel().tolist()
        with pytest.raises(ValueError, match=f"state: {name}"):
            type(estimator).from_dict(data | {"state": state})


def test_theta_and_covariance_cannot_change_places() -> None:
    for estimator in ALL[:2]:
        estimator = used(estimator.copy())
        state = estimator.to_dict()["state"]
        theta, P = (blocks(estimator)[name] for name in ("theta", "the covariance P"))
        assert P.start == theta.stop
        changed = state[: theta.start] + state[P] + state[theta] + state[P.stop :]
        with pytest.raises(ValueError, match="state: the covariance P"):
            type(estimator).from_dict(estimator.to_dict() | {"state": changed})


@pytest.mark.parametrize("estimator", ALL, ids=lambda estimator: type(estimator).__name__)
def test_counters_must_agree(estimator: Any) -> None:
    estimator = used(estimator.copy())
    data = estimator.to_dict()
    data["state"][blocks(estimator)["samples"].start] = 1.0
    data["state"][blocks(estimator)["samples missing"].start] = 2.0
    with pytest.raises(ValueError, match="counters"):
        type(estimator).from_dict(data)


@pytest.mark.parametrize("estimator", ALL, ids=lambda estimator: type(estimator).__name__)
def test_tables_cover_their_states(estimator: Any) -> None:
    starts = [block.start for block in estimator._table().blocks]
    assert starts[0] == 0
    assert starts == sorted(starts)
    assert starts[-1] < estimator._state.size


def test_work_space_is_not_saved() -> None:
    switched = (policies.Projection(), policies.ExcitationGate())
    estimator = pz.HysteresisRLS(RATE, policies=(policies.RandomWalk(), *switched))
    for k in range(3):
        estimator.step(0.1 * k, 0.01 * k)
    saved = estimator.to_dict()
    assert np.all(np.isfinite(saved["state"]))
    assert not np.any(np.array(saved["state"])[blocks(estimator)["the work space"]])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda n: pz.HysteresisRLS(RATE, delay=n), "delay must be at most"),
        (lambda n: pz.HysteresisEKF(RATE, delay=n), "delay must be at most"),
        (lambda n: pz.OutputErrorRLS(RATE, delay=n), "delay must be at most"),
        (lambda n: pz.FilterPyEKF(RATE, delay=n), "delay must be at most"),
        (lambda n: pz.PrandtlIshlinskiiRLS(RATE, delay=n), "delay must be at most"),
        (lambda n: pz.OutputErrorRLS(RATE, members=n), "members must be a whole number from 3 to 1000"),
        (lambda n: pz.PrandtlIshlinskiiRLS(RATE, thresholds=n), "thresholds must be a whole number from 0"),
        (lambda n: pz.PrandtlIshlinskiiRLS(RATE, bends=n), "bends must be a whole number from 0"),
        (lambda n: pz.PrandtlIshlinskiiRLS(RATE, thresholds=200, bends=50), "more than 1000: take fewer"),
        (lambda n: policies.AmplitudeMemory(places=n), "places must be a whole number from 1 to 1000"),
        (lambda n: pz.MovingHorizon(RATE, window=n), "window must be at most"),
        (lambda n: pz.BatchFit(RATE, hop=n * 1e20), "hop must be at most"),
        (lambda n: pz.EstimatorBank(pz.HysteresisRLS(RATE), n), "channels must be a whole number from 1"),
    ],
)
def test_arguments_that_become_sizes_are_bounded(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make(1e9 + 7)


def test_an_argument_in_a_dictionary_is_bounded_too() -> None:
    data = pz.HysteresisRLS(RATE, delay=7.0).to_dict()
    with pytest.raises(ValueError, match="delay must be at most"):
        pz.HysteresisRLS.from_dict(data | {"arguments": data["arguments"] | {"delay": 1e9}})
    with pytest.raises(ValueError, match=r"arguments\['noise'\] must be zero or of a size"):
        pz.HysteresisRLS.from_dict(data | {"arguments": data["arguments"] | {"noise": 1e-300}})


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
    mutate(2000, 1, 1200.0)


@pytest.mark.slow
def test_a_hundred_thousand_changed_dictionaries_are_refused_or_work() -> None:
    mutate(100_000, 2, 7200.0)
