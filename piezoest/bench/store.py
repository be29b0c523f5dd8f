"""Where the rows of runs are kept: one JSON line each, appended as it comes, and found by its key.

A process that is killed leaves at most its last line torn; the next to append goes on below. Several
processes may append to one file. A key that comes twice counts once.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self, TypeVar

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Keyed:
    """A task, whose row is kept under a key that all its fields make."""

    @property
    def key(self) -> str:
        """Of the row."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


Task = TypeVar("Task", bound=Keyed)


class Store:
    """Rows in a file, made if it is not there; to be used in a ``with`` statement."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._rows: dict[str, Row] = {}

    def __enter__(self) -> Self:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        # Unbuffered: what is written comes to the end of the file in one piece, whoever else appends to it.
        self._file = self._path.open("ab+", buffering=0)
        with self._path.open("rb") as lines:
            for row in filter(None, map(_read, lines)):
                self._rows.setdefault(row["key"], row)
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def __contains__(self, key: str) -> bool:
        return key in self._rows

    def __len__(self) -> int:
        return len(self._rows)

    def append(self, row: Row) -> bool:
        """Keep a row, at once; False if its key is known already, and then the first one stands."""
        if row["key"] in self._rows:
            return False
        line = json.dumps(row, allow_nan=False, ensure_ascii=False).encode() + b"\n"
        whole = b"\n" + line if self._torn() else line
        try:
            if self._file.write(whole) < len(whole):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self._path)) from None
        self._rows[row["key"]] = row
        return True

    def _torn(self) -> bool:
        """Whether the last line is not whole: of a process that was killed, or that is writing just now."""
        size = self._file.seek(0, os.SEEK_END)
        self._file.seek(max(size - 1, 0))
        return self._file.read(1) not in (b"", b"\n")

    def rows(self, keys: Iterable[str]) -> Iterator[Row]:
        """Rows of these keys, in their order; a key without one is left out."""
        return (self._rows[key] for key in keys if key in self._rows)


def _read(line: bytes) -> dict[str, Any] | None:
    """Row of a whole line; None of a torn one."""
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return None
    match found:
        case {"key": str()}:
            return dict(found)
    return None


def store_in(folder: Path) -> Store:
    """Where the runs of a campaign with this folder are kept."""
    return Store(folder / "runs.jsonl")


def carry_out(
    tasks: Sequence[Task],
    store: Store,
    execute: Callable[[Iterable[Task]], Iterator[Row]],
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> None:
    """Run what the store does not hold yet; `progress` is called with the runs done, and with all."""
    todo = [task for task in tasks if task.key not in store]
    done = len(tasks) - len(todo)
    progress(done, len(tasks))
    for row in execute(todo):
        if store.append(row):
            done += 1
            progress(done, len(tasks))
