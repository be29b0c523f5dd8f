"""`piezoest bench` itself, and `piezoest bench compare`."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from piezoest._errors import INTERRUPTED
from piezoest._files import write_text
from piezoest._options import grouped
from piezoest.bench.origin import origin
from piezoest.bench.shared import Html, check_html, json_target, progress, write_html

if TYPE_CHECKING:
    from piezoest.bench.campaign import Execute

FOLDER, QUICK_FOLDER = Path("bench-results"), Path("bench-results-quick")
SEEDS = 5
WORSE = 1  # exit code of `compare --fail-if-worse`

COMPARE_EPILOG = "Example: piezoest bench compare before after --json changes.json"

Jobs = Annotated[int | None, typer.Option("--jobs", min=1, help="Processes; default one for each core.")]
Dask = Annotated[bool, typer.Option("--dask", help="Run on Dask, on this machine's cores.")]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Run on the Dask cluster of this scheduler: tcp://10.0.0.1:8786."),
]
Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write JSON; - prints it instead of the tables.")
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Runs:
    """What is run."""

    estimator: Annotated[
        list[str] | None,
        typer.Option(
            "--estimator",
            "-e",
            metavar="NAME|MODULE:CLASS",
            help='Beside the package\'s; may have arguments: "HysteresisRLS(memory=0.4)", and be repeated.',
        ),
    ] = None
    only: Annotated[
        list[str] | None,
        typer.Option(help="Only this one in the place of the package's; may be repeated."),
    ] = None
    scenario: Annotated[
        list[str] | None,
        typer.Option("--scenario", "-s", help="Only this one; may be repeated. Default all."),
    ] = None
    logs: Annotated[
        str | None,
        typer.Option(metavar="DIR|PATTERN", help="Recorded logs (CSV) in the place of the scenarios."),
    ] = None
    seeds: Annotated[
        int | None,
        typer.Option(min=1, help=f"Runs of each scenario and estimator; default {SEEDS}, quick 1."),
    ] = None
    quick: Annotated[
        bool, typer.Option("--quick", help="Short runs at 2 kHz with one seed: under a minute on two cores.")
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """Where results go."""

    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help=f"Folder of the results; default {FOLDER}."),
    ] = None
    table: Annotated[
        str | None, typer.Option(help="parquet or csv; default Parquet where pyarrow is installed.")
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Ring:
    """What all runs share."""

    sample_rate: Annotated[float | None, typer.Option(min=2000.0, help="Hz; default 5000.")] = None
    stage: Annotated[str, typer.Option(help="paper or preisach.")] = "paper"
    guard: Annotated[bool, typer.Option("--guard", help="With the supervisor of the ring.")] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """How results are shown."""

    scenarios: Annotated[bool, typer.Option("--by-scenario", help="Print each scenario's table.")] = False
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="DIR", help="Draw how fast each adapts, as PNG.")
    ] = None
    html: Html = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """On what the runs are made."""

    jobs: Jobs = None
    dask: Dask = False
    scheduler: Scheduler = None


@grouped
def suite(
    context: typer.Context,
    runs: Runs,
    written: Written,
    ring: Ring,
    shown: Shown,
    where: Where,
    json_to: Json = None,
) -> None:
    """Compare estimators on the simulated stage.

    Without a command: all scenarios × all estimators × seeds, in parallel. Finished runs are kept in the
    output folder: stopped and started again, it goes on where it was. There are then runs and periods as
    tables (Parquet or CSV), and suite.json with machine, versions and medians.

    [bold]Examples[/bold]

    A look at all of it:  [cyan]piezoest bench --quick[/cyan]

    An estimator of your own beside the rest:  [cyan]piezoest bench -e my_module:MyEstimator[/cyan]

    Before and after a change:  [cyan]piezoest bench -o before[/cyan],  [cyan]piezoest bench -o after[/cyan],
    then  [cyan]piezoest bench compare before after[/cyan]

    A fleet of recorded stages:  [cyan]piezoest bench --logs fleet/ --dask[/cyan]

    A cluster:  [cyan]piezoest bench --seeds 1000 --scheduler tcp://10.0.0.1:8786[/cyan]
    """
    if context.invoked_subcommand is not None:
        if given := _given(context):
            raise typer.BadParameter(
                f"{', '.join(given)} belong to the suite: write them after {context.invoked_subcommand}, "
                "if it has them, or leave it out"
            )
        return

    target = json_target(json_to)
    check_html(shown.html)
    folder = written.output or (QUICK_FOLDER if runs.quick else FOLDER)
    began = time.perf_counter()
    with usage():
        with progress() as say:
            say("loading (compiles once after the installation)")
            from piezoest.bench import campaign, suite, tables
            from piezoest.bench.recorded import logs_of
            from piezoest.bench.runner import QUICK, Settings
            from piezoest.bench.scenarios import SCENARIOS

            stage: Any = ring.stage
            settings = QUICK if runs.quick else Settings()
            settings = replace(settings, stage=stage, guard=ring.guard)
            if ring.sample_rate is not None:
                settings = replace(settings, sample_rate=ring.sample_rate)
            named = [*(runs.only or campaign.default_estimators()), *(runs.estimator or [])]
            numbers = range(runs.seeds or (1 if runs.quick else SEEDS))
            logs = logs_of(runs.logs) if runs.logs else []
            places = [*(runs.scenario or ([] if runs.logs else SCENARIOS)), *logs]
            tasks = campaign.plan(places, named, numbers, settings)
            format = tables.checked_format(written.table)
        execute = executor(where, named)
        try:
            with campaign.store_in(folder) as store, counting("runs") as count:
                campaign.run(tasks, store, execute, count)
                tables.write_tables(store.rows(campaign.keys_of(tasks)), folder, format)
                document = suite.describe(tasks, store, settings, origin(began))
        except KeyboardInterrupt:
            Console(stderr=True).print(f"stopped: the same command goes on from {folder}")
            raise typer.Exit(INTERRUPTED) from None
    suite.write(document, folder / suite.DOCUMENT)
    write_html(document, shown.html)
    if shown.figures is not None:
        from piezoest.bench.ranking_figures import write_adaptation

        for path in write_adaptation(document, shown.figures):
            typer.echo(f"Figure: {path}", err=json_to == "-")
    if json_to == "-":
        typer.echo(json.dumps(document, indent=1, ensure_ascii=False))
        return
    from piezoest.bench.suite_report import print_overview

    print_overview(document, Console(), scenarios=shown.scenarios)
    typer.echo(f"Tables and {suite.DOCUMENT}: {folder}")
    if target is not None:
        suite.write(document, target)
        typer.echo(f"JSON: {target}")


def compare(
    before: Annotated[Path, typer.Argument(metavar="A", help="Folder of a campaign.")],
    after: Annotated[Path, typer.Argument(metavar="B", help="Folder of another.")],
    level: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Part of the changes found that may be none.")
    ] = 0.05,
    relevant: Annotated[float, typer.Option(min=0.0, help="Least change that counts, in parts.")] = 0.01,
    everything: Annotated[bool, typer.Option("--all", help="Print what did not change too.")] = False,
    fail_if_worse: Annotated[
        bool, typer.Option("--fail-if-worse", help=f"Exit with {WORSE} if something became worse.")
    ] = False,
    json_to: Json = None,
) -> None:
    """What changed from campaign A to campaign B, and whether beyond the noise.

    Runs are paired by scenario, estimator and seed; each number is put to a Wilcoxon signed-rank test, and
    the number of comparisons is allowed for by the false discovery rate.
    """
    target = json_target(json_to)
    with usage():
        from piezoest.bench import changes, suite, tables

        documents = suite.read(before), suite.read(after)
        changes.check_settings(*documents)
        found = changes.compare(
            tables.read_runs(before), tables.read_runs(after), level=level, relevant=relevant
        )
    document = {"suite": "changes", "A": _side(documents[0]), "B": _side(documents[1]), **found}
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    if json_to == "-":
        typer.echo(text)
    else:
        from piezoest.bench.suite_report import print_changes

        print_changes(document, Console(), everything=everything)
        if target is not None:
            write_text(target, text + "\n")
            typer.echo(f"JSON: {target}")
    if fail_if_worse and document["counts"].get("worse"):
        raise typer.Exit(WORSE)


def executor(where: Where, estimators: list[str]) -> Execute:
    """Where runs are made: on the cores, or on Dask where that is asked for."""
    from piezoest.bench import campaign

    if where.scheduler is not None or where.dask:
        return campaign.over_dask(where.scheduler, where.jobs, estimators)
    return campaign.over_cores(where.jobs)


@contextlib.contextmanager
def counting(what: str) -> Iterator[Callable[[int, int], None]]:
    """A function that shows how many of how many are done: a bar on a terminal, or else some lines."""
    console = Console(stderr=True)
    began = time.perf_counter()
    if not console.is_terminal:
        said: list[int] = []

        def line(done: int, of: int) -> None:
            # Some twenty lines where stderr is a file.
            if not said or done == of or done * 20 // of > said[-1] * 20 // of:
                said.append(done)
                seconds = time.perf_counter() - began
                print(f"{done} of {of} {what}, {seconds:.0f} s", file=sys.stderr, flush=True)

        yield line
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task(what, total=None)
        yield lambda done, of: progress.update(bar, completed=done, total=of)


@contextlib.contextmanager
def usage() -> Iterator[None]:
    """Turn a wrong name or value into a message, exit code 2, and an interruption into 130."""
    try:
        yield
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None


def _given(context: typer.Context) -> list[str]:
    """Options of the suite that were written before a command."""
    found = []
    for parameter in context.command.params:
        source = context.get_parameter_source(str(parameter.name))
        if source is not None and source.name == "COMMANDLINE":
            found.append(parameter.opts[0])
    return found


def _side(document: dict[str, Any]) -> dict[str, Any]:
    from piezoest.bench.suite import HEAD

    return {name: document[name] for name in HEAD}
