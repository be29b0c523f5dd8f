"""`piezoest bench`: its commands. Heavy imports wait inside them."""

from __future__ import annotations

import dataclasses
import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from piezoest._errors import INTERRUPTED, Group
from piezoest._files import write_text
from piezoest.bench import adaptation_command, rank_command, safety_command, suite_command
from piezoest.bench.origin import origin
from piezoest.bench.shared import Html, check_html, json_target, progress, write_html

if TYPE_CHECKING:
    from piezoest.bench.estimators import Row, Scenario

app = typer.Typer(
    cls=Group,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.callback(invoke_without_command=True)(suite_command.suite)
app.command(epilog=suite_command.COMPARE_EPILOG)(suite_command.compare)
app.command(epilog=rank_command.EPILOG)(rank_command.rank)
app.command(epilog=adaptation_command.EPILOG)(adaptation_command.adaptation)
app.command(epilog=safety_command.EPILOG)(safety_command.safety)


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
    target = json_target(json_to)
    check_html(html)
    try:
        with progress() as say:
            say("loading (compiles once after the installation)")
            from piezoest.bench.estimators import Scenario, compare

            scenario = Scenario(seconds, sample_rate, seed)
            rows = compare(_chosen(own or [], only or []), scenario, say)
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    document = _document(scenario, rows)
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    write_html(document, html)
    if json_to == "-":
        typer.echo(text)
        return
    _print(scenario, rows)
    if target is not None:
        write_text(target, text + "\n")
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
    target = json_target(json_to)
    check_html(html)
    if figures is not None and (figures.exists() and not figures.is_dir()):
        raise typer.BadParameter(f"{figures} is not a folder", param_hint="--figures")
    began = time.perf_counter()
    try:
        with progress() as say:
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
        **origin(began),
        **result.to_dict(),
    }
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    write_html(document, html)
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
        write_text(target, text + "\n")
        typer.echo(f"JSON: {target}")


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


def _document(scenario: Scenario, rows: list[Row]) -> dict[str, Any]:
    from piezoest.bench.estimators import SETTLED, UPDATE_INTERVAL
    from piezoest.demo import AMPLITUDE, FREQUENCY, WRONG_GAIN, WRONG_MODEL

    return {
        "suite": "estimators",
        **origin(),
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
