"""Columns of LabVIEW measurement files (.lvm), whose rows stand between blocks of headers.

Reference: NI, *Specification for the LabVIEW Measurement File (.lvm)*.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.cells import Style, number
from piezoest.records.layout import Layout
from piezoest.records.lines import Lines, chunks, encoding_of
from piezoest.records.source import LogError, Rows
from piezoest.records.text import Text
from piezoest.records.titles import titled

SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";"}
# The line with the names of the columns begins with this; rows follow it.
NAMES, COMMENT = "X_Value", "Comment"
# What a chunk of rows alone has not.
HEADING = re.compile(r"\n[^\S\n]*(?:\n|\Z)|\*\*\*|Channels|X_Value")
START, END = "***Start_Special***", "***End_Special***"


@dataclass(slots=True)
class _Header:
    """What the last header said: of the file until a segment begins, then of the segment too."""

    separator: str = "\t"
    decimal: str = "."
    entries: dict[str, list[str]] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    line: int = 0  # where the names stand

    def take(self, text: str) -> None:
        """Take a line ``key, value of each channel``."""
        key, *values = (cell.strip() for cell in text.split(self.separator))
        if text.startswith("Separator"):
            word = re.split(r"[\t,;]", text.strip())[-1].lower()
            self.separator = SEPARATORS.get(word, self.separator)
        elif key == "Decimal_Separator" and values:
            self.decimal = values[0] or ","
        if values:
            self.entries[key] = values

    def first(self, key: str, otherwise: str = "") -> str:
        """What an entry says of the first channel."""
        return self.entries.get(key, [otherwise])[0]

    def number(self, key: str, otherwise: float) -> float:
        """Number of the first channel."""
        try:
            return number(self.first(key), Style(self.decimal))
        except ValueError:
            return otherwise

    @property
    def begins(self) -> Any:
        """When the segment begins; NaT if it does not say so."""
        import pandas as pd

        at = f"{self.first('Date')} {self.first('Time')}".replace(",", ".")
        return pd.to_datetime(at, format="ISO8601", errors="coerce")


class Lvm(Text):
    """A .lvm file; ValueError if it has no segment with rows."""

    def __init__(self, path: Path) -> None:
        self._path, self._encoding = path, encoding_of(path)
        header = next((header for header, _ in self._segments(1)), None)
        if header is None:
            raise LogError(f"{path}: no rows below the header")
        names = [name for name in header.names if name != COMMENT]
        self._channels = [i for i, name in enumerate(names) if name != NAMES]
        self._steps = header.entries.get("Delta_X", [])
        titles = list(names)
        for i, unit in zip(self._channels, header.entries.get("Y_Unit_Label", []), strict=False):
            titles[i] = titled(names[i], unit)
        # With a column of X for each channel, the first stands for all.
        for k, i in enumerate(i for i, name in enumerate(names) if name == NAMES):
            names[i] = titles[i] = f"{NAMES} {k + 1}" if k else NAMES
        if header.first("X_Dimension", "Time") == "Time":
            titles[0] = "time [s]"
        layout = Layout(
            path, self._encoding, header.separator, header.names, len(header.names), header.line + 1, True,
            Style(header.decimal), {},
        )  # fmt: skip
        super().__init__(layout, names, titles)
        self.width = len(names)

    def check(self, positions: Sequence[int]) -> None:
        """Refuse channels of different rates."""
        rated = self._channels[: len(self._steps)]
        used = {self._steps[rated.index(i)] for i in positions if i in rated}
        if len(used) > 1:
            raise LogError(
                f"{self.path}: the columns are sampled at different rates, Delta_X is "
                f"{' and '.join(sorted(used))}"
            )

    def lines(self, rows: int) -> Iterator[Lines]:
        return (lines for _, lines in self._segments(rows))

    def read(self, positions: Sequence[int], rows: int) -> Iterator[Rows]:
        clock = _Clock(self.path)
        for header, lines in self._segments(rows):
            if header.names != self.layout.header:
                raise LogError(
                    f"{self.path}, line {header.line}: this segment has other columns than the first one: "
                    "save it as a file of its own"
                )
            values = self.values(lines, positions)
            if 0 in positions:
                place = list(positions).index(0)
                values[place] = clock.times(header, lines, values[place])
            yield from self.cut(lines, values, rows)

    def _segments(self, rows: int) -> Iterator[tuple[_Header, Lines]]:
        """Rows, with the header above them; a new header object begins a new segment."""
        header, in_rows, special = _Header(), False, False
        for first, text, done in chunks(self._path, self._encoding, rows):
            if in_rows and not HEADING.search("\n" + text):
                yield header, Lines.all(first, text, done)
                continue
            kept: list[tuple[int, str]] = []
            for line_number, line in enumerate(text.split("\n"), first):
                special = (special or line.startswith(START)) and not line.startswith(END)
                key = line.split(header.separator)[0].strip()
                if special or line.startswith("***"):
                    continue
                if key == NAMES:
                    names = [name.strip() for name in line.split(header.separator)]
                    header.names, header.line, in_rows = names, line_number, True
                elif in_rows and key == "Channels":
                    if kept:
                        yield header, Lines.of(kept, done)
                        kept = []
                    header = _Header(header.separator, header.decimal, dict(header.entries))
                    header.take(line)
                    in_rows = False
                elif in_rows and line.strip():
                    kept.append((line_number, line))
                elif not in_rows:
                    header.take(line)
            if kept:
                yield header, Lines.of(kept, done)


class _Clock:
    """Times of rows [s], from segment to segment."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._header: _Header | None = None
        self._start: Any = None  # of the first segment
        self._last, self._shift, self._row = -np.inf, 0.0, 0

    def times(self, header: _Header, lines: Lines, x: FloatArray) -> FloatArray:
        """Times of rows, by their X_Value or, where the file has none, by X0 and Delta_X."""
        new = header is not self._header
        if new:
            self._row, self._header = 0, header
            self._start = header.begins if self._start is None else self._start
        if header.first("X_Columns") == "No" or not np.isfinite(x).any():
            rows = np.arange(self._row, self._row + x.size)
            x = np.asarray(header.number("X0", 0.0) + header.number("Delta_X", np.nan) * rows)
        self._row += x.size
        known = x[np.isfinite(x)]
        if new:
            self._shift = 0.0
            if known.size and known[0] <= self._last:
                shift = (header.begins - self._start).total_seconds()
                self._shift = 0.0 if np.isnan(shift) else shift
        times = x + self._shift
        if new and known.size and known[0] + self._shift <= self._last:
            raise LogError(
                f"{self._path}, line {lines.numbers[0]}: time begins anew with this segment, and no date "
                "and time above it says when: give the sample rate, or save the segments as files"
            )
        self._last = float(known[-1] + self._shift) if known.size else self._last
        return times
