"""`piezoest identify`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from piezoest._errors import errors
from piezoest._files import save_figure, write_text
from piezoest._options import grouped
from piezoest.cli.shared import Debug, check_figure, check_outputs, progress

EPILOG = "Example: piezoest identify log.csv --columns voltage=drive_mV,displacement=3 --output model.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How the log is read."""

    columns: Annotated[
        str | None,
        typer.Option(
            help="Columns by name or number, where guessing fails: time=t,voltage=u_mV,displacement=3"
        ),
    ] = None
    units: Annotated[
        str | None,
        typer.Option(
            help="Units, where no name states them: displacement=nm. With a number, what one in the log "
            "stands for: displacement=0.2um"
        ),
    ] = None
    sample_rate: Annotated[
        float | None, typer.Option(help="Samples per second; a column of time is then ignored.")
    ] = None
    stream: Annotated[
        bool,
        typer.Option(
            "--stream",
            help="Read in blocks and learn recursively, for files larger than memory: text, LabVIEW, TDMS, "
            "Parquet, HDF5, MATLAB 7.3, .npy.",
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitting:
    """What is fitted."""

    model: Annotated[
        str,
        typer.Option(help="coleman-hodgdon, or auto: compare models of all kinds and say which to use."),
    ] = "coleman-hodgdon"
    train: Annotated[float, typer.Option(help="Part to fit, from the start; the rest is held out.")] = 0.5
    delay: Annotated[
        str, typer.Option(help="Samples by which the displacement lags the voltage, or auto.")
    ] = "auto"


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """What is written."""

    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the model as JSON, for compensate.")
    ] = None
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Figure to write; default <FILE>_identified.png here.")
    ] = None
    html: Annotated[
        Path | None, typer.Option("--html", help="Report to write: one page with interactive plots.")
    ] = None
    no_plot: Annotated[bool, typer.Option("--no-plot", help="Write no figure.")] = False
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")] = False


@grouped
def identify(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Log with time, voltage and displacement: text (.gz too), LabVIEW, TDMS, Parquet, HDF5, "
            "MATLAB, NumPy or a spreadsheet; or the word example, for a recording that comes with piezoest.",
        ),
    ],
    reading: Reading,
    fitting: Fitting,
    out: Output,
    debug: Debug = False,
) -> None:
    """Learn a model from a recorded log, and say how far to trust it.

    Columns and units are guessed from a header such as time_s,voltage_V,displacement_um.
    """
    with errors(debug):
        if fitting.model not in ("coleman-hodgdon", "auto"):
            raise ValueError(f"--model must be coleman-hodgdon or auto, got {fitting.model}")
        if reading.stream and (fitting.model == "auto" or out.plot is not None):
            other = "--model auto" if fitting.model == "auto" else "--plot"
            raise ValueError(
                f"{other} needs the whole log in memory: leave out --stream, or draw with --html"
            )
        figure = None if out.no_plot or reading.stream else out.plot or Path(f"{file.stem}_identified.png")
        if figure is not None:
            check_figure(figure, keep=(file,))
        check_outputs(out.output, out.html, keep=(file,) if figure is None else (file, figure))
        with progress("loading (compiles once after the installation)") as say:
            from piezoest import records
            from piezoest.identification import choose_model, identify_stream
            from piezoest.identification import identify as run

            say(f"reading {file.name}")
            read: Any = records.stream_record if reading.stream else records.read_record
            record = read(
                records.example_log() if str(file) == "example" and not file.exists() else file,
                columns=_pairs("--columns", "voltage=u,displacement=3", reading.columns),
                units=_pairs("--units", "voltage=mV,displacement=nm", reading.units),
                sample_rate=reading.sample_rate,
            )
            say("fitting")
            lag: Any = "auto" if fitting.delay == "auto" else _number("--delay", fitting.delay)
            fit: Any = identify_stream if reading.stream else choose_model if fitting.model == "auto" else run
            found = fit(record, train=fitting.train, delay=lag)
            if figure is not None:
                say("drawing")
                save_figure(found.plot(), figure, dpi=130)
            if out.html is not None:
                say("drawing")
                from piezoest.report import write_report

                write_report(found, out.html)
        if out.output is not None:
            write_text(out.output, json.dumps(found.to_dict(), indent=2, ensure_ascii=False) + "\n")
        if out.as_json:
            typer.echo(json.dumps(found.to_dict(), indent=2, allow_nan=False))
            return
        from piezoest.identification.terminal import print_choice, print_identification

        (print_choice if fitting.model == "auto" else print_identification)(found, Console())
        for name, path in (("Figure", figure), ("Report", out.html), ("Model", out.output)):
            if path is not None:
                typer.echo(f"{name}: {path}")


def _pairs(option: str, example: str, text: str | None) -> dict[str, str] | None:
    """``voltage=u,displacement=3`` as a dictionary."""
    if text is None:
        return None
    pairs = [pair.partition("=") for pair in text.split(",")]
    if any(not name.strip() or not value.strip() for name, _, value in pairs):
        raise ValueError(f"{option} must read like {example}, got {text!r}")
    return {name.strip(): value.strip() for name, _, value in pairs}


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name} must be a number or auto, got {text!r}") from None
