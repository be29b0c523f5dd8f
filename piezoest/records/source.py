"""A file with columns, of whatever format, as blocks of rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray

# Rows that are read at a time where nobody says how many: some megabytes.
ROWS = 1 << 17


# A file may declare numbers for some 30 million rows, or for so many times its own size: what compresses
# better is no log, and would fill the memory.
PLENTY, MOST_PACKED = 1 << 28, 200
LONGEST_SHOWN = 60


class Rows(NamedTuple):
    """Some rows of the columns that were asked for, and the number of each row in its file."""

    numbers: np.ndarray[Any, np.dtype[np.int64]]
    values: list[FloatArray]


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


def open_source(path: Path) -> Source:
    """Open a log by what it begins with, or else by the ending of its name.

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it is empty, or not of the format that its name promises.
    MissingExtraError
        If its format needs a package that is not installed.
    """
    with path.open("rb") as file:
        start = file.read(128)
    ending = path.suffix.lower()
    if not start.strip():
        raise ValueError(f"{path}: the file is empty")
    for format_, beginnings, endings in FORMATS:
        begins = start.startswith(beginnings)
        if begins and (format_ != "npz" or ending not in TEXT_ENDINGS):
            return _opener(format_)(path)
        # Files of MATLAB before version 5 have no mark.
        if ending in endings and not begins and format_ != "mat":
            raise ValueError(
                f"{path}: this is no {NAMES_OF_FORMATS[format_]} file, although its name ends in {ending}: "
                "it may be truncated, or of another format under a wrong name"
            )
    return _opener("mat" if ending == ".mat" else "text")(path)


FORMATS: tuple[tuple[str, tuple[bytes, ...], tuple[str, ...]], ...] = (
    ("parquet", (b"PAR1",), (".parquet", ".pq")),
    ("hdf5", (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3"), (".h5", ".hdf5", ".hdf", ".he5")),
    ("mat", (b"MATLAB 5.0",), (".mat",)),
    ("npy", (b"\x93NUMPY",), (".npy",)),
    ("npz", (b"PK\x03\x04",), (".npz",)),
)
NAMES_OF_FORMATS = {"parquet": "Parquet", "hdf5": "HDF5", "npy": "NumPy", "npz": "NumPy"}
TEXT_ENDINGS = (".csv", ".txt", ".tsv", ".dat")


def _opener(format_: str) -> Callable[[Path], Source]:
    """Function that opens a format; each pulls in what it needs only when it is called."""
    if format_ == "text":
        from piezoest.records.text import open_text

        return open_text
    from piezoest.records import binary, hdf5

    return {
        "parquet": binary.open_parquet,
        "hdf5": hdf5.open_hdf5,
        "mat": binary.open_mat,
        "npy": binary.open_npy,
        "npz": binary.open_npz,
    }[format_]
