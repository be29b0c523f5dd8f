"""A file with columns, of whatever format, as blocks of rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray

# Default number of rows that are read at a time: some megabytes.
ROWS = 1 << 17


# A file may declare numbers for some 30 million rows, or for so many times its own size: what compresses
# better is no log, and would fill the memory.
PLENTY, MOST_PACKED = 1 << 28, 200
LONGEST_SHOWN = 60


class Rows(NamedTuple):
    """Some rows of the columns that were asked for.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n,)
        Number of each row in its file.
    values : list of ndarray, shape (n,)
        The columns.
    done : int
        Bytes or rows of the file that are read by then, see `Source`.
    """

    numbers: np.ndarray[Any, np.dtype[np.int64]]
    values: list[FloatArray]
    done: int


@dataclass(frozen=True, slots=True)
class Source:
    """A file with columns.

    Parameters
    ----------
    path : Path
        The file.
    names : list of str
        What to list in messages and to choose by: full paths in files that have folders.
    titles : list of str
        The same for guessing: the last part of the name, with the unit that the file states. Empty where
        columns have no names.
    width : int
        Number of columns.
    read : callable
        ``read(positions, rows)`` yields blocks of at most so many rows of the columns at these positions.
    count : callable
        ``count(positions)`` is the number of rows of these columns.
    size : int
        Bytes of a file whose `Rows.done` counts bytes; 0 where it counts rows.
    place : str
        What the file calls a row: ``"line"`` or ``"row"``.
    whole : str
        Why the file cannot be read in parts; empty if it can.
    sample_rate : float, optional
        [Hz], if the file states it beside the columns.
    check : callable
        ``check(positions)`` refuses columns that do not belong together.
    """

    path: Path
    names: list[str]
    titles: list[str]
    width: int
    read: Callable[[Sequence[int], int], Iterator[Rows]]
    count: Callable[[Sequence[int]], int]
    size: int = 0
    place: str = "row"
    whole: str = ""
    sample_rate: float | None = None
    check: Callable[[Sequence[int]], None] = lambda positions: None


def check_size(path: Path, size: int) -> None:
    """Refuse a file that declares more bytes of numbers than a log of its size can hold.

    Raises
    ------
    ValueError
        If so.
    """
    held = path.stat().st_size
    if size > max(PLENTY, MOST_PACKED * held):
        raise ValueError(
            f"{path}: a file of {held / 1e6:.3g} MB that declares {size / 1e6:.3g} MB of numbers is damaged "
            "or no log"
        )


def shown(text: str, longest: int = LONGEST_SHOWN) -> str:
    """Text of a file for a message: its beginning, if it is long, on one line, and nothing but signs."""
    text = " ".join(text[:longest].split()) + ("…" if len(text) > longest else "")
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text)
