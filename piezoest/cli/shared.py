"""What the commands share: progress, and checks of what is to be written."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

FIGURE_FORMATS = (".png", ".pdf", ".svg", ".jpg", ".jpeg")

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


class Shown:
    """What a command is doing: called with a few words at each step, and with how much of it is done."""

    def __init__(self, progress: Any = None, text: str = "") -> None:
        self._progress = progress
        self._task = None if progress is None else progress.add_task(text, total=None)

    def __call__(self, words: str) -> None:
        """Begin a step, of which nobody knows yet how long it takes."""
        if self._progress is not None:
            self._progress.reset(self._task, total=None, description=words)

    def done(self, done: int, total: int) -> None:
        """Say how much of the step is done."""
        if self._progress is not None:
            self._progress.update(self._task, completed=done, total=total)


@contextlib.contextmanager
def progress(text: str, *, bar: bool = False) -> Iterator[Shown]:
    """A spinner on stderr, if that is a terminal, with a bar for steps of which the length is known."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Shown()
        return
    from rich import progress as parts

    length = (parts.BarColumn(), parts.TaskProgressColumn()) if bar else ()
    words = parts.TextColumn("{task.description}")
    columns = (parts.SpinnerColumn(), words, *length, parts.TimeElapsedColumn())
    with parts.Progress(*columns, console=console, transient=True) as shown:
        yield Shown(shown, text)


def check_figure(path: Path, keep: tuple[Path, ...] = ()) -> None:
    """Refuse a name that no figure can have, and what `check_writable` refuses."""
    if path.suffix.lower() not in FIGURE_FORMATS:
        raise ValueError(f"{path}: a figure's name must end in one of {' '.join(FIGURE_FORMATS)}")
    check_writable(path, keep)


def check_outputs(output: Path | None, html: Path | None, keep: tuple[Path, ...]) -> None:
    """Refuse what cannot be written, and a report by a name that no browser opens."""
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
