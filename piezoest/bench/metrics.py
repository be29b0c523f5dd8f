"""What a run of a scenario comes down to: how soon it settles, its errors, and whether it diverged."""

from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.cases import Case
from piezoest.tracking import TrackingRecord

SETTLED = 0.012  # of the amplitude: the level at which the paper's own method settles
LEAST_SETTLED = 5  # periods of which a settled error is taken, at least
DIVERGED = 1.5  # times linear feed-forward's error


def measure(record: TrackingRecord, linear: TrackingRecord, case: Case) -> dict[str, Any]:
    """Numbers of a run, from the change on; errors in µm.

    ``errors``: largest error of each period. ``settles``: periods until every further one is below 1.2 % of
    the amplitude, None if the last one is not. ``first``, ``worst``, ``typical``: the first of the errors,
    the largest one, and their geometric mean. ``settled``: largest error of the last half of the periods, of
    at least five. ``diverged``: whether the largest error after the run's first period exceeds one and a half
    times that of linear feed-forward.
    """
    error = np.abs(record.error)
    # First samples of the whole periods from the change on, and the end of the last.
    most = int((error.size - case.change) / case.period) + 2
    edges = np.rint(case.change + case.period * np.arange(most)).astype(np.int64)
    edges = edges[edges <= error.size]
    periods = edges.size - 1
    if periods <= LEAST_SETTLED:
        raise ValueError(
            f"{max(periods, 0)} periods after the change are too few: a settled error takes {LEAST_SETTLED} "
            "after those in which the run settles"
        )
    errors = np.maximum.reduceat(error[: edges[-1]], edges[:-1])
    tail = slice(int(edges[-1 - max(LEAST_SETTLED, periods // 2)]), int(edges[-1]))
    begins = round(case.period)  # the first period is a start from wrong parameters
    ours, theirs = float(np.max(error[begins:])), float(np.max(np.abs(linear.error)[begins:]))
    with np.errstate(divide="ignore"):
        typical = float(np.exp(np.mean(np.log(errors))))
    return {
        "settles": settles(errors, SETTLED * case.amplitude),
        "first": float(errors[0]),
        "worst": float(np.max(error[case.change :])),
        "typical": typical,
        "settled": float(np.max(error[tail])),
        "settled_rms": float(np.sqrt(np.mean(error[tail] ** 2))),
        "diverged": not ours <= DIVERGED * theirs,  # written so that NaN diverges
        "errors": errors.tolist(),
    }


def settles(errors: FloatArray, level: float) -> int | None:
    """Periods until every further error is below a level; None if the last one is not."""
    above = np.flatnonzero(~(errors < level))
    if above.size == 0:
        return 0
    periods = int(above[-1]) + 1
    return periods if periods < errors.size else None
