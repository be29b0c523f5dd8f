"""`piezoest bench` itself, and `piezoest bench compare`."""

import dataclasses
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from piezoest._errors import USER_ERROR
from piezoest._files import read_json
from piezoest._options import examples, grouped
from piezoest._progress import LOADING, progress
from piezoest.bench import shared
from piezoest.bench.origin import json_safe, origin, put

FOLDER, QUICK_FOLDER = Path("bench-results"), Path("bench-results-quick")
DOCUMENT = "table.json"
SEEDS, SLOW_SEEDS = 30, 10
HEAD = ("date", "machine", "versions", "code", "runs")

EPILOG = examples(
    "piezoest bench --quick",
    "piezoest bench -e my_module:MyEstimator",
    'piezoest bench --only HysteresisRLS -e "HysteresisRLS(memory=0.2)"',
    "piezoest bench -o before",
    "piezoest bench -o after",
    "piezoest bench compare before after",
    "piezoest bench --logs folder/",
)
COMPARE_EPILOG = examples("piezoest bench compare before after --json changes.json")


@dataclass(frozen=True, slots=True, kw_only=True)
class Runs:
    """What is run."""

    estimator: Annotated[
        list[str] | None,
        typer.Option(
            "--estimator",
            "-e",
            metavar="NAME|MODULE:CLASS",
            help="One more beside the package's, also with arguments, as in the examples; may be repeated.",
        ),
    ] = None
    only: Annotated[
        list[str] | None, typer.Option(help="Only this one instead of all of the package's; may be repeated.")
    ] = None
    scenario: Annotated[
        list[str] | None,
        typer.Option("--scenario", "-s", help="Only this one; may be repeated. Default: all."),
    ] = None
    stage: Annotated[
        list[str] | None,
        typer.Option(help="Only this one; may be repeated. Default: paper, and three of other families."),
    ] = None
    logs: Annotated[
        str | None,
        typer.Option(metavar="DIR|PATTERN", help="Recorded logs (CSV) instead of the scenarios."),
    ] = None
    seeds: Annotated[
        int | None,
        typer.Option(min=1, help=f"Runs of each; default {SEEDS}. Of slow estimators at most {SLOW_SEEDS}."),
    ] = None
    tune: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Add each with tuned settings: the best of N, on other seeds."),
    ] = None
    sample_rate: Annotated[float | None, typer.Option(min=2000.0, help="Hz; default 5000.")] = None
    quick: Annotated[
        bool, typer.Option("--quick", help="A first look: short runs at 2 kHz, one seed, the paper's stage.")
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class How:
    """On what the runs are made, and where results go."""

    jobs: shared.Processes = None
    dask: Annotated[bool, typer.Option("--dask", help="Run on Dask, on this machine's cores.")] = False
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Run on a Dask cluster: tcp://10.0.0.1:8786.")
    ] = None

    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help=f"Folder of the results; default {FOLDER}."),
    ] = None
    table: shared.Format = None
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", file_okay=False, help="Draw the figures, as PNG."),
    ] = None
    html: shared.Html = None


@grouped
def table(context: typer.Context, runs: Runs, how: How, json_to: shared.Json = None) -> None:
    """Compare estimators: scenarios × stages × estimators × seeds, in parallel, beside linear feed-forward.

    Finished runs are kept in the output folder: if you stop the command and start it again, it continues. The
    results are the tables runs and periods (Parquet or CSV), and table.json: machine, versions, medians.
    """
    if context.invoked_subcommand is not None:
        given = [each.opts[0] for each in context.command.params if _is_written(context, each.name)]
        if given:
            raise typer.BadParameter(
                f"write {', '.join(given)} after {context.invoked_subcommand}, if it has them"
            )
        return

    shared.check(json_to, how.html)
    folder = how.output or (QUICK_FOLDER if runs.quick else FOLDER)
    from piezoest.bench.report import print_table

    began = time.perf_counter()
    document = _run(runs, how, folder, began)
    put(document, folder / DOCUMENT)
    shared.write_html(document, how.html)
    if how.figures is not None:
        from piezoest.bench.figures import drawings, write_figures

        write_figures(drawings(document), how.figures, quiet=json_to == "-")
    shared.show(document, json_to, print_table, f"Tables and {DOCUMENT}: {folder}")
    if document["all_failed"]:
        raise typer.Exit(USER_ERROR)


def _is_written(context: typer.Context, name: Any) -> bool:
    """Whether an option is on the command line."""
    source = context.get_parameter_source(str(name))
    return source is not None and source.name == "COMMANDLINE"


def _run(runs: Runs, how: How, folder: Path, began: float) -> dict[str, Any]:
    """Run what is missing, write the tables, and sum them up."""
    with shared.usage(folder):
        with progress("", lines=True) as say:
            say(LOADING)
            from piezoest.bench import table, tables
            from piezoest.bench.executors import quiet
            from piezoest.bench.store import played
            from piezoest.bench.tuning import tune

            tables.checked_format(how.table)
            plan = _plan(runs)
        execute = table.over_cores(how.jobs)
        if how.dask or how.scheduler is not None:
            execute = table.over_dask(how.scheduler, how.jobs, plan.estimators)
        play = partial(played, folder=folder, execute=execute)
        tuned: list[dict[str, Any]] = []
        if runs.tune is not None:
            with progress("runs to tune by", lines=True) as say:
                tuned = tune(plan.estimators, runs.tune, plan.given, partial(play, progress=say.done))
            # Beside the others, where these are not the defaults.
            chosen = (each["chosen"] for each in tuned if each["chosen"] != each["default"])
            plan = dataclasses.replace(plan, tuned=tuple(dict.fromkeys(chosen)))
        with progress("runs", lines=True) as say:
            rows = play(plan.tasks(), progress=say.done)
        table.write(rows, folder, how.table)
        with progress("", lines=True) as say, quiet():
            say("timing each estimator alone")
            times = {} if runs.logs else table.costs(plan.everything[1:], plan.given)
            say("summing up")
            document = table.describe(rows, plan, times)
    return {**document, **origin(began), "tuned": json_safe(tuned, table.DIGITS)}


def _plan(runs: Runs) -> Any:
    from piezoest.bench import table
    from piezoest.bench.cases import PAPER, STRANGERS
    from piezoest.bench.estimators import KNOWN, defaults
    from piezoest.bench.recorded import logs_of
    from piezoest.bench.scenarios import SCENARIOS

    given = dict(table.QUICK) if runs.quick else {}
    if runs.sample_rate is not None:
        given["sample_rate"] = runs.sample_rate
    logs = logs_of(runs.logs) if runs.logs else []
    named = [KNOWN.get(name, name) for name in runs.only] if runs.only else defaults(drivers=not logs)
    seeds = runs.seeds or (1 if runs.quick else SEEDS)
    return table.Plan(
        estimators=tuple(dict.fromkeys([*named, *(runs.estimator or [])])),
        scenarios=(*(runs.scenario or ([] if runs.logs else SCENARIOS)), *logs),
        stages=tuple(runs.stage or ([PAPER] if runs.quick else [PAPER, *STRANGERS])),
        seeds=seeds,
        slow_seeds=min(seeds, SLOW_SEEDS),
        given=given,
    )


@grouped
def compare(
    before: Annotated[Path, typer.Argument(metavar="A", help="Folder of a campaign.")],
    after: Annotated[Path, typer.Argument(metavar="B", help="Folder of another.")],
    everything: Annotated[bool, typer.Option("--all", help="Print what did not change too.")] = False,
    json_to: shared.Json = None,
) -> None:
    """What changed from campaign A to campaign B, and whether beyond the noise.

    Runs are paired by scenario, stage, estimator and seed; each number is put to Wilcoxon's signed-rank test,
    and the number of comparisons is allowed for: of the reported changes at most 5 % are false alarms. Where
    that cannot be told the change is within noise, and below 1 % it is negligible.
    """
    shared.check(json_to)
    from piezoest.bench import compare as comparison
    from piezoest.bench import tables
    from piezoest.bench.report import print_changes
    from piezoest.bench.run import COLUMNS
    from piezoest.bench.table import RUNS

    documents = _read(before), _read(after)
    comparison.check_conditions(*documents)
    sides = [tables.read_table(folder, RUNS, COLUMNS) for folder in (before, after)]
    heads = ({name: document[name] for name in HEAD} for document in documents)
    document = {"suite": "changes", **dict(zip("AB", heads, strict=True)), **comparison.compare(*sides)}
    shared.show(document, json_to, partial(print_changes, everything=everything))


def _read(folder: Path) -> dict[str, Any]:
    """Document of a campaign's folder."""
    path = folder / DOCUMENT
    if not path.exists():
        raise ValueError(f"{folder} holds no {DOCUMENT}: no campaign of piezoest bench was finished there")
    match read_json(path):
        case {"conditions": {}, **rest} as document if all(name in rest for name in HEAD):
            return dict(document)
    raise ValueError(f"{path} is not what piezoest bench writes")
