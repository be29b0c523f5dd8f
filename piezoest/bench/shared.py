"""What the commands of `piezoest bench` share: progress, and checks of what is to be written."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from piezoest import _extras

Html = Annotated[
    Path | None, typer.Option("--html", metavar="FILE", help="Write a page with interactive plots.")
]


def json_target(json_to: str | None) -> Path | None:
    """File to write JSON to, if any; refused before the work is done, not after."""
    target = None if json_to in (None, "-") else Path(str(json_to))
    if target is not None and (target.is_dir() or not target.resolve().parent.is_dir()):
        raise typer.BadParameter(f"{target} is no file that can be written", param_hint="--json")
    return target


def check_html(html: Path | None) -> None:
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


def write_html(document: dict[str, Any], html: Path | None) -> None:
    """Write the report, if one is wanted, and say so on stderr, for stdout may be JSON."""
    if html is not None:
        from piezoest.bench import html_report

        html_report.write_html(document, html)
        typer.echo(f"Report: {html}", err=True)


@contextlib.contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """A function that says on stderr what is being done: beside a spinner, or else as lines."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda said: print(said, file=sys.stderr, flush=True)
        return
    with console.status("") as status:
        yield status.update
