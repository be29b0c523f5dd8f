"""What the commands of `piezoest bench` share: options, progress, and checks of what is to be written."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from piezoest._errors import INTERRUPTED
from piezoest._files import write_text
from piezoest.bench.origin import json_text as json_text

Html = Annotated[Path | None, typer.Option("--html", metavar="FILE", help="Write a page of HTML.")]
Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write JSON; - prints it instead of the tables.")
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


def write_html(document: dict[str, Any], html: Path | None) -> None:
    """Write the report, if one is wanted, and say so on stderr, for stdout may be JSON."""
    if html is not None:
        from piezoest.bench import pages

        pages.write_html(document, html)
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
def usage(folder: Path | None = None) -> Iterator[None]:
    """Turn a wrong name or value into a message, exit code 2, and Ctrl-C into 130 and how to go on."""
    try:
        yield
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    except KeyboardInterrupt:
        if folder is not None:
            print(f"stopped: the same command goes on from {folder}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


def write_json(document: dict[str, Any], target: Path | None) -> None:
    """Write a document, if it is wanted, and say so."""
    if target is not None:
        write_text(target, json_text(document))
        typer.echo(f"JSON: {target}")


def show(
    document: dict[str, Any], json_to: str | None, tables: Callable[[Any, Console], None], *said: str
) -> None:
    """Print JSON alone where that is asked for, else the tables and what was written; write a JSON file."""
    if json_to == "-":
        typer.echo(json_text(document), nl=False)
        return
    tables(document, Console())
    for line in said:
        typer.echo(line)
    write_json(document, json_target(json_to))
