"""Scenarios × estimators × seeds: how fast each adapts, and what it does on the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from piezoest.bench.candidates import candidate
from piezoest.bench.cases import Case
from piezoest.bench.estimators import REFERENCE, find_estimators
from piezoest.bench.executors import in_processes
from piezoest.bench.metrics import Metrics, measure
from piezoest.bench.scenarios import SCENARIOS
from piezoest.compensators import InverseCompensator, LinearCompensator, VoltageLimits
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import LinearGain
from piezoest.supervisor import Supervisor
from piezoest.tracking import TrackingRecord, track

LIMITS = VoltageLimits(-100.0, 100.0)  # V, the stage's
TRANSFER = 0.01  # s, of a bumpless change of model: the compensators' default at 50 kHz
# Linear feed-forward learns its gain from whole loops, at any frequency; 0.4 s at 5 Hz.
LINEAR_MEMORY = 2.0  # periods
FIXED_MEMORIES = (0.05, 0.1, 0.2, 0.4, 1.0)  # s
SOON = 2  # periods, within which a change should be over


@dataclass(frozen=True, slots=True)
class Job:
    """What one process does at a time: linear feed-forward and some estimators on one case.

    Parameters
    ----------
    scenario : str
        Name in `SCENARIOS`.
    seed : int
        Start of the random numbers.
    estimators : tuple of str
        As `piezoest.bench.candidates.candidate` reads them.
    overrides : dict
        Fields of `piezoest.bench.cases.Conditions`.
    guard : bool
        Whether the supervisor of the ring is on.
    title : str, optional
        What the runs are said to be of, where the overrides make it more than the scenario.
    """

    scenario: str
    seed: int
    estimators: tuple[str, ...]
    overrides: dict[str, Any] = field(default_factory=dict)
    guard: bool = False
    title: str | None = None


@dataclass(frozen=True, slots=True)
class Run:
    """What one estimator made of one case.

    Parameters
    ----------
    scenario : str
        Name in `SCENARIOS`, or the title of the job.
    seed : int
        Start of the random numbers.
    estimator : str
        As it was asked for, or "linear feed-forward".
    amplitude : float
        After the change [µm].
    metrics : Metrics or None
        None where it failed.
    failure : str or None
        What it raised.
    """

    scenario: str
    seed: int
    estimator: str
    amplitude: float
    metrics: Metrics | None
    failure: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe dictionary, numbers that are not finite as null."""
        return dict(json_safe(asdict(self)))


def default_estimators() -> tuple[str, ...]:
    """What is compared if nothing is asked for: the defaults, and the paper's law with fixed memories."""
    public = find_estimators()
    fixed = [f"HysteresisRLS(memory={memory:g})" for memory in FIXED_MEMORIES]
    names = ("HysteresisRLS", *fixed, "HysteresisEKF", "OutputErrorRLS")
    return tuple(name for name in names if name.partition("(")[0] in public)


def follow(
    case: Case,
    estimator: str | None,
    *,
    guard: bool = False,
    watch: Callable[[Any], Any] = lambda estimator: estimator,
) -> TrackingRecord:
    """Send a case round the ring.

    Parameters
    ----------
    case : Case
        Reference, stage and start.
    estimator : str or None
        As `piezoest.bench.candidates.candidate` reads it; None for linear feed-forward.
    guard : bool
        Whether the supervisor of the ring is on.
    watch : callable
        Is given the estimator and returns what goes into the ring in its place.

    Returns
    -------
    TrackingRecord

    Raises
    ------
    ValueError
        If the estimator is unknown.
    """
    rate = case.sample_rate
    transfer = max(1, round(TRANSFER * rate))
    compensator: LinearCompensator | InverseCompensator
    if estimator is None:
        memory = LINEAR_MEMORY * case.period / rate
        made: Any = HysteresisRLS(rate, initial_model=case.linear_start, memory=memory)
        compensator = LinearCompensator(case.linear_start, LIMITS, transfer_samples=transfer)
    else:
        made = candidate(estimator)(rate, case.start)
        start = case.linear_start if isinstance(made.model, LinearGain) else case.start
        compensator = InverseCompensator(start, LIMITS, transfer_samples=transfer)
    return track(
        case.reference,
        stage=case.new_stage(),
        compensator=compensator,
        estimator=watch(made),
        update_interval=case.update_interval,
        supervisor=Supervisor(rate) if guard else None,
    )


def play(job: Job) -> list[Run]:
    """Run a job; what an estimator raises is its own failure.

    Parameters
    ----------
    job : Job
        The runs.

    Returns
    -------
    list of Run
        Linear feed-forward first.
    """
    case = SCENARIOS[job.scenario].build(job.seed, **job.overrides)
    linear, title = follow(case, None), job.title or job.scenario
    runs = [Run(title, job.seed, REFERENCE, case.amplitude, measure(linear, linear, case))]
    for estimator in job.estimators:
        metrics, failure = None, None
        try:
            metrics = measure(follow(case, estimator, guard=job.guard), linear, case)
        except Exception as error:
            failure = f"{type(error).__name__}: {error}"
        runs.append(Run(title, job.seed, estimator, case.amplitude, metrics, failure))
    return runs


def jobs_for(
    scenarios: Sequence[str], estimators: Sequence[str], seeds: Iterable[int], overrides: dict[str, Any]
) -> list[Job]:
    """Every scenario with every seed.

    Parameters
    ----------
    scenarios : sequence of str
        Names in `SCENARIOS`.
    estimators : sequence of str
        As `piezoest.bench.candidates.candidate` reads them.
    seeds : iterable of int
        Starts of the random numbers.
    overrides : dict
        Fields of `piezoest.bench.cases.Conditions`.

    Returns
    -------
    list of Job

    Raises
    ------
    ValueError
        If a scenario or an estimator is unknown.
    """
    if unknown := [name for name in scenarios if name not in SCENARIOS]:
        raise ValueError(f"scenario {', '.join(unknown)}: choose of {', '.join(SCENARIOS)}")
    for estimator in estimators:
        candidate(estimator)
    named = tuple(estimators)
    return [Job(name, seed, named, overrides) for seed in seeds for name in scenarios]


def in_parallel(jobs: Sequence[Job], processes: int | None = None) -> Iterator[list[Run]]:
    """Run jobs over the cores, in no particular order.

    Parameters
    ----------
    jobs : sequence of Job
        To run.
    processes : int, optional
        How many; default one for each core, 1 runs them here.

    Yields
    ------
    list of Run
        Of each job as it is done.
    """
    yield from in_processes(play, jobs, processes)


QUANTITIES = (
    "settling_periods",
    "periods_to_final",
    "worst_error",
    "settled_max",
    "settled_rms",
    "excursion",
    "ratio",
    "run_ratio",
    "worst_ratio",
    "rest_excursion",
    "rest_excursion_later",
    "first_after_rest",
)


def summarise(runs: Iterable[Run]) -> list[dict[str, Any]]:
    """Median and 95 % quantile of every number, for each scenario and estimator.

    Parameters
    ----------
    runs : iterable of Run
        In any order.

    Returns
    -------
    list of dict
        Sorted by scenario, those with a title of their own last; a run that failed or did not
        settle counts as infinite, which stands as null.
    """
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.scenario, run.estimator), []).append(run)
    rows = [_summary(key, groups[key]) for key in sorted(groups, key=lambda key: place(key[0]))]
    return [dict(json_safe(row)) for row in rows]


def place(title: str) -> tuple[int, str]:
    """Where a scenario stands in a report; those with a title of their own last.

    Parameters
    ----------
    title : str
        Name of a scenario, or title of a job.
    """
    order = list(SCENARIOS)
    return (order.index(title), "") if title in SCENARIOS else (len(order), title)


def _summary(key: tuple[str, str], runs: list[Run]) -> dict[str, Any]:
    soon = [run.metrics is not None and _infinite(run.metrics.settling_periods) <= SOON for run in runs]
    row: dict[str, Any] = {
        "scenario": key[0],
        "estimator": key[1],
        "runs": len(runs),
        "amplitude": runs[0].amplitude,
        "failures": sum(run.metrics is None for run in runs),
        "settled_soon": float(np.mean(soon)),
        "diverged": sum(run.metrics is None or run.metrics.diverged for run in runs),
        "diverged_in_a_period": sum(run.metrics is None or run.metrics.diverged_in_a_period for run in runs),
    }
    for quantity in QUANTITIES:
        values = [_quantity(run, quantity) for run in runs]
        row[quantity] = median_and_q95([value for value in values if value is not None])
    transients = [run.metrics.errors for run in runs if run.metrics is not None]
    row["transient"] = np.median(transients, axis=0).tolist() if transients else []
    return row


def median_and_q95(values: Iterable[float]) -> dict[str, float | None]:
    """Median and 95 % quantile, each a value that occurred; NaN counts as infinite, none as None.

    Parameters
    ----------
    values : iterable of float
        In any order.
    """
    known = [math.inf if math.isnan(value) else value for value in values]
    # No mean with an infinite neighbour.
    return {
        name: float(np.quantile(known, level, method="inverted_cdf")) if known else None
        for name, level in (("median", 0.5), ("q95", 0.95))
    }


def _quantity(run: Run, quantity: str) -> float | None:
    """A number of a run; None where the scenario has no such number."""
    metrics = run.metrics
    if metrics is None:
        return math.inf
    if quantity == "first_after_rest":
        if metrics.rest_excursion is None or metrics.before_max is None:
            return None
        return metrics.errors[0] / metrics.before_max
    value = getattr(metrics, quantity)
    if quantity in ("settling_periods", "periods_to_final"):
        return _infinite(value)
    return None if value is None else float(value)


def _infinite(periods: int | None) -> float:
    return math.inf if periods is None else float(periods)


def json_safe(value: Any) -> Any:
    """The same with plain lists, and None for what is not finite.

    Parameters
    ----------
    value : object
        Of dictionaries, lists, tuples and plain values.
    """
    match value:
        case dict():
            return {key: json_safe(item) for key, item in value.items()}
        case list() | tuple():
            return [json_safe(item) for item in value]
        case float() if not math.isfinite(value):
            return None
    return value
