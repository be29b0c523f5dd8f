"""Columns of a text file, in blocks: by the readers of Arrow or NumPy where they can, else cell by cell."""

from __future__ import annotations

import functools
import importlib.util
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.columns import split_unit
from piezoest.records.source import Rows, Source, shown
from piezoest.records.text_cells import MISSING, number, seconds, stamp
from piezoest.records.text_layout import Layout, layout_of, split
from piezoest.records.text_lines import Lines, sample_lines

# Below this size [bytes], Arrow takes longer to load than it saves.
WORTH_ARROW = 1 << 23
# One block of Arrow's must hold a whole one of ours; bytes beside characters that take several.
ARROW_ROOM = 1 << 20
ARROW_MISSING = sorted(MISSING | {word.upper() for word in MISSING} | {"NaN", "None", "Null"})


def open_text(path: Path) -> Source:
    """Open a text file with one row per sample; ValueError if it is none."""
    layout = layout_of(path)

    def lines(rows: int) -> Iterator[Lines]:
        return sample_lines(path, layout.encoding, layout.begins, layout.skip_blank, rows)

    def read(positions: Sequence[int], rows: int) -> Iterator[Rows]:
        return read_lines(layout, lines(rows), positions, rows)

    def count(positions: Sequence[int]) -> int:
        return sum(block.numbers.size for block in lines(1 << 20))

    # Time stamps come out in seconds, whatever the header says.
    titles = [
        f"{split_unit(name)[0]} [s]" if i in layout.stamps else name for i, name in enumerate(layout.header)
    ]
    size = path.stat().st_size
    return Source(path, layout.header, titles, layout.width, read, count, size, place="line")


def read_lines(
    layout: Layout, blocks: Iterable[Lines], positions: Sequence[int], rows: int
) -> Iterator[Rows]:
    """Columns at these positions, in blocks of at most so many rows."""
    values_of = Reader(layout, positions).values
    for block in blocks:
        values = values_of(block)
        for start in range(0, block.numbers.size, rows):
            part = slice(start, start + rows)
            yield Rows(block.numbers[part], [each[part] for each in values], block.done)


class Reader:
    """Reads columns of one file, block after block.

    Parameters
    ----------
    layout : Layout
        How the file is written.
    positions : sequence of int
        Columns that are wanted.
    """

    def __init__(self, layout: Layout, positions: Sequence[int]) -> None:
        self._layout, self._positions = layout, positions
        self._origins: dict[int, int] = {}
        self._stamped = layout.stamps.intersection(positions)
        arrow = importlib.util.find_spec("pyarrow") and layout.delimiter != " "
        self._arrow = bool(arrow and layout.path.stat().st_size >= WORTH_ARROW)

    def values(self, block: Lines) -> list[FloatArray]:
        """Columns of a block; ValueError that names line and column if a cell holds something else."""
        text = self._with_points(block.text)
        if text is not None:
            for reader in (self._by_arrow, self._by_numpy):
                if (found := reader(text, block.numbers.size)) is not None:
                    return found
        lines = block.text.split("\n")
        cells = split(self._layout.path, lines, self._layout.delimiter)
        self._check_width(block.numbers, cells)
        return [self._by_cells(block.numbers, cells, position) for position in self._positions]

    def _with_points(self, text: str) -> str | None:
        """The text with decimal points; None if cells have to be looked at one by one."""
        style, delimiter = self._layout.style, self._layout.delimiter
        if style.thousands:
            return None
        if delimiter == ",":
            return text if "." in style.decimal else None
        if style.decimal == ",":
            return None if "." in text else text.replace(",", ".")
        return text.replace(",", ".") if "," in style.decimal else text

    def _by_arrow(self, text: str, count: int) -> list[FloatArray] | None:
        if not self._arrow:
            return None
        import pyarrow
        from pyarrow import csv

        names = [str(i) for i in range(self._layout.width)]
        wanted = [names[i] for i in self._positions]
        for zone in (None, "UTC") if self._stamped else (None,):
            times = pyarrow.timestamp("ns", zone)
            kinds = [times if i in self._stamped else pyarrow.float64() for i in self._positions]
            try:
                table = csv.read_csv(
                    io.BytesIO(text.encode()),
                    csv.ReadOptions(column_names=names, use_threads=False, block_size=len(text) + ARROW_ROOM),
                    csv.ParseOptions(delimiter=self._layout.delimiter, ignore_empty_lines=False),
                    csv.ConvertOptions(
                        include_columns=wanted,
                        column_types=dict(zip(wanted, kinds, strict=True)),
                        null_values=ARROW_MISSING,
                    ),
                )
            except pyarrow.ArrowException:
                continue
            if table.num_rows == count:
                return [self._of_arrow(table.column(str(i)).to_numpy(), i) for i in self._positions]
        return None

    def _of_arrow(self, values: Any, position: int) -> FloatArray:
        if position in self._stamped:
            return seconds(values, self._origins, position)
        return _finite(values.astype(np.float64))

    def _by_numpy(self, text: str, count: int) -> list[FloatArray] | None:
        """As `_by_arrow`, where every field is there and holds a number."""
        layout, blanks = self._layout, self._layout.delimiter == " "
        complete = blanks or text.count(layout.delimiter) == (layout.width - 1) * count
        if self._stamped or '"' in text or not complete:
            return None
        try:
            values = np.loadtxt(
                text.split("\n"),
                delimiter=None if blanks else layout.delimiter,
                usecols=None if blanks else self._positions,
                comments=None,
                ndmin=2,
            )
        except ValueError:
            return None
        if len(values) != count or (blanks and values.shape[1] != layout.width):
            return None
        places = self._positions if blanks else range(len(self._positions))
        return [_finite(values[:, place].copy()) for place in places]

    def _check_width(self, numbers: np.ndarray[Any, Any], cells: list[list[str]]) -> None:
        width = self._layout.width
        for line, row in zip(numbers, cells, strict=True):
            if len(row) > width and any(cell.strip() for cell in row[width:]):
                raise ValueError(
                    f"{self._layout.path}, line {line}: {len(row)} fields, where the first row has {width}"
                )

    def _by_cells(self, numbers: np.ndarray[Any, Any], cells: list[list[str]], position: int) -> FloatArray:
        layout, stamped = self._layout, position in self._stamped
        values = np.full(len(cells), np.nan)
        ticks = np.full(len(cells), np.datetime64("NaT"), "datetime64[ns]")
        read = stamp if stamped else functools.partial(number, style=layout.style)
        for k, row in enumerate(cells):
            cell = row[position].strip() if position < len(row) else ""
            try:
                value = read(cell)
            except ValueError:
                if cell.lower() not in MISSING:
                    title = layout.header[position] if layout.header else str(position + 1)
                    what = "a time stamp such as 2026-11-22 10:00:00.005" if stamped else "a number"
                    raise ValueError(
                        f"{layout.path}, line {numbers[k]}, column {shown(title)!r}: {shown(cell)!r} is "
                        f"not {what}"
                    ) from None
                continue
            if value is None:
                continue
            if stamped:
                ticks[k] = np.datetime64(int(value), "ns")
            elif math.isfinite(value):
                values[k] = value
        return seconds(ticks, self._origins, position) if stamped else values


def _finite(values: FloatArray) -> FloatArray:
    values[~np.isfinite(values)] = np.nan
    return values
