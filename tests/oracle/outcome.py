"""Public results as named arrays of numbers."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from tests.oracle.records import SCENARIOS, Array

Outcome = dict[str, Array]
Cases = dict[str, Callable[[], Outcome]]

COUNTS = ("samples", "updates", "missing", "held", "resets", "projected", "outliers")
LAST = ("waiting", "updated", "missing", "held", "rejected")
COMPENSATOR_COUNTS = ("samples", "saturated", "slewed", "missing", "projected")
# Public attributes at the end of a record, where the estimator has them.
ATTRIBUTES = ("theta", "y", "S", "K", "standard_errors", "excitation", "s", "thresholds", "decays")
MATRICES = ("P", "state_covariance")
# Samples that are given by `predict` and `update`.
SPLIT = 40


def flat(*values: Any) -> Array:
    """All numbers in one array."""
    arrays = [np.asarray(value, dtype=np.float64).ravel() for value in values]
    return np.concatenate(arrays) if arrays else np.empty(0)


def model_numbers(model: Any) -> Array:
    return flat(model.theta, model.offset)


def status_numbers(status: Any) -> Array:
    return flat([float(getattr(status, name)) for name in COUNTS], LAST.index(status.last))


def compensator_numbers(status: Any) -> Array:
    return flat([float(getattr(status, name)) for name in COMPENSATOR_COUNTS])


def shown(estimator: Any, name: str) -> Any:
    """An attribute; not a number where this estimator does not follow it."""
    try:
        return getattr(estimator, name)
    except ValueError:
        return np.nan


def end(estimator: Any) -> Outcome:
    """All that an estimator shows now."""
    names = [name for name in (*ATTRIBUTES, *MATRICES) if hasattr(type(estimator), name)]
    found = {name: shown(estimator, name) for name in names}
    outcome = {"end": flat(*(found[name] for name in ATTRIBUTES if name in found))}
    outcome |= {f"end.{name}": flat(found[name]) for name in MATRICES if name in found}
    outcome["model"] = model_numbers(estimator.model)
    outcome["status"] = status_numbers(estimator.status)
    return outcome


def stepped(estimator: Any, u: Array, x: Array) -> Outcome:
    """Samples one by one; what is missing comes as None and as NaN in turn."""
    rows: dict[str, list[Array]] = {"step.theta": [], "step.y": [], "step.S": [], "step.K": []}
    nothing = itertools.cycle((None, np.nan))
    for k, (u_k, x_k) in enumerate(zip(u.tolist(), x.tolist(), strict=True)):
        estimator.step(u_k, next(nothing) if np.isnan(x_k) else x_k)
        if k % 5 == 0:
            for name, values in rows.items():
                values.append(flat(getattr(estimator, name.removeprefix("step."))))
    return {name: flat(*values) for name, values in rows.items()}


def observed(estimator: Any, u: Array, x: Array, every: int = 7) -> Outcome:
    """A record by `step`, by `predict` and `update`, and by `run`; then all that the estimator shows."""
    first = u.size // 4
    outcome = stepped(estimator, u[:first], x[:first])
    for k in range(first, first + SPLIT):
        estimator.predict(float(u[k]))
        estimator.update(float(x[k]))
    rest = slice(first + SPLIT, None)
    trace = estimator.run(u[rest], x[rest], every=every, record=("y", "S", "P"))
    outcome |= {name: flat(getattr(trace, name)) for name in ("theta", "y", "S", "P")}
    return outcome | end(estimator)


def on(
    make: Callable[[], Any], scenario: str, every: int = 7, length: int | None = None
) -> Callable[[], Outcome]:
    """Case of an estimator and a scenario."""

    def case() -> Outcome:
        u, x = SCENARIOS[scenario]()
        return observed(make(), u[:length], x[:length], every)

    return case
