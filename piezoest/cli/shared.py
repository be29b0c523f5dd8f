"""What the commands share: progress, and checks of what is to be written."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

FIGURE_FORMATS = (".png", ".pdf", ".svg", ".jpg", ".jpeg")

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


@contextlib.contextmanager
def progress(text: str) -> Iterator[Callable[[str], None]]:
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


def check_figure(path: Path, keep: tuple[Path, ...] = ()) -> None:
    """Refuse a name that no figure can have, and what `check_writable` refuses."""
    if path.suffix.lower() not in FIGURE_FORMATS:
        raise ValueError(f"{path}: a figure's name must end in one of {' '.join(FIGURE_FORMATS)}")
    check_writable(path, keep)


def check_outputs(output: Path | None, html: Path | None, keep: tuple[Path, ...]) -> None:
    """Refuse what cannot be written, and a report by a name that no browser opens, or without plots."""
    if output is not None:
        check_writable(output, keep)
        keep = (*keep, output)
    if html is not None:
        if html.suffix.lower() not in (".html", ".htm"):
            raise ValueError(f"{html}: a report's name must end in .html")
        check_writable(html, keep)


def check_writable(path: Path, keep: tuple[Path, ...] = ()) -> None:
    """Refuse before the work is done, not after; files to keep are not written over."""
    if any(path.resolve() == other.resolve() for other in keep):
        raise ValueError(f"{path} is named twice: give what is written a file of its own")
    if path.is_dir():
        raise ValueError(f"{path} is a folder: name a file in it")
    if not path.resolve().parent.is_dir():
        raise ValueError(f"{path}: there is no folder {path.resolve().parent}")
