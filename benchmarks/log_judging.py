"""Fits of one log: piezoest's, and some in plain NumPy beside it; and how far each is from the stage.

All of them learn from the first part of a log, and are judged on the rest: against what the gauge would
have shown there without noise and spikes, at the level to which its jumps had brought it by the end of the
first part. Jumps that come later, which nobody can know, are left out; creep and drift are not, for the stage
does that.
"""

import contextlib
import time
import warnings
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import nnls

import piezoest as pz
from piezoest.bench.zoo.logs import Log, draw
from piezoest.models import ColemanHodgdon

TRAIN = 0.5
PLAYS = 20
MOVES = 0.01  # of the voltage's range: plays that move less in the fitted part are left out
NEGLIGIBLE = 0.1  # of the noise: smaller errors count as equal, for nobody can see them in a log
FAILED = 400  # characters of what an error says
FAMILY = "coleman-hodgdon"  # whose parameters are known, and have standard errors

Row = dict[str, Any]


@dataclass
class Found:
    """What a fit says of a log: predictions [µm], shape (N,), by the names of its candidates."""

    chosen: str
    predictions: dict[str, np.ndarray]
    held_out: dict[str, float]  # its own account of them [µm rms]
    lower: np.ndarray
    upper: np.ndarray
    errors: dict[str, float] = field(default_factory=dict)  # standard errors of a Coleman-Hodgdon model
    theta: np.ndarray | None = None


def fitted(log: Log) -> Found:
    """The one place that knows piezoest's face."""
    identify = partial(pz.identify, log.u, log.x, sample_rate=log.sample_rate, train=TRAIN)
    found = identify()
    predicted = found.predict()
    result = Found(
        found.chosen, {item.name: item.prediction.x for item in found.candidates},
        {item.name: item.held_out.rms for item in found.candidates}, predicted.lower, predicted.upper,
    )  # fmt: skip
    if log.family == FAMILY:
        # A log may leave a parameter open, which identify then refuses.
        with contextlib.suppress(ValueError):
            of = found if isinstance(found.model, ColemanHodgdon) else identify(model=FAMILY)
            result.theta, result.errors = np.array(of.model.theta), dict(of.standard_errors)
    return result


def plays(u: np.ndarray, thresholds: np.ndarray) -> np.ndarray:
    """Voltages behind plays that begin at the first voltage, shape (N, thresholds)."""
    y = np.empty((u.size, thresholds.size))
    last = np.full(thresholds.size, u[0])
    for k, now in enumerate(u):
        last = np.clip(last, now - thresholds, now + thresholds)
        y[k] = last
    return y


def by_plays(u: np.ndarray, x: np.ndarray, trained: int) -> np.ndarray:
    """Prediction of a gain, 20 plays and an offset, by non-negative least squares; no delay, no spikes.

    Thresholds are even up to half of the fitted voltage's range. Of plays that hardly move there nothing is
    known, and any weight would fit.
    """
    thresholds = 0.5 * np.ptp(u[:trained]) * np.arange(PLAYS + 1) / PLAYS
    known = np.flatnonzero(np.isfinite(x[:trained]))
    y = plays(u, thresholds)
    size = np.ptp(u[:trained])
    y = y[:, np.ptp(y[known], axis=0) > MOVES * size]
    middle = y[known].mean(axis=0)
    # An offset of either sign takes two columns; of one size with the others, or it is found badly.
    columns = np.column_stack((y - middle, np.full(u.size, size), np.full(u.size, -size)))
    weights, _ = nnls(columns[known], x[known])
    return columns @ weights


def by_line(u: np.ndarray, x: np.ndarray, trained: int) -> np.ndarray:
    """Prediction of a straight line, by least squares."""
    known = np.flatnonzero(np.isfinite(x[:trained]))
    return np.polyval(np.polyfit(u[known], x[known], 1), u)


def bridged(u: np.ndarray) -> np.ndarray:
    """Voltage with straight lines over its gaps."""
    known, index = np.isfinite(u), np.arange(u.size)
    return np.interp(index, index[known], u[known])


def expected(log: Log, trained: int) -> np.ndarray:
    """What a prediction is judged against, after the fitted part [µm], shape (N - trained,)."""
    return log.truth[trained:] + log.jumps[trained - 1]


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def coverage(log: Log, trained: int, lower: np.ndarray, upper: np.ndarray) -> float:
    """Part of the later readings that lie within an interval; spikes, gaps and later jumps do not count."""
    later = log.jumps[trained:] - log.jumps[trained - 1]
    x = log.x[trained:] - later
    counts = np.isfinite(x) & ~log.spikes[trained:]
    inside = (x >= lower[trained:]) & (x <= upper[trained:])
    return float(np.mean(inside[counts]))


def judge(seed: int) -> Row:
    """Row of a log: what it is, and errors [µm] of every fit."""
    log = draw(seed)
    trained = round(TRAIN * log.u.size)
    target, u = expected(log, trained), bridged(log.u)
    row: Row = {
        "seed": seed, "family": log.family, "voltage": log.voltage, "samples": log.u.size,
        "sample_rate": log.sample_rate, "stroke": log.stroke, "noise": log.noise, "added": log.added,
        "nnls": rms(by_plays(u, log.x, trained)[trained:] - target),
        "line": rms(by_line(u, log.x, trained)[trained:] - target), "failure": None, "seconds": None,
    }  # fmt: skip
    began = time.perf_counter()
    # Warnings of numbers are not the judge's matter; what comes out is.
    with warnings.catch_warnings(action="ignore"), np.errstate(all="ignore"):
        try:
            found = fitted(log)
            row["seconds"] = time.perf_counter() - began
            row |= judged(log, trained, found)
            row |= ratios(row)
        except Exception as error:
            row["failure"] = f"{type(error).__name__}: {error}"[:FAILED]
    return row


def judged(log: Log, trained: int, found: Found) -> Row:
    """Errors of what was chosen and of the best candidate in hindsight, and what it promised.

    A candidate is best whose own held-out error is the least; it is then judged as the others are.
    """
    # Some predict only what was read.
    read = np.isfinite(log.x[trained:])
    missed = {name: (x[trained:] - expected(log, trained))[read] for name, x in found.predictions.items()}
    if not np.isfinite(missed[found.chosen]).all():
        raise ValueError("the prediction is not finite")
    best = min(found.held_out, key=found.held_out.__getitem__)
    row: Row = {
        "chosen": rms(missed[found.chosen]), "chosen_name": found.chosen, "best_name": best,
        "best": min(rms(missed[name]) for name in (found.chosen, best)), "own": found.held_out[found.chosen],
        "coverage": coverage(log, trained, found.lower, found.upper),
    }  # fmt: skip
    if log.family == FAMILY and found.theta is not None:
        row["z"] = scores(log, found)
    return row


def ratios(row: Row) -> Row:
    """The error relative to others', to the stroke and to the noise.

    What is far below the noise counts as equal. `regret` is that to the best of all that is known.
    """
    floor = NEGLIGIBLE * row["noise"]
    of = {name: max(row["chosen"], floor) / max(row[name], floor) for name in ("best", "nnls", "line")}
    sizes = {name: row["chosen"] / row[name] for name in ("stroke", "noise")}
    return {"ratio": of | sizes, "regret": max(of.values())}


def scores(log: Log, found: Found) -> list[float | None]:
    """Errors of a Coleman-Hodgdon model's parameters by their standard errors."""
    sizes = [found.errors[name] for name in ColemanHodgdon.parameter_names]
    off = found.theta - np.array(log.model.theta)
    # A standard error of zero belongs to a value on the edge of what is allowed.
    return [float(a / b) if b > 0.0 else None for a, b in zip(off, sizes, strict=True)]


def clean_scores(seed: int) -> Row:
    """Scores of a Coleman-Hodgdon stage to whose log nothing is added that the model lacks."""
    log = draw(seed, family=FAMILY, clean=True)
    row: Row = {"seed": seed, "z": None}
    with contextlib.suppress(Exception), warnings.catch_warnings(action="ignore"), np.errstate(all="ignore"):
        row["z"] = scores(log, fitted(log))
    return row
