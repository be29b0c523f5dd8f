"""What the commands of `piezoest bench` share: options, and where results go."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from piezoest._errors import INTERRUPTED
from piezoest._files import check_targets
from piezoest.bench.origin import put

Html = Annotated[Path | None, typer.Option("--html", metavar="FILE", help="Write a page of HTML.")]
Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write JSON; - prints it instead of the tables.")
]

Processes = Annotated[
    int | None, typer.Option("--jobs", "--workers", min=1, help="Processes; default one for each core.")
]
Format = Annotated[
    str | None, typer.Option(help="parquet or csv; default Parquet where pyarrow is installed.")
]


def check(json_to: str | None, html: Path | None = None) -> None:
    """Refuse what cannot be written before the work is done, not after."""
    with usage():
        check_targets(output=None if json_to in (None, "-") else Path(str(json_to)), report=html)


def write_html(document: dict[str, Any], html: Path | None) -> None:
    """Write the report, if one is wanted, and say so on stderr, for stdout may be JSON."""
    if html is not None:
        from piezoest.bench import pages

        pages.write_html(document, html)
        typer.echo(f"Report: {html}", err=True)


@contextlib.contextmanager
def usage(folder: Path | None = None) -> Iterator[None]:
    """Turn a wrong name or value into a message, exit code 2, and Ctrl-C into 130 and how to go on."""
    try:
        yield
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    except KeyboardInterrupt:
        if folder is not None and folder.exists():
            print(f"stopped: the same command continues from {folder}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


def show(
    document: dict[str, Any], json_to: str | None, tables: Callable[[Any, Console], None], *said: str
) -> None:
    """Print JSON alone where that is asked for, else the tables and what was written; write a JSON file."""
    if json_to == "-":
        put(document, None)
        return
    tables(document, Console())
    for line in said:
        typer.echo(line)
    if json_to is not None:
        put(document, Path(json_to))
        typer.echo(f"JSON: {json_to}")
