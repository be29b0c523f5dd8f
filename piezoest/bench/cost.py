"""What an estimator costs: times per sample, alone on a recorded voltage and displacement, and its size."""

import math
import pickle
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.tracking import TrackingRecord

# One timed pass takes about so long: where a whole record takes longer, its beginning is timed.
PASS_SECONDS, PASSES, LEAST_SAMPLES = 0.4, 3, 200


def cost(new: Callable[[], Any], record: TrackingRecord) -> dict[str, float | None]:
    """Take the times of an estimator or controller, one after the other in this process.

    `record`: what is given to it, sample by sample. Returns ``step_us``: one sample by `step` from Python;
    ``run_us``: the same of a whole record at once, None without `run`; medians of three passes.
    ``longest_us``: the longest `step`. ``bytes``: pickled, after the record.
    """
    rows = list(zip(*(values.tolist() for values in _given(new(), record)), strict=True))
    trial = rows[: max(LEAST_SAMPLES, len(rows) // 10)]
    _steps(new(), trial)  # loads what is compiled
    seconds = _steps(new(), trial)
    rows = rows[: max(len(trial), math.ceil(len(trial) * PASS_SECONDS / max(seconds, 1e-9)))]
    u, x = record.voltage[: len(rows)], record.measured[: len(rows)]
    step = float(np.median([_steps(new(), rows) for _ in range(PASSES)]))
    made = new()
    has_run = hasattr(made, "run") and not hasattr(made, "learn")
    run = float(np.median([_run(new(), u, x) for _ in range(PASSES + 1)][1:])) if has_run else None
    used = new()
    _steps(used, rows)
    return {
        "step_us": 1e6 * step / len(rows),
        "run_us": None if run is None else 1e6 * run / len(rows),
        "longest_us": 1e6 * _longest(new, rows),
        "bytes": _size(used),
    }


def _given(made: Any, record: TrackingRecord) -> tuple[FloatArray, ...]:
    """Columns of what a step is given: a controller has the reference as well."""
    if hasattr(made, "learn"):
        return record.reference, record.voltage, record.measured
    return record.voltage, record.measured


def _one(made: Any) -> Callable[..., None]:
    """A step of it: a controller answers, and learns from what was recorded."""
    if not hasattr(made, "learn"):
        return made.step

    def both(r: float, u: float, x: float) -> None:
        made.step(r)
        made.learn(u, x)

    return both


def _steps(made: Any, rows: list[tuple[float, ...]]) -> float:
    """Time of a loop of steps, with the model asked for at its end."""
    one = _one(made)
    began = time.perf_counter()
    for row in rows:
        one(*row)
    _ = made.model
    return time.perf_counter() - began


def _run(made: Any, u: FloatArray, x: FloatArray) -> float:
    began = time.perf_counter()
    made.run(u, x)
    _ = made.model
    return time.perf_counter() - began


def _longest(new: Callable[[], Any], rows: list[tuple[float, ...]]) -> float:
    """Longest step [s]: each counts with the shorter of its times in two passes, free of interruptions."""
    clock = time.perf_counter
    times = np.empty((2, len(rows)))
    for taken in times:
        one = _one(new())
        for k, row in enumerate(rows):
            began = clock()
            one(*row)
            taken[k] = clock() - began
    return float(times.min(axis=0).max())


def _size(made: Any) -> int | None:
    try:
        return len(pickle.dumps(made))
    except Exception:
        return None
