"""`piezoest bench`: its commands. Heavy imports wait inside them."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import sys
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from piezoest import _extras
from piezoest.bench import adaptation_command, rank_command, suite_command

if TYPE_CHECKING:
    from piezoest.bench.estimators import Row, Scenario

app = typer.Typer(
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)

INTERRUPTED = 130

Html = Annotated[
    Path | None, typer.Option("--html", metavar="FILE", help="Write a page with interactive plots.")
]

app.callback(invoke_without_command=True)(suite_command.suite)
app.command(epilog=suite_command.COMPARE_EPILOG)(suite_command.compare)
app.command(epilog=rank_command.EPILOG)(rank_command.rank)
app.command(epilog=adaptation_command.EPILOG)(adaptation_command.adaptation)


@app.command(
    epilog="Examples: piezoest bench estimators; "
    "piezoest bench estimators --only HysteresisRLS --only HysteresisEKF --sample-rate 50000; "
    "piezoest bench estimators my_module:MyEstimator --json -"
)
def estimators(
    own: Annotated[
        list[str] | None,
        typer.Argument(metavar="[MODULE:CLASS]...", help="Estimators of your own, beside the package's."),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(help="Only this estimator of the package; may be repeated.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.4, help="Length of the run.")] = 3.0,
    sample_rate: Annotated[
        float,
        typer.Option(min=1000.0, help="Hz, for all alike; the paper's 50 000 takes minutes with filterpy."),
    ] = 10_000.0,
    seed: Annotated[int, typer.Option(min=0, help="Start of the random numbers of the stage.")] = 0,
    json_to: Annotated[
        str | None,
        typer.Option("--json", metavar="FILE", help="Write JSON; - prints it instead of the table."),
    ] = None,
    html: Html = None,
) -> None:
    """Settled error, time to settle and cost of every estimator, in the same ring.

    Each starts from the same wrong parameters and drives the inverse compensator of the simulated
    stage: a smoothed triangle of 5 µm at 5 Hz, noise and quantisation on.
    """
    target = _json_target(json_to)
    _check_html(html)
    try:
        with _progress() as say:
            say("loading (compiles once after the installation)")
            from piezoest.bench.estimators import Scenario, compare

            scenario = Scenario(seconds, sample_rate, seed)
            rows = compare(_chosen(own or [], only or []), scenario, say)
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    document = _document(scenario, rows)
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    _write_html(document, html)
    if json_to == "-":
        typer.echo(text)
        return
    _print(scenario, rows)
    if target is not None:
        target.write_text(text + "\n", encoding="utf-8")
        typer.echo(f"JSON: {target}")


@app.command(
    epilog="Examples: piezoest bench paper; piezoest bench paper --json paper.json --figures figures; "
    "piezoest bench paper --memory 0.4 --quick"
)
def paper(
    json_to: Annotated[
        str | None,
        typer.Option("--json", metavar="FILE", help="Write JSON; - prints it instead of the tables."),
    ] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="DIR", help="Write Figs. 3 to 5 and two more as PNG.")
    ] = None,
    memory: Annotated[
        float | None,
        typer.Option(
            min=0.01, max=20.0, help="Of the estimator [s]; the paper names none. Default: the calibration's."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Start of the random numbers of the stage.")] = 0,
    quick: Annotated[bool, typer.Option("--quick", help="Without the sweep over the memory.")] = False,
    workers: Annotated[
        int | None, typer.Option(min=0, help="Processes; default one for each processor, 0 for none.")
    ] = None,
    html: Html = None,
) -> None:
    """Tables I, II and III of the paper beside those of the simulated stage.

    The paper's procedure at 50 kHz: each row adapts while it runs, until it is stationary. The stage was
    calibrated to the rows marked calibration; it has never seen those marked held out.
    """
    target = _json_target(json_to)
    _check_html(html)
    if figures is not None and (figures.exists() and not figures.is_dir()):
        raise typer.BadParameter(f"{figures} is not a folder", param_hint="--figures")
    began = time.perf_counter()
    try:
        with _progress() as say:
            say("loading (compiles once after the installation)")
            from piezoest.bench.paper import MEMORIES, run_paper
            from piezoest.bench.paper_experiment import MEMORY

            result = run_paper(
                memory=MEMORY if memory is None else memory,
                memories=() if quick else MEMORIES,
                seed=seed,
                workers=workers,
                progress=say,
            )
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    document = {
        "suite": "paper",
        **_origin(),
        "seconds": round(time.perf_counter() - began, 1),
        **result.to_dict(),
    }
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    _write_html(document, html)
    if figures is not None:
        from piezoest.bench.paper_figures import write_figures

        for path in write_figures(result, figures):
            typer.echo(f"Figure: {path}", err=json_to == "-")
    if json_to == "-":
        typer.echo(text)
        return
    from piezoest.bench.paper_report import print_report

    print_report(document, Console())
    if target is not None:
        target.write_text(text + "\n", encoding="utf-8")
        typer.echo(f"JSON: {target}")


def _json_target(json_to: str | None) -> Path | None:
    """File to write JSON to, if any; refused before the work is done, not after."""
    target = None if json_to in (None, "-") else Path(str(json_to))
    if target is not None and (target.is_dir() or not target.resolve().parent.is_dir()):
        raise typer.BadParameter(f"{target} is no file that can be written", param_hint="--json")
    return target


def _check_html(html: Path | None) -> None:
    """Refuse a report that cannot be written before the work is done, not after."""
    if html is None:
        return
    if html.suffix.lower() not in (".html", ".htm"):
        raise typer.BadParameter(f"{html}: a report's name must end in .html", param_hint="--html")
    if html.is_dir() or not html.resolve().parent.is_dir():
        raise typer.BadParameter(f"{html} is no file that can be written", param_hint="--html")
    try:
        _extras.load("plotly", "report", "an HTML report")
    except _extras.MissingExtraError as error:
        raise typer.BadParameter(str(error), param_hint="--html") from None


def _write_html(document: dict[str, Any], html: Path | None) -> None:
    """Write the report, if one is wanted, and say so on stderr, for stdout may be JSON."""
    if html is not None:
        from piezoest.bench.html_report import write_html

        write_html(document, html)
        typer.echo(f"Report: {html}", err=True)


def _origin() -> dict[str, Any]:
    """When and on what, as all results say it."""
    from piezoest.bench.machine import describe_machine, versions

    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": describe_machine(),
        "versions": versions(),
    }


def _chosen(own: list[str], only: list[str]) -> dict[str, type]:
    """Estimators by name: the package's, or those of them named, and the user's."""
    from piezoest.bench.estimators import find_estimators, load_estimator

    found = find_estimators()
    if unknown := [name for name in only if name not in found]:
        raise typer.BadParameter(
            f"{', '.join(unknown)}: choose of {', '.join(found)}, or name your own as module:Class",
            param_hint="--only",
        )
    chosen = {name: cls for name, cls in found.items() if not only or name in only}
    for path in own:
        try:
            chosen[path] = load_estimator(path)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None
    return chosen


@contextlib.contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """A function that says on stderr what is being done: beside a spinner, or else as lines."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda said: print(said, file=sys.stderr, flush=True)
        return
    with console.status("") as status:
        yield status.update


def _document(scenario: Scenario, rows: list[Row]) -> dict[str, Any]:
    from piezoest.bench.estimators import SETTLED, UPDATE_INTERVAL
    from piezoest.demo import AMPLITUDE, FREQUENCY, WRONG_GAIN, WRONG_MODEL

    return {
        "suite": "estimators",
        **_origin(),
        "scenario": {
            **dataclasses.asdict(scenario),
            "stage": "PaperStage",
            "signal": "triangle",
            "amplitude_um": AMPLITUDE,
            "frequency_hz": FREQUENCY,
            "update_interval_s": UPDATE_INTERVAL,
            "settled_below": SETTLED,
            "start": WRONG_MODEL.to_dict(),
            "linear_start": WRONG_GAIN.to_dict(),
        },
        "memory": "bytes of the pickled estimator after the run",
        "rows": [dataclasses.asdict(row) for row in rows],
    }


def _print(scenario: Scenario, rows: list[Row]) -> None:
    from rich.table import Table

    from piezoest.bench.estimators import OPTIONS, SETTLED
    from piezoest.bench.machine import describe_machine
    from piezoest.demo import AMPLITUDE, FREQUENCY

    console = Console()
    table = Table(
        title=f"{AMPLITUDE:g} µm at {FREQUENCY:g} Hz for {scenario.seconds:g} s on the simulated stage, "
        f"all at {scenario.sample_rate:g} Hz"
    )
    table.add_column("estimator", no_wrap=True)
    for title in ("settled", "settles", "run", "step", "longest", "memory"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_row("", "µm", "s (periods)", "µs", "µs", "µs", "kB", style="dim", end_section=True)
    for row in rows:
        table.add_row(*_cells(row))
    console.print(table)
    for row in rows:
        what = row.failure or ", ".join(f"{name} {value:.4g}" for name, value in row.parameters.items())
        console.print(f"{row.name:<20} {what}", highlight=False, markup=False, soft_wrap=True)
    about = describe_machine()
    options = "; ".join(
        f"{row.name} with {', '.join(f'{key}={value!r}' for key, value in OPTIONS[row.name].items())}"
        for row in rows
        if row.name in OPTIONS
    )
    for line in (
        "Settled: largest error of the last two periods. Settles: from then on the largest error of every "
        f"period stays below {100.0 * SETTLED:g} % of the amplitude.",
        "Run, step: per sample, of the estimator alone on the recorded voltage and displacement, median of "
        "three passes. Longest: one step. Memory: the pickled estimator after the run.",
        *([f"Beside the defaults: {options}."] if options else []),
        f"{about['cpu']}, {about['cores']} cores, {about['python']}; seed {scenario.seed}.",
    ):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _cells(row: Row) -> list[str]:
    if row.failure is not None:
        return [row.name, "failed", *["—"] * 5]
    settles = "never" if row.settling_time is None else f"{row.settling_time:.1f} ({row.settling_periods})"
    return [
        row.name,
        _number(row.settled_error, 4),
        settles,
        _number(row.run_microseconds),
        _number(row.step_microseconds),
        _number(row.longest_step_microseconds, 0),
        _number(None if row.memory_bytes is None else row.memory_bytes / 1e3, 1),
    ]


def _number(value: float | None, digits: int | None = None) -> str:
    """With so many digits after the point, by default three significant ones."""
    if value is None:
        return "—"
    if digits is None:
        digits = 0 if value >= 100.0 else 1 if value >= 10.0 else 2
    return f"{value:.{digits}f}"
