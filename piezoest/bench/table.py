"""The table of runs: scenarios × stages × estimators × seeds, planned, and summed up in one document."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from piezoest.bench import cost, tables
from piezoest.bench.cases import PAPER, RIGHT_MODEL, STAGES, STRANGERS, Conditions
from piezoest.bench.estimators import KNOWN, LINEAR, PAPERS, candidate, is_slow
from piezoest.bench.executors import in_processes, on_dask, one_by_one
from piezoest.bench.origin import code_of, fingerprint, json_safe, name_of, source_of
from piezoest.bench.recorded import digest, file_of
from piezoest.bench.run import COLUMNS, Task, crashed, follow, play
from piezoest.bench.scenarios import SCENARIOS, UNREPEATED
from piezoest.bench.statistics import NEEDS, QUANTITIES, interval, order, relative
from piezoest.bench.store import Row

RUNS, PERIODS = "runs", "periods"
PERIOD_COLUMNS: dict[str, type] = {
    "key": str, "stage": str, "scenario": str, "estimator": str, "seed": int, "period": int, "error": float,
}  # fmt: skip
# Under a minute with all estimators on two cores, compiled.
QUICK: dict[str, Any] = {"sample_rate": 2000.0, "before": 2, "after": 6, "rest": 0.5, "drift": 1.5}
DIGITS = 4  # significant, of the numbers of a document


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is run."""

    # As `piezoest.bench.estimators.candidate` reads them; linear feed-forward is always beside them.
    estimators: tuple[str, ...]
    # Names in `SCENARIOS`, or of logs, see `piezoest.bench.recorded.logs_of`.
    scenarios: tuple[str, ...] = tuple(SCENARIOS)
    stages: tuple[str, ...] = (PAPER, *STRANGERS)  # names in `piezoest.bench.cases.STAGES`
    seeds: int = 30  # runs of each
    # Runs of each estimator that is slow; these run on the first stage only, and on no scenario of
    # `piezoest.bench.scenarios.UNREPEATED`, whose runs are long.
    slow_seeds: int = 10
    # Estimators that were found by tuning, beside the others; these run on the first stage only.
    tuned: tuple[str, ...] = ()
    given: dict[str, Any] = field(default_factory=dict)  # fields of `piezoest.bench.cases.Conditions`

    def __post_init__(self) -> None:
        if unknown := [name for name in self.scenarios if name not in SCENARIOS and not file_of(name)]:
            raise ValueError(f"scenario {', '.join(unknown)}: choose one of {', '.join(SCENARIOS)}")
        if unknown := [name for name in self.stages if name not in STAGES]:
            raise ValueError(f"stage {', '.join(unknown)}: choose one of {', '.join(STAGES)}")
        rate = Conditions(**self.given).sample_rate
        for estimator in self.estimators:
            make = candidate(estimator)
            if ":" not in estimator:  # one of the user's own is reported with its traceback, after the runs
                make(rate, RIGHT_MODEL)

    def tasks(self) -> list[Task]:
        """Every run; those with the same seed, stage and scenario one after the other."""
        codes = {name: code_of(name) for name in self.everything}
        logs = {name: digest(file) for name in self.scenarios if (file := file_of(name)) is not None}
        simulated = [name for name in dict.fromkeys(self.scenarios) if name not in logs]
        found = [
            Task(scenario, estimator, seed, {**self.given, "stage": stage}, code)
            for seed in range(self.seeds)
            for stage in self.stages
            for scenario in simulated
            for estimator, code in codes.items()
            if self._is_run(estimator, scenario, stage, seed)
        ]
        # A log leaves nothing to chance: it is run once.
        return found + [
            Task(log, estimator, 0, {}, f"{code}-{content}")
            for log, content in logs.items()
            for estimator, code in codes.items()
        ]

    @property
    def everything(self) -> tuple[str, ...]:
        """Linear feed-forward, the estimators and what was tuned, each once."""
        return tuple(dict.fromkeys([LINEAR, *self.estimators, *self.tuned]))

    def _is_run(self, estimator: str, scenario: str, stage: str, seed: int) -> bool:
        """Whether a run is made: slow estimators and tuned ones have fewer."""
        if is_slow(estimator):
            return seed < self.slow_seeds and stage == self.stages[0] and scenario not in UNREPEATED
        return estimator not in self.tuned or stage == self.stages[0]


def over_cores(processes: int | None = None) -> Any:
    """Run tasks in processes of this machine, one for each core by default."""
    return partial(in_processes, play, processes=processes, crashed=crashed)


def over_dask(
    scheduler: str | None = None, processes: int | None = None, estimators: Iterable[str] = ()
) -> Any:
    """Run tasks on Dask, a cluster's or this machine's processes; it is sent the estimators' modules."""
    modules = sorted({path for name in estimators if (path := source_of(name)) is not None})
    work = partial(_play_same, ours=fingerprint())
    return partial(on_dask, work, scheduler=scheduler, processes=processes, crashed=crashed, modules=modules)


def _play_same(task: Task, ours: str) -> Row:
    """Run a task on a worker that has the same package."""
    if fingerprint() != ours:
        raise ValueError(
            f"a worker has another piezoest ({fingerprint()}) than this process ({ours}): install the same"
        )
    return play(task)


def label(text: str, tuned: Iterable[str] = ()) -> str:
    """Name of an estimator in tables and figures."""
    if text == PAPERS:
        return "HysteresisRLS, the paper's law"
    if text in set(tuned):
        return f"{name_of(text)}, tuned"
    return name_of(text) if text in KNOWN.values() else text


def write(rows: Sequence[Row], folder: Path, format: str | None = None) -> pd.DataFrame:
    """Write the tables `runs` and `periods`."""
    format = tables.checked_format(format)
    runs = tables.table_of(rows, COLUMNS)
    tables.write_table(runs, folder / f"{RUNS}.{format}")
    periods = ({**row, "period": k, "error": e} for row in rows for k, e in enumerate(row["errors"], 1))
    tables.write_table(tables.table_of(periods, PERIOD_COLUMNS), folder / f"{PERIODS}.{format}")
    return runs


def costs(estimators: Iterable[str], given: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Time of a step of each estimator on a cold start, of a controller on its own; empty if it fails."""
    return dict(one_by_one(partial(_cost, given), estimators, lambda text: (text, {})))


def _cost(given: dict[str, Any], text: str) -> tuple[str, dict[str, Any]]:
    """Name and time of one estimator."""
    case = SCENARIOS["cold-start"].build(0, **given)
    try:
        made = partial(candidate(text), case.sample_rate, case.start)
        # On the voltages of another loop a controller would only seek the gain.
        record = follow(case, text if hasattr(made(), "learn") else LINEAR)
        return text, {"step_us": 1e6 * cost.step_seconds(made, record)}
    except Exception:
        return text, {}


def describe(rows: Sequence[Row], plan: Plan, times: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Sum up a finished campaign, errors relative to the amplitude. `times`: from `costs`.

    ``cells``: of each estimator, stage and scenario the median over the seeds and the 5 and 95 % quantiles.
    ``overview``: of each estimator the geometric means, with 95 % intervals, of the medians in scenarios that
    repeat, on the first stage; and the settled error on the other stages (``others``) and in scenarios that
    do not repeat (``unrepeated``). ``needs``: the estimators in order for each need.
    """
    frame = relative(tables.table_of(rows, COLUMNS))
    errors: dict[tuple[str, str, str], list[list[float]]] = {}
    for row in rows:
        if row["failure"] is None and row["stage"] in ("", plan.stages[0]):
            scaled = [math.inf if e is None else e / row["amplitude"] for e in row["errors"]]
            errors.setdefault((row["stage"], row["scenario"], row["estimator"]), []).append(scaled)
    cells = [
        _cell(key, group, errors.get(key, []))
        for key, group in frame.groupby(["stage", "scenario", "estimator"], sort=False)
    ]
    overview = [_overview(frame, text, plan) for text in plan.everything]
    document = {
        "suite": "table",
        "plan": asdict(plan),
        "conditions": asdict(Conditions(**plan.given)),
        "scenarios": {
            name: SCENARIOS[name].description if name in SCENARIOS else f"Recorded log {file_of(name)}."
            for name in plan.scenarios
        },
        "estimators": {
            text: {"name": label(text, plan.tuned), "slow": is_slow(text), **times.get(text, {})}
            for text in plan.everything
        },
        "runs": len(rows),
        "overview": overview,
        "cells": cells,
        "needs": [
            {**asdict(need), "order": order(frame[~frame["estimator"].isin(plan.tuned)], need, plan.stages)}
            for need in NEEDS
            if set(need.scenarios) <= set(plan.scenarios)
        ],
        "failures": [
            f"{row['scenario']}, {row['stage']}, seed {row['seed']}, {row['estimator']}: {row['failure']}"
            for row in rows
            if row["failure"] is not None
        ],
        "all_failed": [row["estimator"] for row in overview if row["failures"] == row["runs"] > 0],
        "tracebacks": list(dict.fromkeys(row["traceback"] for row in rows if row.get("traceback")))[:5],
    }
    return json_safe(document, DIGITS)


def _cell(key: Any, group: pd.DataFrame, errors: Sequence[Sequence[float]]) -> Row:
    return {
        **dict(zip(("stage", "scenario", "estimator"), key, strict=True)),
        **_counts(group),
        "settled_runs": int(np.isfinite(group["settles"]).sum()),
        "period": float(group["period"].median()),
        **{name: _quantiles(group[name]) for name in (*QUANTITIES, "settles")},
        "transient": np.median(errors, axis=0).tolist() if errors else [],
    }


def _counts(group: pd.DataFrame) -> dict[str, int]:
    return {
        "runs": len(group),
        "failures": int(group["failure"].notna().sum()),
        "diverged": int(group["diverged"].sum()),
    }


def _quantiles(values: Any) -> list[float]:
    """Median, 5 and 95 % quantile, each a value that occurred: no mean has an infinite neighbour."""
    return [float(np.quantile(values, level, method="inverted_cdf")) for level in (0.5, 0.05, 0.95)]


def _overview(frame: pd.DataFrame, estimator: str, plan: Plan) -> Row:
    mine = frame[frame["estimator"] == estimator]
    repeated = ~mine["scenario"].isin(UNREPEATED)
    at_home = mine["stage"].isin(["", plan.stages[0]])
    first, others = mine[repeated & at_home], mine[repeated & ~at_home]
    unrepeated = mine[~repeated & at_home]
    return {
        "estimator": estimator,
        **_counts(mine),
        "first_runs": len(first),
        "settled_runs": int(np.isfinite(first["settles"]).sum()),
        "settles": _quantiles(first["settles"]) if len(first) else None,
        **{name: interval(first, name) if len(first) else None for name in QUANTITIES},
        "unrepeated": interval(unrepeated, "settled") if len(unrepeated) else None,
        "others": interval(others, "settled") if len(others) else None,
    }
