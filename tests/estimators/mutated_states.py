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
from piezoest import policies

RATE = 2000.0
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
LINE = pz.LinearGain(0.1)
OFTEN, NOW_AND_THEN, SELDOM = 100, 10, 1


def configurations() -> Iterator[tuple[int, Any]]:
    """How often each is changed, and a new estimator."""
    rls = pz.HysteresisRLS
    walk, zone = policies.RandomWalk(), policies.DeadZone()
    yield OFTEN, rls(RATE)
    yield OFTEN, rls(RATE, delay=7.3)
    yield OFTEN, rls(RATE, initial_model=LINE, delay=1.0)
    yield OFTEN, rls(RATE, initial_model=LINE, offset=True)
    yield OFTEN, rls(RATE, memory=0.4, errors=False)
    yield OFTEN, rls(RATE, time_base="continuous", high_pass=1.0)
    yield OFTEN, rls(RATE, policies=(walk, zone, policies.AmplitudeMemory(places=3)), delay=2.0)
    switched = (policies.Projection(), policies.ChangeDetection(), policies.ExcitationGate())
    yield OFTEN, rls(RATE, policies=(walk, *switched))
    for policy in (
        policies.DirectionalForgetting(),
        policies.VariableForgetting(),
        policies.VariableForgetting(memory=0.3, unit="second"),
        policies.PeriodicForgetting(),
    ):
        yield OFTEN, rls(RATE, policies=(policy, zone, policies.OutlierRejection(warm_up=20)))
    bound = (policies.NormBound(), policies.CovarianceResetting(0.01), policies.Normalisation())
    yield OFTEN, rls(RATE, memory=0.4, policies=bound)
    yield OFTEN, rls(RATE, memory=None, policies=())
    yield OFTEN, pz.OutputErrorRLS(RATE, members=9)
    yield OFTEN, pz.OutputErrorRLS(RATE, members=9, delay=3.0)
    yield OFTEN, pz.HysteresisEKF(RATE)
    yield OFTEN, pz.HysteresisEKF(RATE, offset=True, delay=4.0)
    yield OFTEN, pz.HysteresisEKF(RATE, project=False)
    yield OFTEN, pz.HysteresisEKF(RATE, initial_model=LINE)
    plays = pz.PrandtlIshlinskiiRLS
    damper = pz.models.MassSpringDamper(700.0, 0.02)
    yield NOW_AND_THEN, plays(RATE, thresholds=4, bends=1, delay=2.0)
    yield NOW_AND_THEN, plays(RATE, thresholds=5, voltage_range=(-50.0, 50.0), mechanics=damper)
    yield NOW_AND_THEN, plays(RATE, initial_model=LINE)
    yield NOW_AND_THEN, pz.FilterPyEKF(RATE, delay=2.0)
    yield SELDOM, pz.FilterPyUKF(RATE)
    yield SELDOM, pz.FilterPyUKF(RATE, initial_model=LINE, offset=True)
    yield SELDOM, pz.BatchFit(RATE)
    yield SELDOM, pz.BatchFit(RATE, offset=True, creep=pz.models.Creep([0.01], [0.1]), hop=0.02, loss="huber")
    yield SELDOM, pz.MovingHorizon(RATE, window=0.05, hop=0.02)
    yield SELDOM, pz.MovingHorizon(RATE, window=0.05, hop=0.02, offset=True, initial_model=LINE)


def record(samples: int) -> tuple[Any, Any]:
    u = pz.signals.triangle(33.0, 20.0, samples * 20.0 / RATE, RATE).values[:samples]
    x = TRUE.simulate(u) + 1e-3 * np.random.default_rng(0).standard_normal(u.size)
    x[17], u[23] = np.nan, np.nan
    return u, x


def saved() -> list[tuple[int, Any, list[dict[str, Any]]]]:
    """How often, class, and dictionaries from before, early in and late in a record."""
    u, x = record(500)
    found = []
    for often, estimator in configurations():
        dictionaries = [estimator.to_dict()]
        for part in (slice(0, 30), slice(30, 500)):
            estimator.run(u[part], x[part])
            if part.stop == 500:
                estimator.predict(1.0)
            dictionaries.append(estimator.to_dict())
        found.append((often, type(estimator), dictionaries))
    return found


def odd_value(rng: np.random.Generator) -> Any:
    """What no dictionary of numbers should hold, and what it may."""
    odd: tuple[Any, ...] = (
        "7", "text", "", None, math.nan, math.inf, -math.inf, [], [1.0], [[1.0], [2.0, 3.0]], {}, {"a": 1},
        True, False, 10**400, 2**63, -(2**70), 1e9, -1.0, 0.0, 0.5, 3, 1e308, -1e308, 5e-324, 1e-300, 1e15,
        1e3, -7, 1e6, b"3", 1j, "missing", "period",
    )  # fmt: skip
    if rng.random() < 0.7:
        return odd[rng.integers(len(odd))]
    return float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-30.0, 30.0))


def containers(data: Any) -> list[Any]:
    """All dictionaries and lists within the arguments, themselves too."""
    found = [data]
    for inner in data.values() if isinstance(data, dict) else data:
        if isinstance(inner, dict | list):
            found += containers(inner)
    return found


def change_entry(rng: np.random.Generator, holder: Any) -> None:
    """Change, drop or add one entry of a dictionary or a list."""
    keys = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
    what = rng.random()
    if keys and what < 0.8:
        holder[keys[rng.integers(len(keys))]] = odd_value(rng)
    elif keys and what < 0.9:
        del holder[keys[rng.integers(len(keys))]]
    elif isinstance(holder, dict):
        holder[str(rng.choice(["no_such_key", "gain", "memory", "delay"]))] = odd_value(rng)
    else:
        holder.append(odd_value(rng))


Place = tuple[Any, Any]


def places(holder: Any) -> list[Place]:
    """(dictionary or list, key) of every entry within, at any depth."""
    found: list[Place] = []
    for key in list(holder) if isinstance(holder, dict) else range(len(holder)):
        found.append((holder, key))
        if isinstance(holder[key], dict | list):
            found += places(holder[key])
    return found


def drawn(rng: np.random.Generator, among: list[Place]) -> Place:
    """One of them."""
    return among[int(rng.integers(len(among)))]


def shape_of(value: Any) -> tuple[int, ...]:
    """Shape of a number or of nested lists, as far as it goes."""
    return (len(value), *shape_of(value[0])) if isinstance(value, list) and value else ()


def change_state(rng: np.random.Generator, state: dict[str, Any]) -> None:
    """Change a number or a few, exchange what has one shape, drop, add, rename, or give another shape."""
    everywhere, what = places(state), rng.random()
    single = [(holder, key) for holder, key in everywhere if not isinstance(holder[key], dict | list)]
    if not single:
        return
    if what < 0.5:
        for _ in range(rng.integers(1, 4)):
            holder, key = drawn(rng, single)
            holder[key] = odd_value(rng)
    elif what < 0.65:
        holder, key = drawn(rng, single)
        if isinstance(holder[key], float):
            holder[key] *= float(10.0 ** rng.uniform(-12.0, 12.0)) * float(rng.choice([-1.0, 1.0]))
    elif what < 0.85:
        one, key = drawn(rng, everywhere)
        shape = shape_of(one[key])
        same = [
            (holder, k) for holder, k in everywhere
            if shape_of(holder[k]) == shape and isinstance(holder[k], dict) == isinstance(one[key], dict)
        ]  # fmt: skip
        other, k = drawn(rng, same)
        one[key], other[k] = copy.deepcopy(other[k]), copy.deepcopy(one[key])
    elif what < 0.95:
        named = [(holder, key) for holder, key in everywhere if isinstance(holder, dict)]
        holder, key = drawn(rng, named)
        value = holder.pop(key)
        if rng.random() < 0.5:
            name = str(rng.choice([key + "_", "theta", "P", "no_such_key", key.upper()]))
            holder[name] = value
    else:
        change_shape(rng, *drawn(rng, everywhere))


def change_shape(rng: np.random.Generator, holder: Any, key: Any) -> None:
    """Another shape for what is there."""
    value = holder[key]
    flat: Any = [value, value]
    if isinstance(value, list):
        flat = (value[1:], value + value, [value], value[::-1], value[0] if value else 0.0)[rng.integers(5)]
    elif rng.random() < 0.5:
        flat = [value]
    holder[key] = flat


def changed(rng: np.random.Generator, data: dict[str, Any]) -> Any:
    """A dictionary changed once or twice."""
    data = copy.deepcopy(data)
    for _ in range(rng.integers(1, 3)):
        what = rng.random()
        if what < 0.55 and isinstance(data.get("state"), dict):
            change_state(rng, data["state"])
        elif what < 0.85 and isinstance(data.get("arguments"), dict):
            holders = containers(data["arguments"])
            change_entry(rng, holders[rng.integers(len(holders))])
        elif what < 0.9 and isinstance(data.get("u"), list) and data["u"]:
            change_entry(rng, data["u"])
        elif what < 0.99:
            change_entry(rng, data)
        else:
            return odd_value(rng)
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
            for k in range(4):
                estimator.step(float(u[k]), float(x[k]))
        elif stage == 1:
            estimator.run(u, x)


def fate(cls: Any, data: Any, as_saved: bool = False) -> str | None:
    """What is wrong with how a dictionary is taken; None if nothing is. One as saved is not refused."""
    try:
        estimator = cls.from_dict(data)
    except ValueError as error:
        return f"refused: {error}" if as_saved or not str(error) else None
    except Exception as error:
        return f"from_dict: {error!r}"
    try:
        check_use(estimator)
    except Exception as error:
        return f"use: {error!r}"
    return None


def main(count: int, seed: int, first: int = 0) -> int:
    """Change so many dictionaries; returns how many were taken wrongly."""
    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    kinds = saved()
    weights = np.array([often for often, _, _ in kinds], dtype=np.float64)
    failures = 0
    for _, cls, dictionaries in kinds if first == 0 else ():
        for data in dictionaries:
            assert fate(cls, json.loads(json.dumps(data, allow_nan=False)), as_saved=True) is None
    for case in range(first, count):
        rng = np.random.default_rng([seed, case])
        # Each kind once, then the quick ones more often.
        k = case if case < len(kinds) else int(rng.choice(len(kinds), p=weights / weights.sum()))
        _, cls, dictionaries = kinds[k]
        data = changed(rng, dictionaries[rng.integers(len(dictionaries))])
        wrong = fate(cls, data)
        if wrong is not None:
            failures += 1
            print(f"case {case} of seed {seed}, {cls.__name__} (configuration {k}): {wrong}", flush=True)
            if failures == 20:
                break
    print(f"{failures} of {count} dictionaries taken wrongly", flush=True)
    return failures


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:])) > 0)
