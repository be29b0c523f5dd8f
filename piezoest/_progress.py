"""What a command says on stderr while it works."""

import contextlib
import sys
import time
from collections.abc import Iterator
from typing import Any

from rich.console import Console

LOADING = "loading (compiles once after the installation)"
LINES = 20  # about as many for a step whose length is known, where stderr is a file


class Shown:
    """What a command is doing: called with a few words at each step, and with how much of it is done."""

    def __init__(self, text: str = "", *, bar: Any = None, lines: bool = False) -> None:
        self._bar, self._lines, self._words = bar, lines, text
        self._task = None if bar is None else bar.add_task(text, total=None)
        self._began, self._said = time.perf_counter(), -1

    def __call__(self, words: str) -> None:
        """Begin a step, of which nobody knows yet how long it takes."""
        if self._bar is not None:
            self._bar.reset(self._task, total=None, description=words)
        elif self._lines:
            print(words, file=sys.stderr, flush=True)

    def done(self, done: int, total: int) -> None:
        """Say how much of the step is done."""
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total)
        elif self._lines and (part := done * LINES // max(total, 1)) > self._said:
            self._said = part
            seconds = time.perf_counter() - self._began
            print(f"{done} of {total} {self._words}, {seconds:.0f} s", file=sys.stderr, flush=True)


@contextlib.contextmanager
def progress(text: str, *, lines: bool = False) -> Iterator[Shown]:
    """A bar on stderr, if that is a terminal; else nothing, or `lines`."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Shown(text, lines=lines)
        return
    from rich import progress as parts

    columns = (
        parts.SpinnerColumn(), parts.TextColumn("{task.description}"), parts.BarColumn(),
        parts.TaskProgressColumn(), parts.TimeElapsedColumn(),
    )  # fmt: skip
    with parts.Progress(*columns, console=console, transient=True) as bar:
        yield Shown(text, bar=bar)
