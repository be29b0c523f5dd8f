"""How well piezoest fits recorded logs: simulated ones, of stages that none of its models was made for.

Each log is drawn from its seed (`piezoest.bench.zoo.logs`) and judged by `log_judging`. Beside what was
chosen stand the best candidate in hindsight, a gain and 20 plays by non-negative least squares, and a
straight line.

    python benchmarks/logs.py [--logs N] [--seed S] [--clean N] [--jobs N] [--json FILE] [--rows FILE]

A log takes about a second.
"""

import json
import time
import timeit
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from log_judging import NEGLIGIBLE, PLAYS, TRAIN, clean_scores, judge

import piezoest as pz
from piezoest._files import write_text
from piezoest._progress import progress
from piezoest.bench.executors import in_processes
from piezoest.bench.origin import json_safe, origin, put
from piezoest.bench.table import DIGITS
from piezoest.bench.zoo.families import draw_family
from piezoest.bench.zoo.logs import ADDED, REACHES
from piezoest.bench.zoo.summary import grouped, median, values
from piezoest.models import ColemanHodgdon, Creep

Row = dict[str, Any]

NEAR = 1.2  # of the best candidate's error
LEVELS = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 1.0)
RATIOS = ("best", "nnls", "line", "stroke", "noise")
COVERED = ("below 50 %", "50 to 90 %", "90 to 98 %", "above 98 %")
COVERED_AT = (0.5, 0.9, 0.98)
WORST = 10
LONG, ROUNDS = 50_000, 5  # samples of the log whose fits are timed, and times of which the median counts
SHOWN = ("seed", "family", "voltage", "added", "chosen_name", "best_name")


def quantiles(values: Sequence[float]) -> dict[str, float]:
    """By level, in per cent."""
    return {f"{100.0 * level:g} %": float(np.quantile(values, level)) for level in LEVELS if values}


def share(hits: Iterable[bool], of: int) -> float | None:
    return sum(map(bool, hits)) / of if of else None


def part(rows: Sequence[Row]) -> Row:
    """What is said of a group of logs; one that was refused counts as neither near the best nor better."""
    ratios = values(rows, "ratio")
    return {
        "logs": len(rows),
        "failed": len(rows) - len(ratios),
        "near_best": share((ratio["best"] <= NEAR for ratio in ratios), len(rows)),
        "beats_nnls": share((ratio["nnls"] <= 1.0 for ratio in ratios), len(rows)),
        "beats_line": share((ratio["line"] <= 1.0 for ratio in ratios), len(rows)),
        **{f"median_{name}": median([ratio[name] for ratio in ratios]) for name in RATIOS},
        "covered": median(values(rows, "coverage")),
        "seconds": median(values(rows, "seconds")),
    }


def parts(rows: Sequence[Row], column: str) -> list[Row]:
    """`part` for each value of a column."""
    return grouped(({**row, "name": row[column]} for row in rows), "name", of=part)


def by_added(rows: Sequence[Row]) -> list[Row]:
    """`part` of the logs with each thing that was added, and of those without it."""
    found = []
    for name in ADDED:
        having = [row for row in rows if name in row["added"]]
        others = [row for row in rows if name not in row["added"]]
        # Noise is in all of them.
        if having and others:
            found.append({"name": name, **part(having), "without": part(others)})
    return found


def coverages(known: Sequence[float]) -> Row | None:
    """How often the interval of 95 % held what."""
    if not known:
        return None
    places = np.digitize(known, COVERED_AT)
    return {"counts": {name: int(np.sum(places == i)) for i, name in enumerate(COVERED)}}


def scores(rows: Sequence[Row], clean: Sequence[Row]) -> list[Row]:
    """Errors of a Coleman-Hodgdon stage's parameters, relative to their standard errors.

    Of the logs, and of others to which nothing is added that is not of the model.
    """
    found = []
    for group, mine in (("clean", clean), ("all", rows)):
        for i, name in enumerate(ColemanHodgdon.parameter_names):
            z = [abs(each[i]) for each in values(mine, "z") if each[i] is not None]
            within = share((each <= 2.0 for each in z), len(z))
            row = {"logs_with": group, "parameter": name, "logs": len(z), "within_2": within}
            found.append({**row, "median": median(z), "largest": max(z, default=None)})
    return found


def summarise(rows: Sequence[Row], clean: Sequence[Row] = ()) -> Row:
    """All that the page shows, as small for many logs as for few."""
    fitted = [row for row in rows if row["failure"] is None]
    failed = [row for row in rows if row["failure"] is not None]
    worst = sorted(fitted, key=lambda row: row["regret"], reverse=True)[:WORST]
    return {
        "all": part(rows),
        "by_family": parts(rows, "family"),
        "by_voltage": parts(rows, "voltage"),
        "by_chosen": parts(fitted, "chosen_name"),
        "by_added": by_added(rows),
        "quantiles": {name: quantiles([row["ratio"][name] for row in fitted]) for name in RATIOS},
        "seconds": quantiles(values(rows, "seconds")),
        "coverage": coverages(values(fitted, "coverage")),
        "scores": scores(fitted, clean),
        "worst": [{**{name: row[name] for name in SHOWN}, **row["ratio"]} for row in worst],
        "failures": [{"seed": row["seed"], "text": row["failure"]} for row in failed[:WORST]],
    }


def times() -> list[Row]:
    """Seconds of fits of a long log, by the clock of their thread, and what is asked of them.

    Its stage has bends and creep, and its swings differ.
    """
    rng, rate, t = np.random.default_rng(0), 1e4, np.arange(LONG) / LONG
    reach = REACHES[1]
    u = reach.middle + 0.9 * reach.half * np.sin(100.0 * np.pi * t) * np.linspace(0.3, 1.0, LONG)
    x = draw_family("preisach", rng, reach, width=0.15, gain=0.1).simulate(u)
    x += Creep.logarithmic(0.02, shortest=1e-3, longest=50.0).simulate(x, sample_rate=rate)
    x += 1e-3 * np.ptp(x) * rng.standard_normal(LONG)

    def fit(kind: str) -> Callable[[], Any]:
        return lambda: pz.fit(u, x, sample_rate=rate, model=kind)

    work = (
        ("plays with 20 thresholds, creep and bends", 1.0, fit("plays-asymmetric-creep")),
        ("Coleman-Hodgdon", 0.2, fit("coleman-hodgdon")),
        ("all kinds, with cross-validation", 10.0, lambda: pz.identify(u, x, sample_rate=rate, train=0.9)),
    )
    found = []
    for name, asked, run in work:
        _, *taken = timeit.repeat(run, timer=time.thread_time, repeat=1 + ROUNDS, number=1)  # one to warm up
        found.append({"fit": name, "asked": asked, "seconds": float(np.median(taken))})
    return found


def played(what: str, work: Callable[[int], Row], seeds: Sequence[int], workers: int | None) -> list[Row]:
    """Rows of some logs, in the order of their seeds."""
    rows: list[Row] = []
    with progress(what, lines=True) as say:
        for row in in_processes(work, seeds, workers):
            rows.append(row)
            say.done(len(rows), len(seeds))
    return sorted(rows, key=lambda row: row["seed"])


def main(
    logs: Annotated[int, typer.Option(min=1)] = 200, seed: int = 5000, clean: int = 50,
    jobs: Annotated[int | None, typer.Option("--jobs", "--workers")] = None,
    json_to: Annotated[Path | None, typer.Option("--json")] = None,
    rows_to: Annotated[Path | None, typer.Option("--rows")] = None,
) -> None:  # fmt: skip
    """Fit LOGS, one for each seed from SEED on, and CLEAN Coleman-Hodgdon stages for the standard errors.

    It takes JOBS processes, one for each core. ROWS gets each log as a line of JSON, to compare two
    versions.
    """
    began = time.perf_counter()
    rows = played("logs", judge, range(seed, seed + logs), jobs)
    pure = played("clean logs", clean_scores, range(seed, seed + clean), jobs)
    document = {
        "suite": "logs",
        **origin(began),
        "logs": logs,
        "seed": seed,
        "clean": clean,
        "criteria": {"train": TRAIN, "plays": PLAYS, "near": NEAR, "negligible": NEGLIGIBLE},
        "times": times(),
        **summarise(rows, pure),
    }
    if rows_to is not None:
        lines = (json.dumps(json_safe(row), ensure_ascii=False) for row in rows)
        write_text(rows_to, "".join(f"{line}\n" for line in lines))
    put(json_safe(document, DIGITS), json_to)


if __name__ == "__main__":
    typer.run(main)
