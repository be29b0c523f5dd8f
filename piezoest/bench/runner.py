"""What a run of the benchmark suite is: scenario, estimator, seed and settings in, a row of numbers out.

`play` is a function of its task alone, whichever process or machine it runs in; only the measured
time differs.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import inspect
import json
import time
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np

from piezoest._checks import FloatArray, integer
from piezoest.bench import recorded
from piezoest.bench.adaptation import follow, json_safe
from piezoest.bench.candidates import candidate
from piezoest.bench.cases import RIGHT_MODEL, Case, Conditions
from piezoest.bench.estimators import REFERENCE, load_estimator
from piezoest.bench.machine import fingerprint
from piezoest.bench.metrics import Metrics, measure
from piezoest.bench.scenarios import SCENARIOS
from piezoest.stage import PaperStage, PreisachStage
from piezoest.tracking import TrackingRecord

Row = dict[str, Any]
Stage = Literal["paper", "preisach"]

STAGES: dict[str, type[PaperStage] | type[PreisachStage]] = {"paper": PaperStage, "preisach": PreisachStage}
WARM_UP = 0.25  # s


@dataclass(frozen=True, slots=True)
class Settings:
    """What all runs of a campaign share.

    Parameters
    ----------
    sample_rate : float
        [Hz]. A tenth of the paper's: filterpy's filters take half a millisecond a sample. What
        settles where hardly depends on it.
    before, after : int
        Periods before a scenario's change, and after it.
    after_long : int
        The same as `after` where an error is taken over several periods of the wave, see
        `piezoest.bench.scenarios.Scenario`.
    rest, drift : float
        Length of the dwell and of the drift [s].
    updates : int
        Updates of the compensator's model in a period of the wave.
    stage : {"paper", "preisach"}
        `PaperStage` or `PreisachStage`.
    guard : bool
        Whether the supervisor of the ring is on.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    sample_rate: float = 5000.0
    before: int = 4
    after: int = 8
    after_long: int = 3
    rest: float = 5.0
    drift: float = 5.0
    updates: int = 50
    stage: Stage = "paper"
    guard: bool = False

    def __post_init__(self) -> None:
        Conditions(**self.conditions("cold-start"))
        integer("after_long", self.after_long, 1)
        if self.stage not in STAGES:
            raise ValueError(f"stage must be one of {', '.join(STAGES)}, got {self.stage!r}")

    def conditions(self, scenario: str) -> dict[str, Any]:
        """Fields of `piezoest.bench.cases.Conditions` for a scenario.

        Parameters
        ----------
        scenario : str
            Name in `SCENARIOS`.
        """
        names = {field.name for field in fields(Conditions)}
        given = {name: value for name, value in asdict(self).items() if name in names}
        return {**given, "after": self.after_long} if SCENARIOS[scenario].is_long else given


# Under a minute with all estimators on two cores.
QUICK = Settings(sample_rate=2000.0, before=2, after=4, after_long=2, rest=0.5, drift=1.5)


@dataclass(frozen=True, slots=True)
class Task:
    """One run.

    Parameters
    ----------
    scenario : str
        Name in `SCENARIOS`, or "log:" and the name of a file.
    estimator : str
        As `piezoest.bench.candidates.candidate` reads it, or "linear feed-forward".
    seed : int
        Start of the random numbers.
    settings : Settings
        What all runs share.
    code : str
        Fingerprint of what is run, see `code_of`: a row of other code is another run's.
    """

    scenario: str
    estimator: str
    seed: int
    settings: Settings
    code: str

    @property
    def key(self) -> str:
        """What the run's row is kept under."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


def code_of(estimator: str) -> str:
    """Fingerprint of this package and, for an estimator of one's own, of its module.

    Parameters
    ----------
    estimator : str
        As `piezoest.bench.candidates.candidate` reads it, or "linear feed-forward".
    """
    path = module_of(estimator)
    if path is None:
        return fingerprint()
    return f"{fingerprint()}-{hashlib.sha256(path.read_bytes()).hexdigest()[:16]}"


def module_of(estimator: str) -> Path | None:
    """File of an estimator of one's own; None for one of the package.

    Parameters
    ----------
    estimator : str
        As `piezoest.bench.candidates.candidate` reads it, or "linear feed-forward".
    """
    name = estimator.partition("(")[0].strip()
    if ":" not in name:
        return None
    found = inspect.getsourcefile(load_estimator(name))
    return None if found is None else Path(found)


def play(task: Task) -> Row:
    """Run a task.

    Parameters
    ----------
    task : Task
        What to run.

    Returns
    -------
    dict
        Flat but for ``errors``; what the estimator raised is its ``failure``, and then what is not
        known is None, as is what is not finite.
    """
    row, clock = _empty(task), _Clock()
    estimator = None if task.estimator == REFERENCE else task.estimator
    try:
        _warm(task.estimator, task.settings.sample_rate)
        log = recorded.file_of(task.scenario)
        if log is not None:
            row |= recorded.numbers(log, estimator, clock.watch)
        else:
            case, linear = _linear(task.scenario, task.seed, task.settings)
            row |= {
                "amplitude": case.amplitude,
                "period": case.period / case.sample_rate,
                "samples": len(case.reference),
            }
            record = linear
            if estimator is not None:
                record = follow(case, estimator, guard=task.settings.guard, watch=clock.watch)
            row |= _numbers(measure(record, linear, case), case)
        if estimator is not None:
            row["microseconds"] = 1e6 * clock.seconds / row["samples"]
    except (Exception, SystemExit) as error:
        row["failure"] = f"{type(error).__name__}: {error}"
    return dict(json_safe(row))


def crashed(task: Task) -> Row:
    """Row of a task whose process died over it.

    Parameters
    ----------
    task : Task
        What was to be run.
    """
    return {**_empty(task), "failure": "the process died"}


@functools.lru_cache(maxsize=2)
def _linear(scenario: str, seed: int, settings: Settings) -> tuple[Case, TrackingRecord]:
    """A case, and linear feed-forward on it: the same for all estimators that come one after the other."""
    case = SCENARIOS[scenario].build(seed, **settings.conditions(scenario))
    case = dataclasses.replace(case, stage=STAGES[settings.stage])
    return case, follow(case, None)


# Numbers of a run in the order of the table's columns; with each its type there.
COLUMNS: dict[str, type] = {
    "key": str,
    "scenario": str,
    "stage": str,
    "estimator": str,
    "seed": int,
    "failure": str,
    "amplitude": float,
    "period": float,
    "samples": int,
    "mean_error": float,
    "settled_max": float,
    "settled_rms": float,
    "worst_error": float,
    "settling_periods": int,
    "periods_to_final": int,
    "settling_time": float,
    "excursion": float,
    "linear_settled_max": float,
    "ratio": float,
    "run_ratio": float,
    "worst_ratio": float,
    "diverged": bool,
    "diverged_in_a_period": bool,
    "before_max": float,
    "rest_excursion": float,
    "rest_excursion_later": float,
    "microseconds": float,
}


def _empty(task: Task) -> Row:
    known = {
        "key": task.key,
        "scenario": task.scenario,
        "stage": task.settings.stage,
        "estimator": task.estimator,
        "seed": task.seed,
    }
    return {**dict.fromkeys(COLUMNS), **known, "errors": []}


def _numbers(metrics: Metrics, case: Case) -> Row:
    found = asdict(metrics)
    periods = metrics.settling_periods
    with np.errstate(divide="ignore"):
        found["mean_error"] = float(np.exp(np.mean(np.log(metrics.errors))))
    found["settling_time"] = None if periods is None else periods * case.period / case.sample_rate
    return found


class _Clock:
    """Time of this thread that an estimator takes, without the rest of the ring."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def watch(self, estimator: Any) -> Any:
        return (_Stepped if not hasattr(estimator, "run") else _Watched)(estimator, self)


class _Stepped:
    """An estimator under a clock."""

    def __init__(self, estimator: Any, clock: _Clock) -> None:
        self._estimator = estimator
        self._clock = clock
        if hasattr(estimator, "sample_rate"):
            self.sample_rate = estimator.sample_rate

    def step(self, u: float, x: float) -> None:
        began = time.thread_time()
        self._estimator.step(u, x)
        self._clock.seconds += time.thread_time() - began

    @property
    def model(self) -> Any:
        began = time.thread_time()
        model = self._estimator.model
        self._clock.seconds += time.thread_time() - began
        return model


class _Watched(_Stepped):
    """The same, of an estimator that takes intervals at once."""

    def run(self, u: FloatArray, x: FloatArray) -> None:
        began = time.thread_time()
        self._estimator.run(u, x)
        self._clock.seconds += time.thread_time() - began


_WARMED: set[tuple[str, Any]] = set()


def _warm(estimator: str, sample_rate: float) -> None:
    """Let an estimator load what it compiled before one of its sort is timed."""
    if estimator == REFERENCE:
        return
    made = candidate(estimator)(sample_rate, RIGHT_MODEL)
    loaded = (
        estimator.partition("(")[0],
        getattr(made, "_kind", None),
    )  # loops are compiled for settings, too
    if loaded in _WARMED:
        return
    u = 30.0 * np.sin(np.linspace(0.0, 6.0, round(WARM_UP * sample_rate)))
    x = RIGHT_MODEL.simulate(u)
    for k in range(u.size):
        made.step(float(u[k]), float(x[k]))
    if hasattr(made, "run"):
        made.run(u[:2], x[:2])
    _ = made.model
    _WARMED.add(loaded)
