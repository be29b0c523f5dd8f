"""What an estimator costs: the time of one sample, alone, on a recorded voltage and displacement."""

import math
import time
from collections.abc import Callable
from typing import Any

from piezoest.tracking import TrackingRecord

# One timed pass takes about so long: where a whole record takes longer, its beginning is timed.
PASS_SECONDS, PASSES, LEAST_SAMPLES = 0.4, 9, 200


def step_seconds(new: Callable[[], Any], record: TrackingRecord) -> float:
    """Mean time of one sample by `step` from Python [s], of new estimators or controllers.

    It is that of the fastest pass: the others were disturbed by other programs. A controller answers to the
    reference, and learns from what was recorded.
    """
    columns = (record.reference, record.voltage, record.measured)
    rows = list(zip(*(values.tolist() for values in columns), strict=True))
    trial = rows[: max(LEAST_SAMPLES, len(rows) // 10)]
    _pass(new(), trial)  # loads what is compiled
    seconds = _pass(new(), trial)
    rows = rows[: max(len(trial), math.ceil(len(trial) * PASS_SECONDS / max(seconds, 1e-9)))]
    return min(_pass(new(), rows) for _ in range(PASSES)) / len(rows)


def _pass(made: Any, rows: list[tuple[float, float, float]]) -> float:
    """Time of a loop of steps, with the model asked for at its end."""
    step, learn = made.step, getattr(made, "learn", None)
    began = time.perf_counter()
    if learn is None:
        for _, u, x in rows:
            step(u, x)
    else:
        for r, u, x in rows:
            step(r)
            learn(u, x)
    _ = made.model
    return time.perf_counter() - began
