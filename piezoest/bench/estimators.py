"""Every estimator in the same ring: what it reaches, how soon, and at what cost."""

from __future__ import annotations

import importlib
import inspect
import math
import os
import pickle
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from piezoest import signals
from piezoest._checks import FloatArray, positive
from piezoest.compensators import InverseCompensator, LinearCompensator
from piezoest.demo import AMPLITUDE, FREQUENCY, SETTLED_PERIODS, WRONG_GAIN, WRONG_MODEL
from piezoest.estimators.base import EstimatorBase
from piezoest.estimators.rls import HysteresisRLS
from piezoest.stage import PaperStage
from piezoest.tracking import TrackingRecord, track

# A fifth of the paper's rate: filterpy's filters take 0.2 and 0.5 ms a sample.
SAMPLE_RATE = 10_000.0  # Hz
SECONDS = 3.0
UPDATE_INTERVAL = 1e-3  # s between two updates of the compensator's model
SETTLED = 0.012  # of the amplitude
REFERENCE = "linear feed-forward"

# What an estimator needs beside its defaults to be of use in the ring; printed and written with the results.
OPTIONS: dict[str, dict[str, Any]] = {
    # Without hop it would fit the whole record anew at every update of the compensator: here as often as
    # MovingHorizon solves. The first period, under the wrong model, is a larger loop than all that follow,
    # and leaves an offset behind.
    "BatchFit": {"hop": 0.1, "offset": True},
    # The same offset, with which a window tells the parameters apart less well: so it forgets more slowly.
    "MovingHorizon": {"process_noise": 0.03, "offset": True},
}

# One timed pass takes about so long: where a whole record takes longer, its beginning is timed.
PASS_SECONDS, PASSES, LEAST_SAMPLES = 0.4, 3, 200


@dataclass(frozen=True, slots=True)
class Scenario:
    """The run that all estimators share.

    Parameters
    ----------
    seconds : float
        Length; at least two periods of the reference.
    sample_rate : float
        [Hz].
    seed : int
        Start of the random numbers of the stage's noise.

    Raises
    ------
    ValueError
        If the run is shorter than the two periods of which the settled error is taken.
    """

    seconds: float = SECONDS
    sample_rate: float = SAMPLE_RATE
    seed: int = 0

    def __post_init__(self) -> None:
        least = SETTLED_PERIODS / FREQUENCY
        if positive("seconds", self.seconds) < least:
            raise ValueError(
                f"seconds must be at least {least:g}, {SETTLED_PERIODS} periods: got {self.seconds:g}"
            )
        positive("sample_rate", self.sample_rate)

    @property
    def reference(self) -> signals.Signal:
        """Smoothed triangle, 5 µm at 5 Hz."""
        return signals.triangle(AMPLITUDE, FREQUENCY, self.seconds * FREQUENCY, self.sample_rate)

    def run(self, estimator: Any, compensator: Any) -> TrackingRecord:
        """Send the reference through the ring, on a stage of its own.

        Parameters
        ----------
        estimator : object with ``step(u, x)`` and ``model``
            New.
        compensator : object with ``step(r)`` and ``model``
            With the model to start from.

        Returns
        -------
        TrackingRecord
        """
        return track(
            self.reference,
            stage=PaperStage(self.sample_rate, seed=self.seed),
            compensator=compensator,
            estimator=estimator,
            update_interval=max(1, round(UPDATE_INTERVAL * self.sample_rate)),
            supervisor=False,  # the estimators are compared, not the guard
        )


@dataclass(frozen=True, slots=True)
class Row:
    """What one estimator made of the scenario.

    Parameters
    ----------
    name : str
        The estimator's, or "linear feed-forward".
    settled_error : float or None
        Largest error over the last two periods [µm].
    settling_periods : int or None
        Periods after which the largest error of each period stays below 1.2 % of the
        amplitude; None if it does not.
    settling_time : float or None
        The same [s].
    run_microseconds, step_microseconds : float or None
        Per sample, of the estimator alone on the recorded (u, x): as one `run` and as a loop of
        `step`; medians of some passes after a warm-up.
    longest_step_microseconds : float or None
        The longest single step.
    memory_bytes : int or None
        Size of the pickled estimator after the run: its state and settings.
    parameters : dict
        Parameters of its model at the end.
    errors : list of float
        Largest error of each period [µm].
    timed_samples : int
        Samples of one timed pass.
    options : dict
        Arguments beside the estimator's defaults.
    failure : str or None
        Why there is nothing to report.
    """

    name: str
    settled_error: float | None = None
    settling_periods: int | None = None
    settling_time: float | None = None
    run_microseconds: float | None = None
    step_microseconds: float | None = None
    longest_step_microseconds: float | None = None
    memory_bytes: int | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    errors: list[float] = field(default_factory=list)
    timed_samples: int = 0
    options: dict[str, Any] = field(default_factory=dict)
    failure: str | None = None


def find_estimators() -> dict[str, type]:
    """Every estimator among the public names of the package, by its name."""
    import piezoest

    public = {name: getattr(piezoest, name) for name in piezoest.__all__}
    return {
        name: value
        for name, value in sorted(public.items())
        if inspect.isclass(value) and issubclass(value, EstimatorBase) and not inspect.isabstract(value)
    }


def load_estimator(path: str) -> type:
    """Class of a user's own estimator.

    Parameters
    ----------
    path : str
        ``module:Class``; the module may lie in the working directory.

    Returns
    -------
    type

    Raises
    ------
    ValueError
        If there is no such class, or it has no ``step`` and ``model``.
    """
    module_name, separator, class_name = path.partition(":")
    if not (module_name and separator and class_name):
        raise ValueError(f"an estimator of one's own must read like module:Class, got {path!r}")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise ValueError(f"{path}: {error}") from None
    found = getattr(module, class_name, None)
    if not inspect.isclass(found):
        raise ValueError(f"{path}: {module_name} has no class {class_name}")
    if missing := [name for name in ("step", "model") if not hasattr(found, name)]:
        raise ValueError(f"{path}: {class_name} has no {' and no '.join(missing)}: see piezoest.Estimator")
    return found


def options_of(cls: type) -> dict[str, Any]:
    """Arguments that the package's own estimators get beside their defaults."""
    own = issubclass(cls, EstimatorBase) and cls.__module__.startswith("piezoest.")
    return dict(OPTIONS.get(cls.__name__, {})) if own else {}


def make(cls: type, sample_rate: float) -> Any:
    """New estimator of a class, from the wrong start where it takes one."""
    accepted = inspect.signature(cls).parameters
    offered = {"sample_rate": sample_rate, "initial_model": WRONG_MODEL, **options_of(cls)}
    return cls(**{name: value for name, value in offered.items() if name in accepted})


def compare(
    estimators: Mapping[str, type], scenario: Scenario, say: Callable[[str], None] = lambda _: None
) -> list[Row]:
    """Send every estimator round the ring; linear feed-forward comes first.

    Parameters
    ----------
    estimators : mapping
        Name to class.
    scenario : Scenario
        The run they share.
    say : callable
        Called with a line before each part of the work.

    Returns
    -------
    list of Row
    """
    rate = scenario.sample_rate
    linear = partial(HysteresisRLS, rate, initial_model=WRONG_GAIN)
    rows = [assess(REFERENCE, linear, LinearCompensator(WRONG_GAIN), scenario, say)]
    for name, cls in estimators.items():
        row = assess(name, partial(make, cls, rate), InverseCompensator(WRONG_MODEL), scenario, say)
        rows.append(replace(row, options=options_of(cls)))
    return rows


def assess(
    name: str, new: Callable[[], Any], compensator: Any, scenario: Scenario, say: Callable[[str], None]
) -> Row:
    """Run and time one estimator; whatever it raises is its own failure."""
    say(f"{name}: in the ring")
    try:
        estimator = new()
        record = scenario.run(estimator, compensator)
        say(f"{name}: timing")
        return Row(name, **accuracy(record), **cost(new, record), memory_bytes=pickled_size(estimator))
    except Exception as error:
        return Row(name, failure=f"{type(error).__name__}: {error}")


def accuracy(record: TrackingRecord) -> dict[str, Any]:
    """Errors of a run, and when they have settled."""
    errors = record.max_error_per_period()
    above = np.flatnonzero(~(errors < SETTLED * AMPLITUDE))
    periods = int(above[-1]) + 1 if above.size else 0
    settled = periods < errors.size
    final = dict(zip(record.parameter_names, record.theta[-1].tolist(), strict=True))
    return {
        "settled_error": record.max_error(SETTLED_PERIODS),
        "settling_periods": periods if settled else None,
        "settling_time": periods / FREQUENCY if settled else None,
        "parameters": final,
        "errors": errors.tolist(),
    }


def cost(new: Callable[[], Any], record: TrackingRecord) -> dict[str, Any]:
    """Times per sample on what was recorded [µs], the longest step, and how many samples were timed."""
    u, x = record.voltage, record.measured
    samples = samples_within(new, u, x)
    u, x = u[:samples], x[:samples]
    u_list, x_list = u.tolist(), x.tolist()
    run = seconds_of_run(new, u, x) if hasattr(new(), "run") else None
    step = median(seconds_of_steps(new, u_list, x_list) for _ in range(PASSES))
    return {
        "run_microseconds": None if run is None else 1e6 * run / samples,
        "step_microseconds": 1e6 * step / samples,
        "longest_step_microseconds": 1e6 * longest_step(new, u_list, x_list),
        "timed_samples": samples,
    }


def samples_within(new: Callable[[], Any], u: FloatArray, x: FloatArray) -> int:
    """Samples that `PASS_SECONDS` suffice for, judged from a beginning that warms up as well."""
    trial = min(u.size, max(LEAST_SAMPLES, u.size // 10))
    seconds = seconds_of_steps(new, u[:trial].tolist(), x[:trial].tolist())
    return max(trial, min(u.size, math.ceil(trial * PASS_SECONDS / max(seconds, 1e-9))))


def seconds_of_run(new: Callable[[], Any], u: FloatArray, x: FloatArray) -> float:
    """Time of one `run`, with the model asked for at its end."""

    def once() -> float:
        estimator = new()
        began = time.perf_counter()
        estimator.run(u, x)
        _ = estimator.model
        return time.perf_counter() - began

    once()
    return median(once() for _ in range(PASSES))


def seconds_of_steps(new: Callable[[], Any], u: list[float], x: list[float]) -> float:
    """Time of a loop of `step`, with the model asked for at its end."""
    estimator = new()
    step = estimator.step
    began = time.perf_counter()
    for u_k, x_k in zip(u, x, strict=True):
        step(u_k, x_k)
    _ = estimator.model
    return time.perf_counter() - began


def longest_step(new: Callable[[], Any], u: list[float], x: list[float]) -> float:
    """Longest step [s]: each counts with the shorter of its times in two passes, free of interruptions."""
    clock = time.perf_counter
    times = np.empty((2, len(u)))
    for row in times:
        step = new().step
        for k, (u_k, x_k) in enumerate(zip(u, x, strict=True)):
            began = clock()
            step(u_k, x_k)
            row[k] = clock() - began
    return float(times.min(axis=0).max())


def median(times: Iterable[float]) -> float:
    """The middle one."""
    return float(np.median(list(times)))


def pickled_size(estimator: Any) -> int | None:
    """Bytes of the pickled estimator; None if it cannot be pickled."""
    try:
        return len(pickle.dumps(estimator))
    except Exception:
        return None
