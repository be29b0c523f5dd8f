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
from typing import Any, Self, TypeVar

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


class Store:
    """Rows in a file, made if it is not there; to be used in a ``with`` statement."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> Self:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._named():
            self._rows = sqlite3.connect(self._path, timeout=PATIENCE, isolation_level=None)
        try:
            self._execute("CREATE TABLE IF NOT EXISTS runs (key TEXT PRIMARY KEY, row TEXT)")
        except OSError:
            self._rows.close()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self._rows.close()

    def __contains__(self, key: str) -> bool:
        return self._row(key) is not None

    def __len__(self) -> int:
        return int(self._execute("SELECT count(*) FROM runs").fetchone()[0])

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        """Name the file in an error of SQLite, as on a full disk."""
        try:
            yield
        except sqlite3.DatabaseError as error:
            raise OSError(f"{self._path}: {error}") from None

    def _execute(self, statement: str, *values: str) -> sqlite3.Cursor:
        with self._named():
            return self._rows.execute(statement, values)

    def append(self, row: Row) -> bool:
        """Keep a row, at once; False if its key is known already, and then the first one stands."""
        text = json.dumps(row, allow_nan=False, ensure_ascii=False)
        return self._execute("INSERT OR IGNORE INTO runs VALUES (?, ?)", row["key"], text).rowcount > 0

    def rows(self, keys: Iterable[str]) -> Iterator[Row]:
        """Rows of these keys, in their order; a key without one is left out."""
        return (json.loads(row) for key in keys if (row := self._row(key)) is not None)

    def _row(self, key: str) -> str | None:
        found = self._execute("SELECT row FROM runs WHERE key = ?", key).fetchone()
        return found[0] if found else None


def played(
    tasks: Sequence[Task],
    folder: Path,
    execute: Callable[[Iterable[Task]], Iterator[Row]],
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> list[Row]:
    """Rows of tasks, in their order; those that the folder keeps are not run again.

    `progress` is called with the runs done, and with all.
    """
    with Store(folder / FILE) as store:
        todo = [task for task in tasks if task.key not in store]
        done = len(tasks) - len(todo)
        progress(done, len(tasks))
        for row in execute(todo):
            if store.append(row):
                done += 1
                progress(done, len(tasks))
        return list(store.rows(task.key for task in tasks))
