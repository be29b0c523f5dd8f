"""A saved estimator that was changed is refused in words, or works: no crash, no hang, nothing infinite."""

import copy
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies
from piezoest.layout import leaves
from tests.estimators.shared import TRUE

RATE = 2000.0
# What becomes an index.
INDICES = ("line.position", "member", "plays.memory.count")
ODD: tuple[Any, ...] = (
    "7", None, np.nan, np.inf, [], [[1.0], [2.0, 3.0]], {}, 10**400, 1e9, -1.0, 0.5, 1e308, 5e-324,
)  # fmt: skip


def used(estimator: Any, samples: int = 400) -> Any:
    """The estimator after a record of a stage, so that its state is nowhere at its start."""
    u = pz.signals.triangle(33.0, 20.0, samples * 20.0 / RATE, RATE).values[:samples]
    estimator.run(u, TRUE.simulate(u) + 1e-3 * np.random.default_rng(0).standard_normal(u.size))
    return estimator


def places(holder: Any, path: str = "") -> list[tuple[str, Any, Any]]:
    """Path such as "law.theta", dictionary or list that holds it, key there: of every entry at any depth."""
    found = []
    for key in list(holder) if isinstance(holder, dict) else range(len(holder)):
        found.append((f"{path}{key}", holder, key))
        if isinstance(holder[key], dict | list):
            found += places(holder[key], f"{path}{key}.")
    return found


@pytest.mark.parametrize(
    "estimator",
    [
        pz.HysteresisRLS(RATE, delay=7.5),
        pz.HysteresisRLS(RATE, policies=(policies.RandomWalk(), policies.AmplitudeMemory())),
        pz.OutputErrorRLS(RATE),
        pz.HysteresisEKF(RATE, offset=True, delay=7.0),
        pz.PrandtlIshlinskiiRLS(RATE, thresholds=4, bends=1),
        pz.FilterPyEKF(RATE),
        pz.MovingHorizon(RATE, window=0.05, hop=0.02),
    ],
)
@pytest.mark.slow_but_first
def test_a_save_that_was_changed_is_refused_or_works(estimator: Any) -> None:
    estimator = used(estimator.copy())
    from_dict, data, rng = type(estimator).from_dict, estimator.to_dict(), np.random.default_rng(1)
    named = {path: (holder, key) for path, holder, key in places(data["state"]) if isinstance(holder, dict)}

    def refused(words: str) -> None:
        with pytest.raises(ValueError, match=words):
            from_dict(data)

    # Every name, in every record within the state: dropped, renamed, added, of another shape or type.
    for holder, name in named.values():
        value = holder.pop(name)
        refused(f"state.* has no '{name}'")
        holder[name + "_"] = holder[name] = value
        refused(f"unknown fields.*'{name}_'")
        del holder[name + "_"]
        for wrong in (None, "1", [], [value], {"a": 1.0}, np.nan, 10**400, [[1.0], [2.0, 3.0]]):
            holder[name] = wrong
            refused("state")
        holder[name] = value

    # An index is a whole number, a length as the arguments make it, a covariance one.
    for path, kind, (value,) in leaves(estimator.layout, estimator.state):
        if kind.square and len(value) > 1 and np.all(np.diag(value) > 0.0):
            lopsided = value.copy()
            lopsided[0, 1] += 0.01 * np.sqrt(value[0, 0] * value[1, 1])
            wrongs, words = [value[::-1], -value, lopsided], ""
        elif np.ndim(value) == 0 and (kind.fixed or path in INDICES):
            wrongs, words = [1e9, -1e9, -2.0, 0.25], "as the arguments" if kind.fixed else "a whole number"
        else:
            continue
        holder, name = named[path]
        kept = holder[name]
        for wrong in wrongs:
            holder[name] = np.asarray(wrong).tolist()
            refused(f"state: {path} must be {words}")
        holder[name] = kept
    assert from_dict(data).to_dict() == data

    # Numbers anywhere, at random.
    for _ in range(60):
        changed = copy.deepcopy(data)
        among = places(changed[str(rng.choice(["state", "arguments"]))])
        path, holder, key = among[rng.integers(len(among))]
        value = holder[key]
        holder[key] = ODD[rng.integers(len(ODD))]
        if isinstance(value, float) and rng.random() < 0.5:
            holder[key] = value * float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-30.0, 30.0))
        try:
            resumed = from_dict(changed)
        except ValueError:
            continue
        used(resumed, 60)
        assert np.all(np.isfinite(resumed.theta)), path
        assert resumed.model.is_admissible, path
