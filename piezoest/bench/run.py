"""One run of the table: scenario, stage, estimator and seed in, a row of numbers out.

`play` is a function of its task alone, whichever process or machine it runs in.
"""

import functools
import traceback
from dataclasses import dataclass, field
from typing import Any

from piezoest.bench import recorded
from piezoest.bench.cases import Case
from piezoest.bench.estimators import LIMITS, LINEAR, candidate
from piezoest.bench.executors import quiet
from piezoest.bench.metrics import measure
from piezoest.bench.origin import json_safe
from piezoest.bench.scenarios import SCENARIOS
from piezoest.bench.store import Keyed, Row
from piezoest.compensators import InverseCompensator, LinearCompensator
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import LinearGain
from piezoest.tracking import TrackingRecord, track

TRANSFER = 0.01  # s, of a bumpless change of model: the compensators' default at 50 kHz
# Linear feed-forward learns its gain from whole loops, at any frequency; 0.4 s at 5 Hz.
LINEAR_MEMORY = 2.0  # periods

# Numbers of a run in the order of the table's columns; with each its type there.
COLUMNS: dict[str, type] = {
    "key": str, "stage": str, "scenario": str, "estimator": str, "seed": int, "failure": str,
    "amplitude": float, "period": float, "settles": int, "first": float, "worst": float, "typical": float,
    "settled": float, "settled_rms": float, "diverged": bool,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Task(Keyed):
    """One run."""

    scenario: str  # name in `SCENARIOS`, or "log:" and the name of a file
    estimator: str  # as `piezoest.bench.estimators.candidate` reads it, or "linear feed-forward"
    seed: int  # start of the random numbers
    # Fields of `piezoest.bench.cases.Conditions`, the stage among them.
    given: dict[str, Any] = field(default_factory=dict, hash=False)
    code: str = ""  # fingerprint of what is run, see `origin.code_of`: a row of other code is another run's


@quiet()
def play(task: Task) -> Row:
    """Run a task; what it raised is its ``failure``, and what is not known or not finite is None."""
    row = _empty(task)
    try:
        log = recorded.file_of(task.scenario)
        if log is not None:
            row |= recorded.numbers(log, None if task.estimator == LINEAR else task.estimator)
        else:
            case, linear = _linear(task.scenario, task.seed, tuple(sorted(task.given.items())))
            row |= {"amplitude": case.amplitude, "period": case.period / case.sample_rate}
            record = linear if task.estimator == LINEAR else follow(case, task.estimator)
            row |= measure(record, linear, case)
    except (Exception, SystemExit) as error:
        row["failure"] = f"{type(error).__name__}: {error}"
        row["traceback"] = traceback.format_exc()
    return json_safe(row)


def crashed(task: Task) -> Row:
    """Row of a task whose process died over it."""
    return {**_empty(task), "failure": "the process died"}


def _empty(task: Task) -> Row:
    known = {
        "key": task.key,
        "stage": "" if recorded.file_of(task.scenario) else task.given.get("stage", "paper"),
        "scenario": task.scenario,
        "estimator": task.estimator,
        "seed": task.seed,
        "diverged": True,
    }
    return {**dict.fromkeys(COLUMNS), **known, "errors": []}


@functools.lru_cache(maxsize=2)
def _linear(scenario: str, seed: int, given: tuple[tuple[str, Any], ...]) -> tuple[Case, TrackingRecord]:
    """A case, and linear feed-forward on it: the same for all estimators that come one after the other."""
    case = SCENARIOS[scenario].build(seed, **dict(given))
    return case, follow(case, LINEAR)


def follow(case: Case, estimator: str) -> TrackingRecord:
    """Let a stage follow a case's reference, with an estimator, a controller or linear feed-forward."""
    rate = case.sample_rate
    transfer = max(1, round(TRANSFER * rate))
    compensator: LinearCompensator | InverseCompensator
    if estimator == LINEAR:
        memory = LINEAR_MEMORY * case.period / rate
        made: Any = HysteresisRLS(rate, initial_model=case.linear_start, memory=memory)
        compensator = LinearCompensator(case.linear_start, LIMITS, transfer_samples=transfer)
    else:
        made = candidate(estimator)(rate, case.start)
        if hasattr(made, "learn"):
            return track(case.reference, stage=case.new_stage(), controller=made)
        # What has no model is refused by `track`.
        linear = isinstance(getattr(made, "model", None), LinearGain)
        start = case.linear_start if linear else case.start
        compensator = InverseCompensator(start, LIMITS, transfer_samples=transfer)
    return track(
        case.reference,
        stage=case.new_stage(),
        compensator=compensator,
        estimator=made,
        update_interval=case.update_interval,
    )
