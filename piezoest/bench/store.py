"""Where the rows of runs are kept: one JSON line each, appended as it comes, and found by its key.

A process that is killed leaves at most its last line torn; the next one to open the file goes on
from there. A key that comes twice counts once.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from piezoest.bench.runner import Row


class Store:
    """Rows in a file, to be used in a ``with`` statement.

    Parameters
    ----------
    path : Path
        Made if it is not there; with its folder.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._places: dict[str, int] = {}

    def __enter__(self) -> Self:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._file: BinaryIO = self._path.open("a+b")
        self._file.seek(0)
        line, place = b"\n", 0
        for line in self._file:
            if (row := _read(line)) is not None:
                self._places.setdefault(row["key"], place)
            place += len(line)
        if not line.endswith(b"\n"):
            self._file.write(b"\n")  # after a torn line
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._file.close()

    def __contains__(self, key: str) -> bool:
        return key in self._places

    def __len__(self) -> int:
        return len(self._places)

    def append(self, row: Row) -> bool:
        """Keep a row, at once; False if its key is known already, and then the first one stands.

        Parameters
        ----------
        row : dict
            JSON-safe, with a ``"key"``.
        """
        if row["key"] in self._places:
            return False
        self._file.seek(0, 2)
        self._places[row["key"]] = self._file.tell()
        self._file.write(json.dumps(row, allow_nan=False, ensure_ascii=False).encode() + b"\n")
        self._file.flush()
        return True

    def rows(self, keys: Iterable[str]) -> Iterator[Row]:
        """Rows of these keys, in their order; a key without one is left out.

        Parameters
        ----------
        keys : iterable of str
            From `piezoest.bench.runner.Task.key`.
        """
        for key in keys:
            if key in self._places:
                self._file.seek(self._places[key])
                row = _read(self._file.readline())
                if row is not None:
                    yield row


def _read(line: bytes) -> dict[str, Any] | None:
    """Row of a whole line; None of a torn one."""
    try:
        row = json.loads(line)
    except ValueError:
        return None
    return row if isinstance(row, dict) and "key" in row else None
