"""Columns of LabVIEW measurement files (.lvm), whose rows stand between blocks of headers.

Reference: NI, *Specification for the LabVIEW Measurement File (.lvm)*.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.binary import with_units
from piezoest.records.source import Rows, Source
from piezoest.records.text import Reader
from piezoest.records.text_cells import Style, number, stamp
from piezoest.records.text_layout import Layout
from piezoest.records.text_lines import Lines, chunks, encoding_of, numbered

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
        if key == "Separator" or text.startswith("Separator"):
            word = re.split(r"[\t,;]", text.strip())[-1].lower()
            self.separator = SEPARATORS.get(word, self.separator)
        elif key == "Decimal_Separator" and values:
            self.decimal = values[0] or ","
        if values:
            self.entries[key] = values

    def number(self, key: str, default: float) -> float:
        """Number of the first channel."""
        try:
            return number(self.entries[key][0], Style(self.decimal))
        except (KeyError, ValueError):
            return default

    @property
    def begins(self) -> int | None:
        """Nanoseconds at which the segment begins, since 1970; None if it does not say so."""
        date, time = (self.entries.get(key, [""])[0] for key in ("Date", "Time"))
        try:
            return stamp(f"{date} {time}") if date else None
        except ValueError:
            return None


def open_lvm(path: Path) -> Source:
    """Open a .lvm file; ValueError if it has no segment with rows."""
    encoding = encoding_of(path)
    first = next(_segments(path, encoding, 1), None)
    if first is None:
        raise ValueError(f"{path}: no rows below the header")
    header = first[0]
    names = [name for name in header.names if name != COMMENT]
    channels = [i for i, name in enumerate(names) if name != NAMES]
    units = header.entries.get("Y_Unit_Label", [])
    titles = list(names)
    for i, unit in zip(channels, units, strict=False):
        titles[i] = with_units([names[i]], [unit])[0]
    # With a column of X for each channel, the first stands for all.
    for k, i in enumerate(i for i, name in enumerate(header.names) if name == NAMES):
        names[i] = titles[i] = f"{NAMES} {k + 1}" if k else NAMES
    if header.entries.get("X_Dimension", ["Time"])[0] == "Time":
        titles[0] = "time [s]"
    layout = Layout(
        path, encoding, header.separator, header.names, len(header.names), header.line + 1, True,
        Style(header.decimal), frozenset(),
    )  # fmt: skip

    def read(positions: Sequence[int], rows: int) -> Iterator[Rows]:
        return _read(layout, positions, rows)

    def count(positions: Sequence[int]) -> int:
        return sum(lines.numbers.size for _, lines in _segments(path, encoding, 1 << 20))

    def check(positions: Sequence[int]) -> None:
        steps = header.entries.get("Delta_X", [])
        used = {steps[channels.index(i)] for i in positions if i in channels[: len(steps)]}
        if len(used) > 1:
            raise ValueError(
                f"{path}: the columns are sampled at different rates, Delta_X is {' and '.join(sorted(used))}"
            )

    return Source(
        path, names, titles, len(names), read, count, path.stat().st_size, place="line", check=check
    )


def _segments(path: Path, encoding: str, rows: int) -> Iterator[tuple[_Header, Lines]]:
    """Rows, with the header above them; a new header object begins a new segment."""
    header, in_rows, special = _Header(), False, False
    for first, text, done in chunks(path, encoding, rows):
        text = text.removesuffix("\n")
        if in_rows and not HEADING.search("\n" + text):
            yield header, Lines(np.arange(first, first + text.count("\n") + 1), text, done)
            continue
        kept: list[tuple[int, str]] = []
        for line_number, line in numbered(first, text):
            special = (special or line.startswith(START)) and not line.startswith(END)
            key = line.split(header.separator)[0].strip()
            if special or line.startswith("***"):
                continue
            if key == NAMES:
                names = [name.strip() for name in line.split(header.separator)]
                header.names, header.line, in_rows = names, line_number, True
            elif in_rows and line.strip() and key != "Channels":
                kept.append((line_number, line))
            elif in_rows and key == "Channels":
                if kept:
                    yield header, _joined(kept, done)
                    kept = []
                header = _Header(header.separator, header.decimal, dict(header.entries))
                header.take(line)
                in_rows = False
            elif not in_rows:
                header.take(line)
        if kept:
            yield header, _joined(kept, done)


def _joined(kept: list[tuple[int, str]], done: int) -> Lines:
    numbers = np.fromiter((line_number for line_number, _ in kept), np.int64, len(kept))
    return Lines(numbers, "\n".join(line for _, line in kept), done)


def _read(layout: Layout, positions: Sequence[int], rows: int) -> Iterator[Rows]:
    values_of = Reader(layout, positions).values
    clock = _Clock(layout.path)
    for header, lines in _segments(layout.path, layout.encoding, rows):
        if header.names != layout.header:
            raise ValueError(
                f"{layout.path}, line {header.line}: this segment has other columns than the first one: "
                "save it as a file of its own"
            )
        text = lines.text
        if layout.header[-1] == COMMENT and text.count(header.separator) == (layout.width - 2) * (
            lines.numbers.size
        ):
            # Rows end before the comment where there is none; complete rows are read much faster.
            text = text.replace("\n", f"{header.separator}\n") + header.separator
        values = values_of(lines._replace(text=text))
        if 0 in positions:
            place = list(positions).index(0)
            values[place] = clock.times(header, lines, values[place])
        for start in range(0, lines.numbers.size, rows):
            part = slice(start, start + rows)
            yield Rows(lines.numbers[part], [each[part] for each in values], lines.done)


class _Clock:
    """Times of rows [s], from segment to segment."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._header: _Header | None = None
        self._start: int | None = None  # of the first segment [ns]
        self._last, self._shift, self._row = -np.inf, 0.0, 0

    def times(self, header: _Header, lines: Lines, x: FloatArray) -> FloatArray:
        """Times of rows, by their X_Value or, where the file has none, by X0 and Delta_X."""
        new = header is not self._header
        if new:
            self._row = 0
            self._start = header.begins if self._header is None else self._start
            self._header = header
        if header.entries.get("X_Columns", [""])[0] == "No" or not np.isfinite(x).any():
            rows = np.arange(self._row, self._row + x.size)
            x = np.asarray(header.number("X0", 0.0) + header.number("Delta_X", np.nan) * rows)
        self._row += x.size
        known = x[np.isfinite(x)]
        if new and known.size and known[0] <= self._last:
            self._shift = self._shift_of(header)
            if known[0] + self._shift <= self._last:
                raise ValueError(
                    f"{self._path}, line {lines.numbers[0]}: time begins anew with this segment, and no date "
                    "and time above it says when: give the sample rate, or save the segments as files"
                )
        elif new:
            self._shift = 0.0
        times = x + self._shift
        self._last = float(known[-1] + self._shift) if known.size else self._last
        return times

    def _shift_of(self, header: _Header) -> float:
        begins = header.begins
        return 0.0 if begins is None or self._start is None else (begins - self._start) / 1e9
