"""A saved estimator that was changed is refused in words, or works: no crash, no hang, nothing infinite."""

import copy
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies
from piezoest.layout import leaves

RATE = 2000.0


def used(estimator: Any, samples: int = 400) -> Any:
    """The estimator after a record of a stage, so that its state is nowhere at its start."""
    u = pz.signals.triangle(33.0, 20.0, samples * 20.0 / RATE, RATE).values[:samples]
    x = pz.ColemanHodgdon(0.021, 0.147, 0.00429).simulate(u)
    estimator.run(u, x + 1e-3 * np.random.default_rng(0).standard_normal(u.size))
    return estimator


def holder_of(data: dict[str, Any], path: str) -> tuple[dict[str, Any], str]:
    """The record within a state, and the name there, that a path of names leads to: ``"law.theta"``."""
    *above, name = path.split(".")
    holder = data["state"]
    for each in above:
        holder = holder[each]
    assert name in holder
    return holder, name


ALL = (
    pz.HysteresisRLS(RATE, delay=7.0),
    pz.HysteresisRLS(RATE, policies=(policies.RandomWalk(), policies.AmplitudeMemory())),
    pz.OutputErrorRLS(RATE),
    pz.HysteresisEKF(RATE, offset=True),
    pz.PrandtlIshlinskiiRLS(RATE, thresholds=4, bends=1),
    pz.FilterPyEKF(RATE),
    pz.MovingHorizon(RATE, window=0.05, hop=0.02),
)


@pytest.mark.parametrize(
    ("estimator", "path"),
    [
        (pz.HysteresisRLS(RATE, delay=7.5), "line.position"),
        (pz.OutputErrorRLS(RATE), "member"),
        (pz.HysteresisEKF(RATE, delay=7.0), "line.position"),
        (pz.PrandtlIshlinskiiRLS(RATE, thresholds=4), "plays.memory.count"),
    ],
    ids=lambda value: type(value).__name__ if hasattr(value, "step") else None,
)
def test_indices_and_lengths_are_checked(estimator: Any, path: str) -> None:
    """What becomes an index is a whole number, and a length is as the arguments make it."""
    data = estimator.to_dict()
    lengths = {
        name: float(value)
        for name, kind, (value,) in leaves(estimator.layout, estimator.state)
        if kind.fixed and np.ndim(value) == 0
    }
    for value in (1e9, -1e9, -2.0, 0.5, 3.0):
        wrong = {name: "as the arguments make it" for name, own in lengths.items() if own != value}
        if value != 3.0:
            wrong[path] = "a whole number"
        for name, words in wrong.items():
            changed = copy.deepcopy(data)
            holder, last = holder_of(changed, name)
            holder[last] = value
            with pytest.raises(ValueError, match=f"state: {name} must be {words}"):
                type(estimator).from_dict(changed)


@pytest.mark.parametrize("estimator", ALL, ids=lambda estimator: type(estimator).__name__)
@pytest.mark.slow_but_first
def test_names_shapes_and_covariances_must_be_its_own(estimator: Any) -> None:
    """Every name, in every record within the state: dropped, renamed, added, of another shape or type."""
    estimator = used(estimator.copy())
    data = estimator.to_dict()

    def refused(words: str) -> None:
        with pytest.raises(ValueError, match=words):
            type(estimator).from_dict(data)

    def refuse(holder: dict[str, Any]) -> None:
        for name, value in list(holder.items()):
            if isinstance(value, dict):
                refuse(value)
            del holder[name]
            refused(f"state.* has no '{name}'")
            holder[name + "_"] = holder[name] = value
            refused(f"unknown fields.*'{name}_'")
            del holder[name + "_"]
            for wrong in (None, "1", [], [value], {"a": 1.0}, np.nan, 10**400, [[1.0], [2.0, 3.0]]):
                holder[name] = wrong
                refused("state")
            holder[name] = value

    refuse(data["state"])
    path = next(path for path, kind, _ in leaves(estimator.layout, estimator.state) if kind.square)
    holder, name = holder_of(data, path)
    P = np.array(holder[name])
    lopsided = P.copy()
    lopsided[0, 1] += 0.01 * np.sqrt(P[0, 0] * P[1, 1])
    for wrong in (P[[1, 0, *range(2, len(P))]], -P, lopsided):
        holder[name] = wrong.tolist()
        refused(f"state: {path} must")
    holder[name] = P.tolist()
    assert type(estimator).from_dict(data).to_dict() == data


ODD: tuple[Any, ...] = (
    "7", None, np.nan, np.inf, [], [[1.0], [2.0, 3.0]], {}, 10**400, 1e9, -1.0, 0.5, 1e308, 5e-324,
)  # fmt: skip


def places(holder: Any) -> list[tuple[Any, Any]]:
    """(dictionary or list, key) of every entry within, at any depth."""
    keys = list(holder) if isinstance(holder, dict) else range(len(holder))
    inner = [holder[key] for key in keys if isinstance(holder[key], dict | list)]
    return [(holder, key) for key in keys] + [place for each in inner for place in places(each)]


@pytest.mark.parametrize("estimator", ALL, ids=lambda estimator: type(estimator).__name__)
@pytest.mark.slow_but_first
def test_a_save_changed_at_random_is_refused_or_works(estimator: Any) -> None:
    saved, rng = used(estimator.copy()).to_dict(), np.random.default_rng(1)
    for _ in range(60):
        data = copy.deepcopy(saved)
        among = places(data[str(rng.choice(["state", "arguments"]))])
        holder, key = among[rng.integers(len(among))]
        value = holder[key]
        holder[key] = ODD[rng.integers(len(ODD))]
        if isinstance(value, float) and rng.random() < 0.5:
            holder[key] = value * float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-30.0, 30.0))
        try:
            resumed = type(estimator).from_dict(data)
        except ValueError:
            continue
        used(resumed, 60)
        assert np.all(np.isfinite(resumed.theta)), key
        assert resumed.model.is_admissible, key
