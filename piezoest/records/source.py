"""A file with columns, of whatever format, as blocks of rows."""

import abc
import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.titles import states_factor

EXTRA = "formats"
# Rows that are read at a time where nobody says how many: some megabytes.
ROWS = 1 << 17
# A file may declare numbers for some 30 million rows, or for so many times its own size: what compresses
# better is no log, and would fill the memory.
PLENTY, MOST_PACKED = 1 << 28, 200
LONGEST_SHOWN = 60


class LogError(ValueError):
    """A log cannot be read; the sentence is complete and names the file."""


class Rows(NamedTuple):
    """Some rows of the columns that were asked for."""

    numbers: np.ndarray[Any, np.dtype[np.int64]]  # (n,): number of each row in its file, the first being 1
    values: list[FloatArray]  # (n,): the columns, NaN where there is no number
    done: int  # bytes or rows of the file that are read by then, see `Source`


class Source(abc.ABC):
    """A file with columns.

    `names`: what to list in messages and to choose by: full paths in files that have folders. `titles`: the
    same for guessing: the last part of the name, with the unit that the file states. Empty where columns have
    no names. `size`: bytes of a file whose `Rows.done` counts bytes; 0 where it counts rows. `whole`: why the
    file cannot be read in parts; empty if it can.
    """

    place: ClassVar[str] = "row"  # what the file calls a row: ``"line"`` or ``"row"``
    size = 0
    whole = ""
    sample_rate: float | None = None  # [Hz], if the file states it beside the columns
    stated_units: Mapping[str, str] = MappingProxyType({})  # beside the columns, and where the file says so
    no_rate = ""  # why what it states is no rate for all of them

    def __init__(self, path: Path, names: list[str], titles: list[str], width: int) -> None:
        self.path, self.names, self.titles, self.width = path, names, titles, width
        self.notes: list[str] = []  # what had to be assumed to read it, as far as it is read

    def note(self, said: str) -> None:
        """Say once what had to be assumed."""
        if said not in self.notes:
            self.notes.append(said)

    def note_factors(self, lines: Iterable[str]) -> None:
        """Say which lines state a factor that is not used: what stands beside columns may be of others."""
        for line in lines:
            if states_factor(line):
                self.note(f"{shown(line)!r} is not used: if it is of a column, say by units= what 1 in it is")

    @abc.abstractmethod
    def read(self, positions: Sequence[int], rows: int) -> Iterator[Rows]:
        """Yield blocks of at most so many rows of the columns at these positions."""

    @abc.abstractmethod
    def count(self, positions: Sequence[int]) -> int:
        """Number of rows of these columns."""

    def check(self, positions: Sequence[int]) -> None:  # noqa: B027
        """Refuse columns that do not belong together."""


@contextlib.contextmanager
def damaged(path: Path, format_: str) -> Iterator[None]:
    """Turn whatever a library raises about a damaged file into one sentence."""
    try:
        yield
    except LogError:
        raise
    except Exception as error:
        # None of them keeps to exceptions of its own: IndexError, TypeError and MemoryError happen too.
        raise LogError(
            f"{path}: cannot be read as {format_}, it may be truncated: {shown(str(error), 200)}"
        ) from None


def check_size(path: Path, size: int) -> None:
    """Refuse a file that declares more bytes of numbers than a log of its size can hold."""
    held = path.stat().st_size
    if size > max(PLENTY, MOST_PACKED * held):
        raise LogError(
            f"{path}: a file of {held / 1e6:.3g} MB that declares {size / 1e6:.3g} MB of numbers is damaged "
            "or no log"
        )


def shown(text: str, longest: int = LONGEST_SHOWN) -> str:
    """Text of a file for a message: its beginning, if it is long, on one line, and nothing but signs."""
    text = " ".join(text[:longest].split()) + ("…" if len(text) > longest else "")
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text)


def counted(number: int, noun: str = "time") -> str:
    """How many, in words: ``once`` and ``3 times``, or ``1 sample`` and ``3 samples``."""
    return "once" if number == 1 and noun == "time" else f"{number} {noun}{'s' * (number != 1)}"


def finite(values: Any) -> FloatArray:
    """Values as float64, with NaN for infinity."""
    numbers = np.array(values, dtype=np.float64)
    numbers[~np.isfinite(numbers)] = np.nan
    return numbers


def floats(values: Any, origin: Any = None) -> FloatArray:
    """Numbers of a Series of pandas; times of day as seconds since `origin`, by default the earliest.

    Nanoseconds since 1970 have no room in a float; their differences have.
    """
    if values.dtype.kind == "M":
        values = values - (values.min() if origin is None else origin)
    if values.dtype.kind == "m":
        values = values.dt.total_seconds()
    # A missing value of pandas' own types is no number for NumPy.
    return finite(values.to_numpy(dtype=np.float64, na_value=np.nan))
