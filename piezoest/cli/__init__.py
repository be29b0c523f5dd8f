"""The command line: demo, identify, compensate. Heavy imports wait inside the commands."""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from piezoest._extras import MissingExtraError
from piezoest.bench.commands import app as bench
from piezoest.export.commands import app as export

if TYPE_CHECKING:
    from piezoest.demo import Demo
    from piezoest.models import Model

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 done, 1 the input cannot be used, 2 wrong usage, 130 interrupted.",
)

app.add_typer(bench, name="bench")
app.add_typer(export, name="export")

USER_ERROR, INTERRUPTED = 1, 130
FIGURE_FORMATS = (".png", ".pdf", ".svg", ".jpg", ".jpeg")

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


def main() -> None:
    """Run the command line."""
    for stream in (sys.stdout, sys.stderr):
        # A µ or a frame that the terminal's encoding lacks must not end a command.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        app(prog_name="piezoest")
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


@contextlib.contextmanager
def _errors(debug: bool) -> Iterator[None]:
    """Turn a user's mistake into one line on stderr and exit code 1."""
    try:
        yield
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        # Whoever read us has seen enough; Python must not complain about it at its end either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(0) from None
    except (ValueError, OSError, MissingExtraError) as error:
        if debug:
            raise
        text = (
            f"{error.filename}: {error.strerror}"
            if isinstance(error, OSError) and error.filename
            else str(error)
        )
        console = Console(stderr=True)
        console.print(f"error: {text}", style="red", markup=False, highlight=False, soft_wrap=True)
        raise typer.Exit(USER_ERROR) from None


@contextlib.contextmanager
def _progress(text: str) -> Iterator[Callable[[str], None]]:
    """A spinner on stderr, if that is a terminal; yields a function that changes its text."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _: None
        return
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(text, total=None)
        yield lambda said: progress.update(task, description=said)


def _version(wanted: bool) -> None:
    if wanted:
        from piezoest._version import __version__

        typer.echo(f"piezoest {__version__}")
        raise typer.Exit


@app.callback()
def _piezoest(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Learn the hysteresis of a piezo stage, and cancel it.

    [bold]Examples[/bold]

    See it work on a simulated stage:  [cyan]piezoest demo[/cyan]

    Learn a model from a log:  [cyan]piezoest identify log.csv --output model.json[/cyan]

    Turn a reference into a voltage:  [cyan]piezoest compensate r.csv -p model.json -o voltage.csv[/cyan]
    """


@app.command(epilog="Example: piezoest demo --output figure.png")
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Figure to write (PNG, PDF, SVG).")] = Path(
        "piezoest_demo.png"
    ),
    periods: Annotated[int, typer.Option(min=5, max=1000, help="Periods of the reference, 0.2 s each.")] = 15,
    seed: Annotated[int, typer.Option(min=0, help="Start of the random numbers of the stage.")] = 0,
    debug: Debug = False,
) -> None:
    """Compare linear feed-forward with adaptive compensation on a simulated stage.

    A smoothed triangle of 5 µm at 5 Hz, noise and quantisation on, from wrong start parameters.
    """
    with _errors(debug):
        _check_figure(output)
        with _progress("loading (compiles once after the installation)") as say:
            from piezoest.demo import run_demo

            result = run_demo(periods, seed, say)
            say("drawing")
            result.plot().savefig(output, dpi=130)
        _print_demo(result)
        typer.echo(f"Figure: {output}")


def _print_demo(result: Demo) -> None:
    from rich.table import Table

    from piezoest.demo import AMPLITUDE, FREQUENCY, SETTLED_PERIODS

    ways = (
        ("linear, gain estimated", result.linear),
        ("inverse, not adapted", result.fixed),
        ("inverse, adaptive", result.adaptive),
    )
    table = Table(title=f"Largest error [µm]: {AMPLITUDE:g} µm at {FREQUENCY:g} Hz, simulated stage")
    table.add_column("compensation")
    for period in range(1, 5):
        table.add_column(f"period {period}", justify="right")
    table.add_column("settled", justify="right", style="bold")
    for name, record in ways:
        errors = record.max_error_per_period()
        table.add_row(name, *(f"{e:.3f}" for e in errors[:4]), f"{record.max_error(SETTLED_PERIODS):.4f}")
    console = Console()
    console.print(table)
    names = result.adaptive.parameter_names
    first, last = result.adaptive.theta[0], result.adaptive.theta[-1]
    learnt = ", ".join(f"{name} {a:.4g} → {b:.4g}" for name, a, b in zip(names, first, last, strict=True))
    console.print(f"Learnt: {learnt}", highlight=False, soft_wrap=True)
    console.print(
        f"Adaptive compensation reduces the settled error of linear feed-forward by "
        f"[bold]{100.0 * result.reduction:.1f} %[/bold] ({result.seconds:.1f} s for the three runs).",
        highlight=False, soft_wrap=True,
    )  # fmt: skip


@app.command(
    epilog="Example: piezoest identify log.csv --columns voltage=drive_mV,displacement=3 --output model.json"
)
def identify(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Log with time, voltage and displacement: CSV, Parquet, HDF5, MATLAB or NumPy.",
        ),
    ],
    columns: Annotated[
        str | None,
        typer.Option(
            help="Columns by name or number, where guessing fails: time=t,voltage=u_mV,displacement=3"
        ),
    ] = None,
    units: Annotated[
        str | None,
        typer.Option(
            help="Units, where no name states them: displacement=nm. With a number, what one in the log "
            "stands for: displacement=0.2um"
        ),
    ] = None,
    sample_rate: Annotated[
        float | None, typer.Option(help="Samples per second; a column of time is then ignored.")
    ] = None,
    stream: Annotated[
        bool,
        typer.Option(
            "--stream",
            help="Read in blocks and learn recursively, for files larger than memory: CSV, Parquet, HDF5, "
            "MATLAB 7.3, .npy.",
        ),
    ] = False,
    model: Annotated[
        str,
        typer.Option(help="coleman-hodgdon, or auto: compare models of all kinds and say which to use."),
    ] = "coleman-hodgdon",
    train: Annotated[float, typer.Option(help="Part to fit, from the start; the rest is held out.")] = 0.5,
    delay: Annotated[
        str, typer.Option(help="Samples by which the displacement lags the voltage, or auto.")
    ] = "auto",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the model as JSON, for compensate.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Figure to write; default <FILE>_identified.png here.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option("--html", help="Report to write: one page with interactive plots.")
    ] = None,
    no_plot: Annotated[bool, typer.Option("--no-plot", help="Write no figure.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")] = False,
    debug: Debug = False,
) -> None:
    """Learn a model from a recorded log, and say how far to trust it.

    Columns and units are guessed from a header such as time_s,voltage_V,displacement_um.
    """
    with _errors(debug):
        if model not in ("coleman-hodgdon", "auto"):
            raise ValueError(f"--model must be coleman-hodgdon or auto, got {model}")
        if stream and (model == "auto" or plot is not None):
            other = "--model auto" if model == "auto" else "--plot"
            raise ValueError(
                f"{other} needs the whole log in memory: leave out --stream, or draw with --html"
            )
        figure = None if no_plot or stream else plot or Path(f"{file.stem}_identified.png")
        if figure is not None:
            _check_figure(figure, keep=(file,))
        _check_outputs(output, html, keep=(file,) if figure is None else (file, figure))
        with _progress("loading (compiles once after the installation)") as say:
            from piezoest import records
            from piezoest.identification import choose_model, identify_stream
            from piezoest.identification import identify as run

            say(f"reading {file.name}")
            read: Any = records.stream_record if stream else records.read_record
            record = read(
                file,
                columns=_pairs("--columns", "voltage=u,displacement=3", columns),
                units=_pairs("--units", "voltage=mV,displacement=nm", units),
                sample_rate=sample_rate,
            )
            say("fitting")
            lag: Any = "auto" if delay == "auto" else _number("--delay", delay)
            fit: Any = identify_stream if stream else choose_model if model == "auto" else run
            found = fit(record, train=train, delay=lag)
            if figure is not None:
                say("drawing")
                found.plot().savefig(figure, dpi=130)
            if html is not None:
                say("drawing")
                from piezoest.report import write_report

                write_report(found, html)
        if output is not None:
            output.write_text(
                json.dumps(found.to_dict(), indent=2, ensure_ascii=False) + "\n", encoding="utf-8"
            )
        if as_json:
            typer.echo(json.dumps(found.to_dict(), indent=2, allow_nan=False))
            return
        from piezoest.identification.terminal import print_choice, print_identification

        (print_choice if model == "auto" else print_identification)(found, Console())
        for name, path in (("Figure", figure), ("Report", html), ("Model", output)):
            if path is not None:
                typer.echo(f"{name}: {path}")


@app.command(
    epilog="Examples: piezoest compensate reference.csv --parameters model.json -o voltage.csv; "
    "piezoest compensate reference.csv --alpha 0.017 --beta 0.148 --gamma 0.0038 --maximum 150 -o voltage.csv"
)
def compensate(
    reference: Annotated[Path, typer.Argument(metavar="REFERENCE", help="CSV with time_s, reference_um.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="CSV to write: time_s, voltage_V, reference_um.")
    ],
    parameters: Annotated[
        Path | None,
        typer.Option("--parameters", "-p", help="Model as JSON, such as identify --output wrote."),
    ] = None,
    alpha: Annotated[float | None, typer.Option(help="1/V")] = None,
    beta: Annotated[float | None, typer.Option(help="µm/V")] = None,
    gamma: Annotated[float | None, typer.Option(help="µm/V²")] = None,
    offset: Annotated[float | None, typer.Option(help="µm at 0 V; replaces that of --parameters.")] = None,
    minimum: Annotated[float | None, typer.Option(help="Least voltage [V].")] = None,
    maximum: Annotated[float | None, typer.Option(help="Largest voltage [V].")] = None,
    column: Annotated[str | None, typer.Option(help="Column of the reference, if not guessed.")] = None,
    sample_rate: Annotated[float | None, typer.Option(help="Hz, if there is no column of time.")] = None,
    debug: Debug = False,
) -> None:
    """Turn a reference into the voltage that makes the stage follow it.

    The voltage starts from 0 V without hysteresis, or from the limit nearest to it.
    """
    with _errors(debug):
        _check_writable(output, keep=(reference,) if parameters is None else (reference, parameters))
        with _progress("loading (compiles once after the installation)"):
            from piezoest.compensators import InverseCompensator, VoltageLimits
            from piezoest.records import read_reference, write_columns
            from piezoest.signals import check_continuity

            model = _model(parameters, {"alpha": alpha, "beta": beta, "gamma": gamma}, offset)
            limits = VoltageLimits(
                minimum=-float("inf") if minimum is None else minimum,
                maximum=float("inf") if maximum is None else maximum,
            )
            signal = read_reference(reference, column=column, sample_rate=sample_rate)
            compensator = InverseCompensator(model, limits, sample_rate=signal.sample_rate)
            check_continuity(signal.values, signal.sample_rate, "the reference")
            voltage = compensator.run(signal.values)
            columns = {"time_s": signal.time, "voltage_V": voltage, "reference_um": signal.values}
            write_columns(output, columns)
        typer.echo(
            f"{output}: {voltage.size} samples at {signal.sample_rate:.6g} Hz, "
            f"{voltage.min():.4g} to {voltage.max():.4g} V"
        )
        if limited := compensator.status.saturated:
            typer.echo(
                f"{limited} samples ({100.0 * limited / voltage.size:.1f} %) are at a limit of the voltage: "
                "there the stage will not follow the reference",
                err=True,
            )


def _model(path: Path | None, given: dict[str, float | None], offset: float | None) -> Model:
    """Model from a JSON file, or from the three options."""
    import dataclasses

    from piezoest.models import ColemanHodgdon, LinearGain, PrandtlIshlinskii, model_from_dict

    stated = {name: value for name, value in given.items() if value is not None}
    if path is None:
        if missing := sorted(set(given) - set(stated)):
            raise ValueError(f"no model: pass --parameters FILE, or also --{' --'.join(missing)}")
        return ColemanHodgdon(**stated, offset=offset or 0.0)
    if stated:
        raise ValueError(f"two models: leave out --parameters or --{' --'.join(stated)}")
    try:
        data: Any = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not JSON: {error}") from None
    if isinstance(data, dict) and isinstance(data.get("model"), dict):
        data = data["model"]
    if not isinstance(data, dict) or not isinstance(data.get("model", ""), str):
        raise ValueError(f"{path} holds no model: write it with identify --output")
    data.setdefault("model", "ColemanHodgdon")
    try:
        model = model_from_dict(data)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if not isinstance(model, ColemanHodgdon | LinearGain | PrandtlIshlinskii):
        raise ValueError(f"{path}: a {type(model).__name__} cannot be inverted here: use a ColemanHodgdon")
    return model if offset is None else dataclasses.replace(model, offset=offset)


def _pairs(option: str, example: str, text: str | None) -> dict[str, str] | None:
    """``voltage=u,displacement=3`` as a dictionary."""
    if text is None:
        return None
    pairs = [part.partition("=") for part in text.split(",")]
    if any(not name.strip() or not value.strip() for name, _, value in pairs):
        raise ValueError(f"{option} must read like {example}, got {text!r}")
    return {name.strip(): value.strip() for name, _, value in pairs}


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name} must be a number or auto, got {text!r}") from None


def _check_figure(path: Path, keep: tuple[Path, ...] = ()) -> None:
    """Refuse a name that no figure can have, and what `_check_writable` refuses."""
    if path.suffix.lower() not in FIGURE_FORMATS:
        raise ValueError(f"{path}: a figure's name must end in one of {' '.join(FIGURE_FORMATS)}")
    _check_writable(path, keep)


def _check_outputs(output: Path | None, html: Path | None, keep: tuple[Path, ...]) -> None:
    """Refuse what cannot be written, and a report by a name that no browser opens, or without plots."""
    if output is not None:
        _check_writable(output, keep)
        keep = (*keep, output)
    if html is not None:
        if html.suffix.lower() not in (".html", ".htm"):
            raise ValueError(f"{html}: a report's name must end in .html")
        _check_writable(html, keep)


def _check_writable(path: Path, keep: tuple[Path, ...] = ()) -> None:
    """Refuse before the work is done, not after; files to keep are not written over."""
    if any(path.resolve() == other.resolve() for other in keep):
        raise ValueError(f"{path} is named twice: give what is written a file of its own")
    if path.is_dir():
        raise ValueError(f"{path} is a folder: name a file in it")
    if not path.resolve().parent.is_dir():
        raise ValueError(f"{path}: there is no folder {path.resolve().parent}")
