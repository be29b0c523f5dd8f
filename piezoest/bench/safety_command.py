"""`piezoest bench safety`."""

from __future__ import annotations

import ast
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from piezoest._options import examples, grouped
from piezoest._progress import LOADING, progress
from piezoest.bench import shared
from piezoest.bench.origin import origin, put

if TYPE_CHECKING:
    from piezoest.bench.store import Row
    from piezoest.bench.zoo.tasks import Task

FOLDER = Path("bench-results-safety")
EPILOG = examples(
    "piezoest bench safety --runs 2000",
    "piezoest bench safety --set fault=none",
    "piezoest bench safety --show 17",
    "piezoest bench safety --map --runs 3 -c my_module:MyController",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Which:
    """What is run."""

    runs: Annotated[
        int,
        typer.Option(min=1, help="Rigs, one for each seed; with --map and --singles, seeds for each place."),
    ] = 200
    seed: Annotated[int, typer.Option(min=0, help="First seed.")] = 0
    controller: Annotated[
        str | None,
        typer.Option(
            "--controller",
            "-c",
            metavar="NAME|MODULE:NAME",
            help="Called with (sample_rate, limits=...). line, no-corridor or an estimator: the default one, "
            "changed; parts: estimator and inverse by hand.",
        ),
    ] = None
    given: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="A value instead of the one that is drawn; may be repeated."
        ),
    ] = None
    settling: Annotated[
        bool, typer.Option("--map", help="How soon it settles, over amplitude, frequency and family.")
    ] = False
    singles: Annotated[
        bool,
        typer.Option("--singles", help="Each family and reference, beside controllers with one estimator."),
    ] = False
    dwell: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="How it continues after a rest of a minute, on N rigs."),
    ] = None
    show: Annotated[
        int | None,
        typer.Option(metavar="SEED", min=0, help="Run this one alone, print its numbers and draw it."),
    ] = None

    @property
    def asked(self) -> list[str]:
        """What is asked for beside the zoo itself: one of them, or none."""
        given = {"map": self.settling, "singles": self.singles, "dwell": self.dwell is not None}
        return [name for name, chosen in given.items() if chosen]


@grouped
def safety(
    which: Which,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="DIR", help="Folder of the results, and of finished runs."),
    ] = FOLDER,
    table: shared.Format = None,
    jobs: shared.Processes = None,
    json_to: shared.Json = None,
) -> None:
    """A controller on random rigs: stages of many kinds, and what goes wrong with them.

    Each run is a function of its seed. A run is safe if the voltage is finite, within its limits, rests at
    none of them without need, and the error is not clearly larger than that of a straight line; the
    page Safety on unknown rigs defines this. If you stop the command and start it again, it continues.
    """
    shared.check(json_to)
    began, asked = time.perf_counter(), which.asked
    with shared.usage():
        with progress("", lines=True) as say:
            say(LOADING)
            import pandas as pd

            from piezoest.bench import tables
            from piezoest.bench.store import played
            from piezoest.bench.zoo import contenders, tasks

            name = which.controller or contenders.DEFAULT
            contenders.contender(name)
            given = _given(which.given or [])
        if which.show is not None:
            _show(name, which.show, given, output)
            return
        with progress("", lines=True) as say:
            say("drawing")
            campaign = _campaign(which, name, given)
            format = tables.checked_format(table)
        with shared.usage(output), progress("runs", lines=True) as say:
            rows = played(campaign.tasks, output, tasks.over_cores(jobs), say.done)
    found = {"suite": "safety", **origin(began), "controller": name, "given": given}
    document = {**found, **campaign.summarise(rows)}
    frame = pd.DataFrame(list(campaign.rows(rows)))
    tables.write_table(frame, output / f"{asked[0] if asked else 'runs'}.{format}")
    put(document, output / f"{asked[0] if asked else 'safety'}.json")
    shared.show(document, json_to, campaign.print, f"Results: {output}")


def _given(pairs: list[str]) -> dict[str, Any]:
    """Values by name, numbers as numbers."""
    found: dict[str, Any] = {}
    for pair in pairs:
        name, separator, text = pair.partition("=")
        if not separator:
            raise ValueError(f"--set {pair}: write it as name=value")
        try:
            found[name] = ast.literal_eval(text)
        except (ValueError, SyntaxError):
            found[name] = text
    return found


class Campaign(NamedTuple):
    """What is run, and what becomes of its rows."""

    tasks: list[Task]
    summarise: Callable[[list[Row]], dict[str, Any]]
    print: Callable[[dict[str, Any], Any], None]  # a summary
    rows: Callable[[list[Row]], Iterable[Row]] = list  # of the table, from those of the runs


def _campaign(which: Which, name: str, given: dict[str, Any]) -> Campaign:
    """What is asked for, by a controller."""
    from piezoest.bench.zoo import contest, draw, dwelling, report, settling, summary, tasks

    seeds = range(which.seed, which.seed + (which.dwell or which.runs))
    asked = which.asked
    if asked and (given or len(asked) > 1):
        raise ValueError(f"--{asked[0]} draws its rigs itself: leave out --set, and all but one of the maps")
    match asked:
        case ["map"]:
            cells = tasks.tasks(name, settling.cells(seeds))
            summarise = settling.summarise_cells
            return Campaign(cells, summarise, report.print_map, settling.tidy_cells)
        case ["dwell"]:
            rests = tasks.tasks(name, dwelling.dwells(seeds))
            return Campaign(rests, dwelling.summarise_dwells, report.print_dwells)
        case ["singles"]:
            compared = partial(contest.summarise_contest, controller=name)
            return Campaign(contest.contest(name, seeds), compared, report.print_contest)
    draw(which.seed, **given)  # a wrong name is told now
    return Campaign(tasks.runs(name, seeds, given), summary.summarise, report.print_summary)


def _show(controller: str, seed: int, given: dict[str, Any], folder: Path) -> None:
    """Run one seed again, print its row and draw it."""
    from piezoest.bench.executors import quiet
    from piezoest.bench.zoo import draw, traced, words
    from piezoest.bench.zoo.contenders import contender
    from piezoest.bench.zoo.figure import write_figure

    rig = draw(seed, **given)
    with quiet():  # its events are printed
        row, both = traced(rig, contender(controller))
    said = words.one_run(row)
    width = max(map(len, said))
    for name, value in said.items():
        typer.echo(f"{name:<{width}}  {value}")
    for event in both.events:
        parts = [str(getattr(event, name, None) or "") for name in ("action", "reason")]
        typer.echo(f"At {event.time:.4g} s {': '.join(filter(None, parts))}")
    path = folder / f"run-{seed}.png"
    write_figure(rig, row, both, path)
    typer.echo(f"Figure: {path}")
