"""Runs on recorded logs: an estimator learns from the first part, and its model predicts the rest.

The model sees nothing but the voltage, from the first sample on. What it misses of the displacement after the
part that was learnt from is its error, beside that of the straight line that fits the learnt part best.
"""

import functools
import hashlib
import math
from glob import glob
from pathlib import Path
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.estimators import candidate
from piezoest.bench.metrics import DIVERGED
from piezoest.identification.data import Data, prepare
from piezoest.models import ColemanHodgdon, Model
from piezoest.records import read_record
from piezoest.tracking import feed

LOG = "log:"  # before a file's name, in the place of a scenario's
LEARNT = 0.7  # of the samples
AT_A_TIME = 1000  # samples, so that no estimator keeps its history of the whole
SEGMENTS = 10  # of the rest, the largest error of each of which is taken


def logs_of(pattern: str) -> list[str]:
    """Names that stand for recorded logs: those of a file, a folder, or a pattern like ``fleet/*.csv``."""
    files = sorted(glob(f"{pattern}/*.csv" if Path(pattern).is_dir() else pattern, recursive=True))
    if not files:
        raise FileNotFoundError(f"no log is found at {pattern}")
    return [LOG + file for file in files]


def file_of(scenario: str) -> Path | None:
    """File of a scenario that is a recorded log; None of any other."""
    return Path(scenario.removeprefix(LOG)) if scenario.startswith(LOG) else None


@functools.lru_cache(maxsize=4096)
def digest(path: Path) -> str:
    """Fingerprint of a log's content."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def numbers(path: Path, estimator: str | None) -> dict[str, Any]:
    """Numbers of an estimator, or of the straight line (None), on a log: it has no change to settle after."""
    data, sample_rate = _read(path)
    learnt = round(LEARNT * data.u.size)
    first = prepare(data.u[:learnt], data.measured[:learnt])
    if first.extent == 0.0 or not np.any(first.counts) or not np.any(data.counts[learnt:]):
        raise ValueError(f"{path}: there is nothing to learn from, or nothing to predict")
    error = line_error = _missed(first.line, data, learnt)
    if estimator is not None:
        error = _missed(_learn(estimator, first, sample_rate), data, learnt)
    largest = [float(np.max(segment)) for segment in np.array_split(error, min(SEGMENTS, error.size))]
    settled = float(np.max(error))
    return {
        "amplitude": 0.5 * float(np.ptp(data.x[data.counts])),
        "period": error.size / SEGMENTS / sample_rate,
        "first": largest[0],
        "worst": settled,
        "typical": math.exp(float(np.mean(np.log(np.maximum(largest, 1e-300))))),
        "settled": settled,
        "settled_rms": float(np.sqrt(np.mean(error**2))),
        "diverged": not settled <= DIVERGED * float(np.max(line_error)),
        "errors": largest,
    }


@functools.lru_cache(maxsize=1)
def _read(path: Path) -> tuple[Data, float]:
    record = read_record(path)
    return prepare(record.voltage, record.displacement), record.sample_rate


def _learn(estimator: str, data: Data, sample_rate: float) -> Model:
    """Model of an estimator after the part to learn from; it starts from a plain guess about the line."""
    made = candidate(estimator)(sample_rate, data.loop_about_line)
    if hasattr(made, "learn"):
        raise ValueError(f"{estimator} drives a stage: on a log only an estimator can learn")
    x = data.measured
    for begins in range(0, data.u.size, AT_A_TIME):
        block = slice(begins, begins + AT_A_TIME)
        feed(made, data.u[block], x[block])
    return made.model


def _missed(model: Any, data: Data, learnt: int) -> FloatArray:
    """What a model misses of the displacement after the learnt part, at the samples that have one.

    The gauge's zero is no matter of hysteresis: the mean error of the learnt part is taken off.
    """
    # A log may begin anywhere, and have gaps.
    jumps = {"allow_jumps": True} if isinstance(model, ColemanHodgdon) else {}
    error = data.x - model.simulate(data.u, **jumps)
    before = error[:learnt][data.counts[:learnt]]
    return np.abs(error[learnt:][data.counts[learnt:]] - np.mean(before))
