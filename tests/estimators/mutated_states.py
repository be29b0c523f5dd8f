"""Saved estimators, changed at random, are refused in words or work: run by `test_saved_states`.

A process of its own, for what an unchecked number does is to end it. Call with: how many dictionaries, seed.
"""

from __future__ import annotations

import copy
import json
import math
import sys
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

import piezoest as pz
from piezoest import policies as p

RATE = 2000.0
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
LINE = pz.LinearGain(0.1)
OUTLIERS = (p.DeadZone(), p.OutlierRejection(warm_up=20))
RLS: tuple[dict[str, Any], ...] = (
    {},
    {"delay": 7.3},
    {"initial_model": LINE, "offset": True},
    {"memory": 0.4, "errors": False},
    {"time_base": "continuous", "high_pass": 1.0},
    {"policies": (p.RandomWalk(), p.DeadZone(), p.AmplitudeMemory(places=3)), "delay": 2.0},
    {"policies": (p.RandomWalk(), p.Projection(), p.ChangeDetection(), p.ExcitationGate())},
    {"policies": (p.DirectionalForgetting(), *OUTLIERS)},
    {"policies": (p.VariableForgetting(memory=0.3, unit="second"), *OUTLIERS)},
    {"policies": (p.NormBound(), p.CovarianceResetting(0.01), p.Normalisation()), "memory": 0.4},
    {"memory": None, "policies": ()},
)
DAMPER, CREEP = pz.models.MassSpringDamper(700.0, 0.02), pz.models.Creep([0.01], [0.1])
WINDOW = {"window": 0.05, "hop": 0.02}
# How often each is changed: the slow ones seldom.
KINDS: tuple[tuple[int, Any, dict[str, Any]], ...] = (
    *((100, pz.HysteresisRLS, options) for options in RLS),
    (100, pz.OutputErrorRLS, {"members": 9, "delay": 3.0}),
    (100, pz.HysteresisEKF, {"offset": True, "delay": 4.0}),
    (100, pz.HysteresisEKF, {"initial_model": LINE}),
    (10, pz.PrandtlIshlinskiiRLS, {"thresholds": 5, "bends": 1, "delay": 2.0, "mechanics": DAMPER}),
    (10, pz.PrandtlIshlinskiiRLS, {"initial_model": LINE}),
    (10, pz.FilterPyEKF, {"delay": 2.0}),
    (1, pz.FilterPyUKF, {"initial_model": LINE, "offset": True}),
    (1, pz.BatchFit, {"offset": True, "creep": CREEP, "hop": 0.02, "loss": "huber"}),
    (1, pz.MovingHorizon, WINDOW | {"offset": True, "initial_model": LINE}),
)
ODD: tuple[Any, ...] = (
    "7", "text", "", None, math.nan, math.inf, -math.inf, [], [1.0], [[1.0], [2.0, 3.0]], {}, {"a": 1}, True,
    False, 10**400, 2**63, -(2**70), 1e9, -1.0, 0.0, 0.5, 3, 1e308, 5e-324, 1e15, -7, b"3", 1j, "missing",
)  # fmt: skip
Place = tuple[Any, Any]


def record(samples: int) -> tuple[Any, Any]:
    u = pz.signals.triangle(33.0, 20.0, samples * 20.0 / RATE, RATE).values[:samples]
    x = TRUE.simulate(u) + 1e-3 * np.random.default_rng(0).standard_normal(u.size)
    x[17], u[23] = np.nan, np.nan
    return u, x


def saved(kind: Any, options: dict[str, Any]) -> list[dict[str, Any]]:
    """Dictionaries from before, early in and late in a record."""
    u, x = record(500)
    estimator = kind(RATE, **options)
    found = [estimator.to_dict()]
    for part in (slice(0, 30), slice(30, 500)):
        estimator.run(u[part], x[part])
        found.append(estimator.to_dict())
    estimator.predict(1.0)
    return [*found, estimator.to_dict()]


def places(holder: Any) -> Iterator[Place]:
    """(dictionary or list, key) of every entry within, at any depth."""
    for key in list(holder) if isinstance(holder, dict) else range(len(holder)):
        yield holder, key
        if isinstance(holder[key], dict | list):
            yield from places(holder[key])


def shape_of(value: Any) -> Any:
    """Shape of a number, of nested lists, as far as it goes, or of a dictionary."""
    if isinstance(value, dict):
        return "dictionary"
    return (len(value), *shape_of(value[0])) if isinstance(value, list) and value else ()


def change(rng: np.random.Generator, section: Any) -> None:
    """Another value, size, name, shape or place for one entry; or none, or one more."""
    among = list(places(section))
    if not among:
        return
    # Most numbers stand in lists, most of what is checked beside them.
    plain = [place for place in among if isinstance(place[0], dict)]
    chosen = plain if plain and rng.random() < 0.6 else among
    holder, key = chosen[int(rng.integers(len(chosen)))]
    value, what = holder[key], rng.random()
    if what < 0.4:
        holder[key] = ODD[rng.integers(len(ODD))]
    elif what < 0.6 and isinstance(value, float):
        holder[key] = value * float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-30.0, 30.0))
    elif what < 0.8:
        same = [place for place in among if shape_of(place[0][place[1]]) == shape_of(value)]
        other, k = same[rng.integers(len(same))]
        holder[key], other[k] = copy.deepcopy(other[k]), copy.deepcopy(value)
    elif what < 0.9:
        lists = (value[1:], value + value, value[::-1]) if isinstance(value, list) else ([value],)
        holder[key] = [*lists, [value, value]][rng.integers(len(lists) + 1)]
    elif isinstance(holder, dict):
        holder.pop(key)
        if rng.random() < 0.5:
            holder[str(rng.choice([f"{key}_", "theta", "gain", "no_such_key"]))] = value
    else:
        holder.append(value)


def changed(rng: np.random.Generator, data: dict[str, Any]) -> Any:
    """A dictionary changed once or twice."""
    data = copy.deepcopy(data)
    for _ in range(rng.integers(1, 3)):
        section = str(rng.choice(["state", "state", "arguments", "whole"]))
        inner = data.get(section, data)
        change(rng, inner if isinstance(inner, dict) else data)
    return data


def check_use(estimator: Any) -> None:
    """Everything works, and all that comes out is finite."""
    u, x = record(60)
    for stage in range(3):
        assert np.all(np.isfinite(estimator.theta)), f"theta {estimator.theta} in stage {stage}"
        model = estimator.model
        assert np.all(np.isfinite(model.theta)), f"model {model} in stage {stage}"
        assert model.is_admissible, f"model {model} in stage {stage}"
        assert estimator.status.samples >= 0
        json.dumps(estimator.copy().to_dict(), allow_nan=False)
        if stage == 0:
            estimator.step(0.3, 0.02)
            estimator.predict(0.5)
            estimator.update(None)
        elif stage == 1:
            estimator.run(u, x)


def fate(kind: Any, data: Any, as_saved: bool = False) -> str | None:
    """What is wrong with how a dictionary is taken; None if nothing is. One as saved is not refused."""
    try:
        estimator = kind.from_dict(data)
    except ValueError as error:
        return f"refused: {error}" if as_saved or not str(error) else None
    except Exception as error:
        return f"from_dict: {error!r}"
    try:
        check_use(estimator)
    except Exception as error:
        return f"use: {error!r}"
    return None


def main(count: int, seed: int) -> int:
    """Change so many dictionaries; returns how many were taken wrongly."""
    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    dictionaries = [saved(kind, options) for _, kind, options in KINDS]
    for (_, kind, _), each in zip(KINDS, dictionaries, strict=True):
        for data in each:
            assert fate(kind, json.loads(json.dumps(data, allow_nan=False)), as_saved=True) is None
    weights = np.array([often for often, _, _ in KINDS], dtype=np.float64)
    failures = 0
    for case in range(count):
        rng = np.random.default_rng([seed, case])
        # Each kind once, then the quick ones more often.
        k = case if case < len(KINDS) else int(rng.choice(len(KINDS), p=weights / weights.sum()))
        data = changed(rng, dictionaries[k][rng.integers(len(dictionaries[k]))])
        wrong = fate(KINDS[k][1], data)
        if wrong is not None and failures < 20:
            failures += 1
            print(f"case {case} of seed {seed}, {KINDS[k][1].__name__} ({k}): {wrong}", flush=True)
    print(f"{failures} of {count} dictionaries taken wrongly", flush=True)
    return failures


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:])) > 0)
