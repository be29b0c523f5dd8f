"""`piezoest identify`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console

from piezoest._errors import Debug, errors
from piezoest._files import check_targets, save_figure, write_text
from piezoest._options import examples, grouped, pairs
from piezoest._progress import LOADING, Shown, progress

if TYPE_CHECKING:
    from piezoest.identification import Identification, StreamedIdentification

EPILOG = examples(
    "piezoest identify log.csv --output model.json",
    "piezoest identify log.csv --columns time=t,voltage=u_mV,displacement=3",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How the log is read."""

    columns: Annotated[
        str | None,
        typer.Option(help="Columns by name or number, where guessing fails: see the examples below."),
    ] = None
    units: Annotated[
        str | None,
        typer.Option(
            help="Units, where no name states them: displacement=nm. With a number, what the number 1 in the "
            "log means: displacement=0.2um"
        ),
    ] = None
    sample_rate: Annotated[
        float | None, typer.Option(help="Samples per second; a column of time is then ignored.")
    ] = None
    stream: Annotated[
        bool,
        typer.Option(
            "--stream",
            help="Read in blocks, in three passes, for files larger than memory: text, LabVIEW, TDMS, "
            "Parquet, HDF5, MATLAB 7.3, .npy.",
        ),
    ] = False

    def options(self) -> dict[str, Any]:
        """Keyword arguments of `read_record` and `stream_record`."""
        return {
            "columns": pairs("--columns", "voltage=u,displacement=3", self.columns),
            "units": pairs("--units", "voltage=mV,displacement=nm", self.units),
            "sample_rate": self.sample_rate,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitting:
    """What is fitted."""

    model: Annotated[
        str,
        typer.Option(
            help="auto: compare models of all kinds, use the best and say why. Or one kind: line, "
            "coleman-hodgdon, plays, plays-creep, plays-asymmetric, plays-asymmetric-creep."
        ),
    ] = "auto"
    train: Annotated[
        float, typer.Option(min=0.1, max=0.9, help="Fraction to fit, from the start; the rest is held out.")
    ] = 0.5
    delay: Annotated[
        str, typer.Option(help="Samples by which the displacement lags the voltage, or auto.")
    ] = "auto"
    validate: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE", help="Another log of the stage, for the model to predict; may be given again."
        ),
    ] = None
    strict: Annotated[bool, typer.Option("--strict", help="Refuse a log that looks wrong.")] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """What is written."""

    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the model as JSON, for compensate.")
    ] = None
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Figure to write; default <FILE>_identified.png here.")
    ] = None
    html: Annotated[Path | None, typer.Option("--html", help="Report to write: one page of HTML.")] = None
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

    Models of several kinds are compared on blocks of the log that the fit left out. Columns and units are
    guessed from a header such as time_s,voltage_V,displacement_um.
    """
    with errors(debug):
        if reading.stream:
            _check_streamed(fitting, out)
        figure = None if out.no_plot or reading.stream else out.plot or Path(f"{file.stem}_identified.png")
        read = (file, *(fitting.validate or ()))
        check_targets(read, figure=figure, output=out.output, report=out.html)
        with progress(LOADING) as say:
            found: Any = (_streamed if reading.stream else _identified)(file, reading, fitting, say)
            say("drawing")
            if figure is not None:
                save_figure(found.plot(), figure, dpi=130)
            if out.html is not None:
                from piezoest.report import write_report

                write_report(found, out.html)
        if out.output is not None:
            write_text(out.output, json.dumps(found.to_dict(), indent=2, ensure_ascii=False) + "\n")
        if out.as_json:
            typer.echo(json.dumps(found.to_dict(), indent=2, allow_nan=False))
            return
        from piezoest.identification.compared import print_identification

        print_identification(found, Console())
        for name, path in (("Figure", figure), ("Report", out.html), ("Model", out.output)):
            if path is not None:
                typer.echo(f"{name}: {path}")


def _check_streamed(fitting: Fitting, out: Output) -> None:
    """Refuse what needs the whole log in memory."""
    asked = {
        f"--model {fitting.model}": fitting.model != "auto",
        "--validate": bool(fitting.validate),
        "--strict": fitting.strict,
        "--plot": out.plot is not None,
    }
    for option, given in asked.items():
        if given:
            way_out = ", or draw with --html" if option == "--plot" else ""
            raise ValueError(f"{option} needs the whole log in memory: leave out --stream{way_out}")


def _identified(file: Path, reading: Reading, fitting: Fitting, say: Shown) -> Identification:
    """Read logs as a whole, and identify the first."""
    from piezoest.fitting import FORMS
    from piezoest.identification import identify as run
    from piezoest.records import read_record

    if fitting.model not in ("auto", *FORMS):
        said = f"{fitting.model!r} is not one of auto, {', '.join(FORMS)}"
        raise typer.BadParameter(said, param_hint="--model")
    delay = _delay(fitting.delay)
    say(f"reading {file.name}")
    logs = (file, *(fitting.validate or ()))
    record, *others = (read_record(_named(each), **reading.options()) for each in logs)
    return run(
        record,
        model=fitting.model,
        train=fitting.train,
        delay=delay,
        validate=others,
        strict=fitting.strict,
        say=say,
    )


def _streamed(file: Path, reading: Reading, fitting: Fitting, say: Shown) -> StreamedIdentification:
    """Identify a log block by block."""
    from piezoest.identification import identify_stream
    from piezoest.records import stream_record

    delay = _delay(fitting.delay)
    say(f"reading the times of {file.name}")
    log = stream_record(_named(file), progress=say.done, **reading.options())
    return identify_stream(log, train=fitting.train, delay=delay, progress=say.done, say=say)


def _named(file: Path) -> Path:
    """The file; by the word example, where there is none of that name, the log that comes with piezoest."""
    from piezoest.records import example_log

    return example_log() if str(file) == "example" and not file.exists() else file


def _delay(text: str) -> float | Literal["auto"]:
    if text == "auto":
        return "auto"
    try:
        return float(text)
    except ValueError:
        said = f"{text!r} is neither a number of samples nor auto"
        raise typer.BadParameter(said, param_hint="--delay") from None
