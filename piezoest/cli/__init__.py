"""The command line: demo, identify, compensate, bench, export. Heavy imports wait inside the commands."""

import contextlib
import sys
from typing import Annotated

import typer

from piezoest._errors import INTERRUPTED
from piezoest.bench.commands import app as bench
from piezoest.cli import compensate_command, demo_command, identify_command
from piezoest.export.commands import app as export

__all__ = ["app", "main"]

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 done, 1 the input cannot be used, 2 wrong usage, 130 interrupted.",
)


def main() -> None:
    """Run the command line."""
    for stream in (sys.stdout, sys.stderr):
        # A µ or a frame that the terminal's encoding lacks must not end a command.
        with contextlib.suppress(AttributeError):  # of a stream that someone put in the place of this one
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    try:
        app(prog_name="piezoest")
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


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

    From reference to voltage:  [cyan]piezoest compensate r.csv -p model.json -o u.csv[/cyan]
    """


app.command(epilog=demo_command.EPILOG)(demo_command.demo)
app.command(epilog=identify_command.EPILOG)(identify_command.identify)
app.command(epilog=compensate_command.EPILOG)(compensate_command.compensate)
app.add_typer(bench, name="bench")
app.add_typer(export, name="export")
