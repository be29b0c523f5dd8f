"""The default controller, and what is left of it without its parts, on the rigs of `piezoest bench safety`.

Every run follows from its seed. Finished runs are kept in the folder; started again, the same command does
the rest. What is written sums them up and is as small for many runs as for few.

    python benchmarks/safety.py [--runs N] [--others N] [--map N] [--singles N] [--dwell N] [--jobs N]
                                [--output DIR] [--json FILE] [--figure FILE]

A run takes about half a second.
"""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from piezoest._files import save_figure
from piezoest._progress import progress
from piezoest.bench.figures import new_figure
from piezoest.bench.origin import json_safe, origin, put
from piezoest.bench.store import played
from piezoest.bench.table import DIGITS
from piezoest.bench.zoo import contenders, dwelling, judging, settling, tasks
from piezoest.bench.zoo.contest import contest, summarise_contest
from piezoest.bench.zoo.summary import counts, grouped, summarise, values
from piezoest.bench.zoo.tasks import Task, over_cores
from piezoest.bench.zoo.words import DRAWN, SPANS

Row = dict[str, Any]
Count = Annotated[int, typer.Option(min=1)]

DEFAULT = contenders.DEFAULT
CONTROLLERS = {
    "controller": DEFAULT, "no_corridor": "no-corridor", "line": "line", "parts": contenders.PARTS,
}  # fmt: skip
# A leg is half a wave of the reference. Called less often, or told later, nobody can follow it closely.
CALLS, LATE = 16.0, 1.0 / 16.0
# Levels of the curve of a distribution; many where it ends, which is what matters.
LEVELS = (*np.linspace(0.0, 0.9, 46), *np.linspace(0.9, 0.99, 19)[1:], *np.linspace(0.99, 1.0, 21)[1:])
# Columns of the tables about each contender.
CROSSED = {
    "by_fault": ("fault",), "by_mode": ("fault", "mode"), "by_family_and_reference": ("family", "reference"),
    "by_family": ("family",), "by_reference": ("reference",), "by_mechanics": ("mechanics",),
    "by_often": ("often",),
}  # fmt: skip
# Which runs are drawn, and how.
CURVES = {
    ("controller", "all"): ("AdaptiveFeedforward, all runs", "#D55E00", "-"),
    ("controller", "healthy"): ("AdaptiveFeedforward, healthy rigs", "#D55E00", "--"),
    ("controller", "often"): ("AdaptiveFeedforward, called often", "#D55E00", ":"),
    ("no_corridor", "all"): ("without corridor, all runs", "#CC79A7", "-"),
    ("line", "all"): ("without candidates, all runs", "#0072B2", "-"),
    ("parts", "all"): ("by hand, all runs", "#888888", "-"),
}


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


def part(rows: Sequence[Row]) -> Row:
    """Violations, quantiles and the curve of a group."""
    found, ratios = summarise(rows), values(rows, "ratio")
    return {
        "runs": len(rows),
        "judged": len(ratios),
        "violations": found["violations"],
        "quantiles": {name: found["quantiles"][name] for name in ("ratio", "cycle_ratio", "last_ratio")},
        "curve": np.quantile(ratios, LEVELS).tolist() if ratios else [],
    }


def summed_up(rows: Sequence[Row]) -> Row:
    """What the page shows of a contender."""
    marked = [{**row, "often": often(row)} for row in rows]
    return {
        **{name: part(list(filter(belongs, rows))) for name, belongs in PARTS.items()},
        **{name: grouped(marked, *columns, of=counts) for name, columns in CROSSED.items()},
        "worst": summarise(rows)["worst"],
    }


def drawn(rows: Sequence[Row]) -> Row:
    """What was drawn, counted: names with their runs, numbers with their range."""
    marked = [{**row, "limits": f"{row['low']:g} to {row['high']:g}"} for row in rows]
    return {
        **{name: dict(sorted(Counter(row[name] for row in marked).items())) for name in DRAWN},
        "spans": {name: [min(row[name] for row in rows), max(row[name] for row in rows)] for name in SPANS},
    }


def draw(document: Row, path: Path) -> None:
    """Draw how large a part of the runs has a ratio above any value."""
    figure = new_figure(6.0, 4.6)
    axes = figure.subplots()
    above, least = 1.0 - np.array(document["levels"]), 1.0 / document["runs"]
    for (name, group), (label, color, style) in CURVES.items():
        if curve := document[name][group]["curve"]:
            axes.plot(curve, np.maximum(above, least), style, color=color, lw=1.3, label=label)
    axes.axvline(1.0, color="0.4", lw=0.8)
    axes.set(
        xscale="log", yscale="log", ylim=(0.8 * least, 1.1),
        xlabel="ratio of the errors", ylabel="part of the runs above it",
    )  # fmt: skip
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    save_figure(figure, path, dpi=130, metadata={"Software": None})


def main(
    runs: Count = 2000, others: Count | None = None, map: int = 0, singles: int = 0, dwell: int = 0,
    seed: int = 0, jobs: Annotated[int | None, typer.Option("--jobs", "--workers")] = None,
    output: Annotated[Path, typer.Option("--output")] = Path("bench-results-safety"),
    json: Path | None = None, figure: Path | None = None,
) -> None:  # fmt: skip
    """Play RUNS rigs, one for each seed from SEED on, and OTHERS for what it is compared with.

    Besides, MAP seeds for each place of the map, SINGLES for each family and reference, and DWELL rigs that
    rest for a minute; in JOBS processes, one for each core. Finished runs are kept in OUTPUT.
    """
    began = time.perf_counter()
    others = min(runs, others or runs)
    execute = over_cores(jobs)

    def play(what: str, planned: Sequence[Task]) -> list[Row]:
        with progress(f"runs of {what}", lines=True) as say:
            return played(planned, output, execute, say.done)

    rows = {}
    for name, controller in CONTROLLERS.items():
        count = runs if name == "controller" else others
        rows[name] = play(controller, tasks.runs(controller, range(seed, seed + count)))
    on_map = play("the map", tasks.tasks(DEFAULT, settling.cells(range(map))))
    rested = play("rests", tasks.tasks(DEFAULT, dwelling.dwells(range(seed, seed + dwell))))
    alone = play("single estimators", contest(DEFAULT, range(singles)))
    document = {
        "suite": "safety",
        **origin(began),
        "runs": runs,
        "others": others,
        "seed": seed,
        "controllers": CONTROLLERS,
        "criteria": {
            "line": judging.ALLOWED, "noise": judging.NOISES, "swing": judging.NEGLIGIBLE,
            "calls": CALLS, "late": LATE, "back": judging.BACK, "soon": settling.SOON,
            "enough": settling.ENOUGH, "settled": settling.SETTLED, "slow": settling.SLOW,
            "large": settling.LARGE,
        },
        "drawn": drawn(rows["controller"]),
        "levels": [round(float(level), 6) for level in LEVELS],
        **{name: summed_up(each) for name, each in rows.items()},
        "map": {"seeds": map, **settling.summarise_cells(on_map)} if on_map else None,
        "singles": summarise_contest(alone, DEFAULT) if alone else None,
        "dwell": dwelling.summarise_dwells(rested) if rested else None,
    }  # fmt: skip
    document = json_safe(document, DIGITS)
    put(document, json)
    if figure is not None:
        draw(document, figure)


if __name__ == "__main__":
    typer.run(main)
