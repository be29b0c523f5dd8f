"""The default controller, and the straight line alone, on the rigs that `piezoest bench safety` draws.

Every run follows from its seed. Finished runs are kept in the folder; started again, the same command does
the rest. What is written sums them up and is as small for many runs as for few.

    python benchmarks/safety.py [--runs N] [--workers N] [--out DIR] [--json FILE] [--figure FILE]

A run takes some seconds with the controller, and about one with the line.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piezoest._files import save_figure
from piezoest.bench.adaptation import json_safe
from piezoest.bench.campaign import store_in
from piezoest.bench.origin import origin, put
from piezoest.bench.suite_command import counting
from piezoest.bench.zoo import judging
from piezoest.bench.zoo.contenders import DEFAULT
from piezoest.bench.zoo.summary import CRITERIA, summarise
from piezoest.bench.zoo.tasks import carry_out_all, runs

Row = dict[str, Any]

CONTROLLERS = {"controller": DEFAULT, "line": "straight_line:straight_line"}
# A leg is half a wave of the reference. Called less often, or told later, nobody can follow it closely.
CALLS, LATE = 16.0, 1.0 / 16.0
FEATURES = ("family", "reference", "fault", "mode", "mechanics")
SPANS = ("amplitude", "frequency", "gain", "width", "sample_rate", "delay", "block", "sensor_noise", "creep")
# Levels of the curve of a distribution; many where it ends, which is what matters.
LEVELS = (*np.linspace(0.0, 0.9, 46), *np.linspace(0.9, 0.99, 19)[1:], *np.linspace(0.99, 1.0, 21)[1:])
COLOURS = {"controller": "#D55E00", "line": "#0072B2"}
NAMES = {"controller": "AdaptiveFeedforward", "line": "the straight line alone"}
STYLES = {"all": "-", "healthy": "--", "often": ":"}
GROUPS = {"all": "all runs", "healthy": "healthy rigs", "often": "called often"}


def often(row: Row) -> bool:
    """Whether a controller is called often enough, and told soon enough, to follow the reference."""
    leg = 0.5 * row["sample_rate"] / row["frequency"]
    return bool(leg / row["block"] >= CALLS and row["delay"] < LATE * leg)


# Name of a group and whether a run is one of it.
PARTS: dict[str, Callable[[Row], bool]] = {
    "all": lambda row: True,
    "healthy": lambda row: bool(row["fault"] == "none"),
    "often": often,
}


def judged(rows: Sequence[Row], column: str = "ratio") -> list[float]:
    """Ratios that count."""
    return [row[column] for row in rows if row.get(column) is not None]


def part(rows: Sequence[Row]) -> Row:
    """Violations, quantiles and the curve of a group."""
    found = summarise(rows)
    ratios = judged(rows)
    return {
        "runs": len(rows),
        "judged": len(ratios),
        "violations": found["violations"],
        "quantiles": {name: found["quantiles"][name] for name in ("ratio", "last_ratio")},
        "curve": [float(f"{value:.4g}") for value in np.quantile(ratios, LEVELS)] if ratios else [],
    }


def table(rows: Sequence[Row], *names: str) -> list[Row]:
    """Median of the ratio and count above 1, for each value of some columns."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    found = []
    for key, group in sorted(groups.items()):
        ratios = judged(group)
        found.append(
            {
                **dict(zip(names, key, strict=True)),
                "runs": len(group),
                "judged": len(ratios),
                "median": float(f"{np.median(ratios):.4g}") if ratios else None,
                "over": sum(map(CRITERIA["ratio"], group)),
                "over_last": sum(map(CRITERIA["last_ratio"], group)),
            }
        )
    return found


def summed_up(rows: Sequence[Row]) -> Row:
    """All that the page shows of one controller."""
    marked = [{**row, "often": often(row)} for row in rows]
    return {
        **{name: part([row for row in marked if belongs(row)]) for name, belongs in PARTS.items()},
        "by_fault": table(marked, "fault"),
        "by_mode": table(marked, "fault", "mode"),
        "by_family_and_reference": table(marked, "family", "reference"),
        "by_family": table(marked, "family"),
        "by_reference": table(marked, "reference"),
        "by_mechanics": table(marked, "mechanics"),
        "by_often": table(marked, "often"),
        "worst": summarise(marked)["worst"],
    }


def drawn(rows: Sequence[Row]) -> Row:
    """What was drawn, counted: names with their runs, numbers with their range."""
    names = {name: [row[name] for row in rows] for name in FEATURES}
    limits = [f"{row['low']:g} to {row['high']:g}" for row in rows]
    return {
        **{name: {each: of.count(each) for each in sorted(set(of))} for name, of in names.items()},
        "limits": {each: limits.count(each) for each in sorted(set(limits))},
        "spans": {name: [min(row[name] for row in rows), max(row[name] for row in rows)] for name in SPANS},
    }


def played(controller: str, seeds: range, folder: Path, workers: int | None) -> list[Row]:
    """Rows of a controller, of which those that are known are not made again."""
    tasks = runs(controller, seeds)
    with store_in(folder) as store, counting(f"runs of {controller}") as count:
        carry_out_all(tasks, store, workers, count)
        return list(store.rows(task.key for task in tasks))


def draw(document: Row, path: Path) -> None:
    """Draw how large a part of the runs has a ratio above any value."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = figure.subplots()
    above = 1.0 - np.array(document["levels"])
    least = 1.0 / document["runs"]
    for name, colour in COLOURS.items():
        for group, style in STYLES.items():
            curve = document[name][group]["curve"]
            if curve:
                label = f"{NAMES[name]}, {GROUPS[group]}"
                axes.plot(curve, np.maximum(above, least), style, color=colour, lw=1.3, label=label)
    axes.axvline(1.0, color="0.4", lw=0.8)
    axes.set(
        xscale="log", yscale="log", ylim=(0.8 * least, 1.1),
        xlabel="ratio of the errors", ylabel="part of the runs above it",
    )  # fmt: skip
    axes.legend(fontsize=8, loc="lower left")
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path, dpi=110, metadata={"Software": None})


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000, help="rigs, one for each seed")
    parser.add_argument("--seed", type=int, default=0, help="the first one")
    parser.add_argument("--workers", type=int, help="processes; default one for each core")
    parser.add_argument("--out", type=Path, default=Path("bench-results-safety"), help="of finished runs")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--figure", type=Path)
    arguments = parser.parse_args(given)
    if arguments.runs < 1:
        parser.error("--runs must be at least 1")

    began = time.perf_counter()
    # Where the controller of the comparison is found, also by the processes of the workers.
    if (here := str(Path(__file__).resolve().parent)) not in sys.path:
        sys.path.insert(0, here)
    seeds = range(arguments.seed, arguments.seed + arguments.runs)
    rows = {
        name: played(controller, seeds, arguments.out, arguments.workers)
        for name, controller in CONTROLLERS.items()
    }
    document = {
        "suite": "safety",
        **origin(began),
        "runs": arguments.runs,
        "seed": arguments.seed,
        "controllers": CONTROLLERS,
        "criteria": {
            "line": judging.ALLOWED, "noise": judging.NOISES, "swing": judging.NEGLIGIBLE,
            "calls": CALLS, "late": LATE,
        },
        "drawn": drawn(rows["controller"]),
        "levels": [round(float(level), 6) for level in LEVELS],
        **{name: summed_up(each) for name, each in rows.items()},
    }  # fmt: skip
    document = json.loads(json.dumps(json_safe(document)))
    put(document, arguments.json)
    if arguments.figure is not None:
        draw(document, arguments.figure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
