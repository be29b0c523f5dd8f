"""Many runs: planned, resumed, spread over processes or a cluster, and summed up."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from piezoest.bench.adaptation import json_safe, median_and_q95
from piezoest.bench.candidates import candidate
from piezoest.bench.estimators import OPTIONS, REFERENCE, find_estimators
from piezoest.bench.executors import in_processes, on_dask
from piezoest.bench.machine import fingerprint
from piezoest.bench.recorded import digest, file_of
from piezoest.bench.runner import Row, Settings, Task, code_of, crashed, module_of, play
from piezoest.bench.scenarios import SCENARIOS
from piezoest.bench.store import Store

Execute = Callable[[Iterable[Task]], Iterator[Row]]

# The paper's law beside the default: 0.4 s is the memory the simulated stage was calibrated with.
PAPERS = "HysteresisRLS(memory=0.4)"
OTHER_STAGE = ", other stage"  # after a scenario's name
# What is lower where it is better, and infinite where a run failed or did not settle.
QUANTITIES = ("mean_error", "settled_max", "worst_error", "settling_time")


def default_estimators() -> list[str]:
    """Every estimator of the package, with what it needs beside its defaults, and the paper's law."""
    names = []
    for name in find_estimators():
        options = ", ".join(f"{key}={value!r}" for key, value in OPTIONS.get(name, {}).items())
        names.append(f"{name}({options})" if options else name)
        if name == PAPERS.partition("(")[0]:
            names.append(PAPERS)
    return names


def plan(
    scenarios: Sequence[str], estimators: Sequence[str], seeds: Iterable[int], settings: Settings
) -> list[Task]:
    """Every scenario with every estimator and seed, linear feed-forward among them.

    Parameters
    ----------
    scenarios : sequence of str
        Names in `SCENARIOS`, and of logs, see `piezoest.bench.recorded.logs_of`: these are run once,
        for they leave nothing to chance.
    estimators : sequence of str
        As `piezoest.bench.candidates.candidate` reads them.
    seeds : iterable of int
        Starts of the random numbers.
    settings : Settings
        What all runs share.

    Returns
    -------
    list of Task
        Those with the same scenario and seed one after the other.

    Raises
    ------
    ValueError
        If a scenario or an estimator is unknown.
    """
    logs = {name: digest(file) for name in scenarios if (file := file_of(name)) is not None}
    if unknown := [name for name in scenarios if name not in SCENARIOS and name not in logs]:
        raise ValueError(f"scenario {', '.join(unknown)}: choose of {', '.join(SCENARIOS)}")
    for estimator in estimators:
        candidate(estimator)
    codes = {name: code_of(name) for name in (REFERENCE, *dict.fromkeys(estimators))}
    simulated = [name for name in dict.fromkeys(scenarios) if name not in logs]
    places = [(name, seed, "") for seed in seeds for name in simulated]
    places += [(name, 0, f"-{content}") for name, content in logs.items()]
    return [
        Task(scenario, estimator, seed, settings, code + content)
        for scenario, seed, content in places
        for estimator, code in codes.items()
    ]


def over_cores(processes: int | None = None) -> Execute:
    """Run tasks in processes of this machine.

    Parameters
    ----------
    processes : int, optional
        How many; default one for each core.
    """
    return partial(in_processes, play, processes=processes, crashed=crashed)


def over_dask(
    scheduler: str | None = None, processes: int | None = None, estimators: Iterable[str] = ()
) -> Execute:
    """Run tasks on Dask.

    Parameters
    ----------
    scheduler : str, optional
        Address of a cluster's scheduler; default a cluster of this machine's cores.
    processes : int, optional
        Workers of the latter; default one for each core.
    estimators : iterable of str
        Those whose modules the workers need.
    """
    modules = {path for name in estimators if (path := module_of(name)) is not None}
    work = partial(_play_same, ours=fingerprint())
    return partial(
        on_dask, work, scheduler=scheduler, processes=processes, crashed=crashed, modules=sorted(modules)
    )


def _play_same(task: Task, ours: str) -> Row:
    """Run a task on a worker that has the same package."""
    if fingerprint() != ours:
        raise ValueError(
            f"a worker has another piezoest ({fingerprint()}) than this process ({ours}): install the same"
        )
    return play(task)


def run(
    tasks: Sequence[Task],
    store: Store,
    execute: Execute,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> int:
    """Run what the store does not hold yet.

    Parameters
    ----------
    tasks : sequence of Task
        The whole campaign.
    store : Store
        Open; holds all of their rows afterwards.
    execute : callable
        Such as `over_cores`.
    progress : callable
        Called with the number of finished runs and of all, at first and after each.

    Returns
    -------
    int
        How many were run now.
    """
    todo = [task for task in tasks if task.key not in store]
    done = len(tasks) - len(todo)
    progress(done, len(tasks))
    for row in execute(todo):
        if store.append(row):
            done += 1
            progress(done, len(tasks))
    return len(todo)


@dataclass(slots=True)
class _Group:
    """Numbers of the runs of one estimator in one scenario."""

    values: dict[str, array[float]] = field(default_factory=dict)
    errors: list[array[float]] = field(default_factory=list)
    runs: int = 0
    failures: int = 0
    diverged: int = 0
    settled: int = 0
    period: float = math.nan
    amplitude: float = math.nan

    def add(self, row: Row) -> None:
        """Count a row in."""
        self.runs += 1
        failed = row["failure"] is not None
        self.failures += failed
        self.diverged += failed or bool(row["diverged"])
        self.settled += row["settling_periods"] is not None
        for name in (*QUANTITIES, "ratio"):
            self.values.setdefault(name, array("d")).append(value_of(row, name))
        if row["microseconds"] is not None:
            self.values.setdefault("microseconds", array("d")).append(row["microseconds"])
        if not failed:
            self.period, self.amplitude = row["period"], row["amplitude"]
            self.errors.append(array("d", (math.inf if e is None else e for e in row["errors"])))


def value_of(row: Row, quantity: str) -> float:
    """A number of a run; infinite where it failed, did not settle or left all bounds.

    Parameters
    ----------
    row : dict
        From `piezoest.bench.runner.play`.
    quantity : str
        Column of it.
    """
    value = row[quantity]
    return math.inf if value is None else float(value)


def title(row: Row) -> str:
    """Scenario of a row, with the stage where that is not the paper's.

    Parameters
    ----------
    row : dict
        From `piezoest.bench.runner.play`.
    """
    name = str(row["scenario"])
    return name if row["stage"] == "paper" or file_of(name) else name + OTHER_STAGE


def summarise(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Median and 95 % quantile of every number, for each scenario and estimator.

    Parameters
    ----------
    rows : iterable of dict
        From `piezoest.bench.runner.play`, in any order; read once.

    Returns
    -------
    list of dict
        In the order in which scenario and estimator come first; ``transient`` is the median
        error of each period after the change [µm], and null stands for infinite.
    """
    groups: dict[tuple[str, str], _Group] = {}
    for row in rows:
        groups.setdefault((title(row), row["estimator"]), _Group()).add(row)
    return [dict(json_safe(_summary(*key, group))) for key, group in groups.items()]


def _summary(scenario: str, estimator: str, group: _Group) -> dict[str, Any]:
    return {
        "scenario": scenario,
        "estimator": estimator,
        "runs": group.runs,
        "failures": group.failures,
        "diverged": group.diverged,
        "settled": group.settled,
        "amplitude": group.amplitude,
        "period": group.period,
        **{name: median_and_q95(values) for name, values in group.values.items()},
        "transient": np.median(np.array(group.errors), axis=0).tolist() if group.errors else [],
    }


def failures(rows: Iterable[Row]) -> list[str]:
    """A line for each run that failed.

    Parameters
    ----------
    rows : iterable of dict
        From `piezoest.bench.runner.play`.
    """
    return [
        f"{title(row)}, seed {row['seed']}, {row['estimator']}: {row['failure']}"
        for row in rows
        if row["failure"] is not None
    ]


def keys_of(tasks: Iterable[Task]) -> list[str]:
    """Keys of tasks, in their order.

    Parameters
    ----------
    tasks : iterable of Task
        From `plan`.
    """
    return [task.key for task in tasks]


def store_in(folder: Path) -> Store:
    """Where the runs of a campaign with this folder are kept.

    Parameters
    ----------
    folder : Path
        Of the campaign.
    """
    return Store(folder / "runs.jsonl")
