"""`piezoest bench rank`."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from piezoest._errors import INTERRUPTED
from piezoest._files import write_text
from piezoest._options import grouped
from piezoest.bench.origin import origin
from piezoest.bench.shared import json_target, progress
from piezoest.bench.suite_command import Json, Where

FOLDER = Path("bench-results-ranking")
EPILOG = (
    "Examples: piezoest bench rank; piezoest bench rank --only HysteresisEKF -e my_module:MyEstimator; "
    "piezoest bench rank --json ranking.json --figures figures"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is tried of each estimator."""

    draws: Annotated[
        int, typer.Option(min=1, help="Settings tried of each beside its default: a power of two.")
    ] = 16
    training_seeds: Annotated[int, typer.Option(min=1, help="Seeds to tune on.")] = 2
    seeds: Annotated[int, typer.Option(min=1, help="Other seeds, to judge on.")] = 6
    slow_seeds: Annotated[
        int, typer.Option(min=1, help="The same for BatchFit and FilterPyUKF, the slow ones.")
    ] = 3


@grouped
def rank(
    *,
    estimator: Annotated[
        list[str] | None,
        typer.Option(
            "--estimator", "-e", metavar="MODULE:CLASS",
            help="Of your own, beside the package's, tuned within its tuning_space; may be repeated.",
        ),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(help="Only this estimator of the package; may be repeated.")
    ] = None,
    effort: Effort,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder where finished runs are kept.")
    ] = FOLDER,
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="DIR", help="Write pictures as PNG.")
    ] = None,
    where: Where,
    json_to: Json = None,
) -> None:  # fmt: skip
    """Rank estimators fairly: each tuned by the same budget, judged on seeds it was not tuned on.

    Stopped and started again, it goes on where it was.
    """
    from piezoest.bench.suite_command import counting, executor, usage

    target = json_target(json_to)
    began = time.perf_counter()
    with usage():
        with progress() as say:
            say("loading (compiles once after the installation)")
            from piezoest.bench import campaign, ranking, tuning

            candidates = tuning.tunables(estimator or [], only or [])
            for each in candidates:
                tuning.draws(each, effort.draws, 0)
            first = ranking.FIRST_TRAINING_SEED
            budget = ranking.Budget(
                draws=effort.draws,
                training_seeds=tuple(range(first, first + effort.training_seeds)),
                seeds=tuple(range(effort.seeds)),
                slow_seeds=tuple(range(min(effort.seeds, effort.slow_seeds))),
            )
        execute = executor(where, [each.default for each in candidates])
        try:
            with campaign.store_in(output) as store:
                with counting("training runs") as count:
                    tuned = ranking.tune(candidates, budget, store, execute, count)
                with counting("runs to judge by") as count:
                    rows = ranking.judge(tuned, budget, store, execute, count)
        except KeyboardInterrupt:
            Console(stderr=True).print(f"stopped: the same command goes on from {output}")
            raise typer.Exit(INTERRUPTED) from None
        with progress() as say:
            times = ranking.costs(tuned, budget, say)
    document = ranking.describe(tuned, rows, times, budget, origin(began))
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    if figures is not None:
        from piezoest.bench.ranking_figures import write_figures

        for path in write_figures(document, figures):
            typer.echo(f"Figure: {path}", err=json_to == "-")
    if json_to == "-":
        typer.echo(text)
        return
    _print(document, Console())
    if target is not None:
        write_text(target, text + "\n")
        typer.echo(f"JSON: {target}")


def _print(document: dict[str, Any], console: Console) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from piezoest.bench.suite_report import number, percent

    budget = document["budget"]
    table = Table(
        title=f"Tuned by {budget['draws']} draws on {len(budget['training_seeds'])} seeds, "
        f"judged on {len(budget['seeds'])} others",
        title_justify="left", box=SIMPLE_HEAD, show_edge=False,
    )  # fmt: skip
    table.add_column("estimator")
    for heading in ("adapting", "settled", "worst", "settles", "runs settled", "step"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_row("", "%", "%", "%", "s", "", "µs", style="dim", end_section=True)
    for line in document["overall"]:
        errors = [percent(line[name]) for name in ("adapting", "settled", "worst")]
        table.add_row(
            line["name"] + (" *" if line["efficient"] else ""), *errors, number(line["settling_time"]),
            f"{line['runs_settled']}/{line['runs']}", number(line["step_microseconds"]),
        )  # fmt: skip
    console.print(table)
    for each in document["candidates"]:
        console.print(f"{each['name']}: {each['chosen']}", highlight=False, markup=False, soft_wrap=True)
    for line in (
        "Errors in % of the amplitude, geometric means over the scenarios. Adapting: of each period after "
        "the change; settled: of the last three; worst: after the change. *: none is better in all of these "
        "and in cost.",
        *(f"failed: {failure}" for failure in document["failures"]),
    ):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
