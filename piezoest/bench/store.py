"""Where the rows of runs are kept: under their keys, in a file that several processes may append to.

A process that is killed loses at most the row that it is at. A key that comes twice counts once.
"""

import contextlib
import hashlib
import json
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

Row = dict[str, Any]
FILE = "runs.sqlite"  # in the folder of a campaign
PATIENCE = 60.0  # s until another process has to be done with its row


@dataclass(frozen=True, slots=True)
class Keyed:
    """A task, whose row is kept under a key that all its fields make."""

    @property
    def key(self) -> str:
        """Of the row."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


Task = TypeVar("Task", bound=Keyed)


@contextlib.contextmanager
def opened(path: Path) -> Iterator[sqlite3.Connection]:
    """A file of rows, made if it is not there; it is named in an error of SQLite, as on a full disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with contextlib.closing(sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)) as file:
            file.execute("CREATE TABLE IF NOT EXISTS runs (key TEXT PRIMARY KEY, row TEXT)")
            yield file
    except sqlite3.DatabaseError as error:
        raise OSError(f"{path}: {error}") from None


def append(file: sqlite3.Connection, row: Row) -> bool:
    """Keep a row, at once; False if its key is known already, and then the first one stands."""
    text = json.dumps(row, allow_nan=False, ensure_ascii=False)
    return file.execute("INSERT OR IGNORE INTO runs VALUES (?, ?)", (row["key"], text)).rowcount > 0


def row_of(file: sqlite3.Connection, key: str) -> Row | None:
    """Row of a key; None if there is none."""
    found = file.execute("SELECT row FROM runs WHERE key = ?", (key,)).fetchone()
    return json.loads(found[0]) if found else None


def played(
    tasks: Sequence[Task],
    folder: Path,
    execute: Callable[[Iterable[Task]], Iterator[Row]],
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> list[Row]:
    """Rows of tasks, in their order; those that the folder keeps are not run again.

    `progress` is called with the runs done, and with all.
    """
    with opened(folder / FILE) as file:
        todo = [task for task in tasks if row_of(file, task.key) is None]
        done = len(tasks) - len(todo)
        progress(done, len(tasks))
        for row in execute(todo):
            if append(file, row):
                done += 1
                progress(done, len(tasks))
        return [kept for task in tasks if (kept := row_of(file, task.key)) is not None]
