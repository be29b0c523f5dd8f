"""Columns of a text file, whose layout is known: pandas reads it."""

import io
import warnings
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.cells import MISSING, Marks, is_missing, is_number, number
from piezoest.records.comments import bare, states_units
from piezoest.records.layout import PART, Layout, check_columns, first_cell, is_row, layout_of, split
from piezoest.records.lines import Lines, sample_lines, without_footer
from piezoest.records.source import LogError, Rows, Source, finite, floats, shown
from piezoest.records.stamps import Onward, times_of
from piezoest.records.titles import titled


class Text(Source):
    """A text file with one row per sample. `names`, `titles`: as for `Source`."""

    place = "line"

    def __init__(self, layout: Layout, names: list[str], titles: list[str]) -> None:
        super().__init__(layout.path, names, titles, layout.width)
        self.layout = layout
        self.sample_rate, self.stated_units = layout.sample_rate, layout.units
        self.size = layout.path.stat().st_size
        self._commented = False  # whether a row that is a comment has been noted
        self.note_factors(layout.lines)
        self._marks: defaultdict[int, Marks] = defaultdict(Marks)
        if layout.style.guessed:
            self.note(f"{layout.style.guessed!r} and the like: the comma is taken for decimals, no thousands")
        for clock in layout.stamps.values():
            if clock.guessed:
                self.note(f"{clock.guessed!r} and the like: the month is taken to stand first")

    def lines(self, rows: int) -> Iterator[Lines]:
        """Lines with samples."""
        layout = self.layout
        found = sample_lines(
            layout.path, layout.encoding, layout.begins, layout.skip_blank, rows, self._skipped
        )
        return without_footer(
            found,
            lambda line: is_row(line, layout.delimiter),
            lambda line: first_cell(line, layout.delimiter) != "",
            self._left_out,
        )

    def _skipped(self, place: int, line: str) -> None:
        text = bare(line).strip()
        row = not self._commented and text != "" and is_row(text, self.layout.delimiter)
        self._commented |= row
        if row or states_units(line):
            self.note(f"line {place}: {shown(line)!r} stands between rows, and is skipped")

    def _left_out(self, place: int, line: str) -> None:
        self.note(f"line {place}: {shown(line)!r} is no row, the log is taken to end before it")

    def count(self, positions: Sequence[int]) -> int:
        """Number of rows, for which the file is read."""
        return sum(block.numbers.size for block in self.lines(1 << 20))

    def read(self, positions: Sequence[int], rows: int) -> Iterator[Rows]:
        clocks = {
            k: Onward(self.layout.stamps[i].turn) for k, i in enumerate(positions) if i in self.layout.stamps
        }
        for block in self.lines(rows):
            values = self.values(block, positions)
            for k, clock in clocks.items():
                values[k], anew = clock(values[k])
                for row in anew:
                    hours = f"{clock.turn / 3600.0:g} h"
                    self.note(f"line {block.numbers[row]}: the clock starts again at zero, {hours} are added")
            yield from self.cut(block, values, rows)

    def cut(self, block: Lines, values: list[FloatArray], rows: int) -> Iterator[Rows]:
        """Yield what was read of lines in blocks of at most so many rows."""
        for start in range(0, block.numbers.size, rows):
            part = slice(start, start + rows)
            yield Rows(block.numbers[part], [each[part] for each in values], block.done)

    def values(self, block: Lines, positions: Sequence[int]) -> list[FloatArray]:
        """Columns of lines; ValueError that names line and column if a cell holds something else."""
        self._check_marks(block)
        table = self._table(block)
        if table is not None and all(
            (i in self.layout.stamps) != (table[i].dtype.kind in "fiu") for i in positions
        ):
            cells = {i: table[i] for i in positions}
        else:
            rows = self._rows(block)
            units = self.layout.cell_units
            cells = {
                i: [row[i].strip().removesuffix(units.get(i, "")) if i < len(row) else "" for row in rows]
                for i in positions
            }
        return [self._column(block, i, cells[i]) for i in positions]

    def _check_marks(self, block: Lines) -> None:
        """Refuse numbers that can be read in two ways where the lines by which marks are known had none."""
        if self.layout.style.decimal != ".,":
            return
        lines = block.text.split("\n")
        marked = any(mark in block.text for mark in ".,")
        check_columns(self.path, lines if marked else lines[:PART], self.layout.delimiter, self._marks)

    def _table(self, block: Lines) -> Any:
        """DataFrame of lines, with text in columns that hold something else; None if that cannot be."""
        text, style, delimiter = block.text, self.layout.style, self.layout.delimiter
        if style.thousands or ("." not in style.decimal and (delimiter == "," or "." in text)):
            return None
        if "," in style.decimal and delimiter != ",":
            text = text.replace(",", ".")
        import pandas as pd

        try:
            with warnings.catch_warnings():
                # It only warns of a first row that is too long.
                warnings.simplefilter("error", pd.errors.ParserWarning)
                table = pd.read_csv(
                    io.StringIO(text),
                    sep=r"\s+" if delimiter == " " else delimiter,
                    header=None,
                    names=list(range(self.layout.width + 1)),
                    index_col=False,
                    na_values=MISSING,
                    keep_default_na=False,
                    skip_blank_lines=False,
                    skipinitialspace=True,
                    low_memory=False,
                )
        except (ValueError, pd.errors.ParserWarning):
            return None
        width = self.layout.width
        if len(table) != block.numbers.size or not table[width].isna().all():
            return None
        if delimiter == " " and width > 1 and (ends := table[width - 1].isna()).any():
            # Which of its cells a short row has, nobody knows.
            lines = text.split("\n")
            short = [k for k in np.flatnonzero(ends) if len(lines[k].split()) < width]
            lost = np.isin(np.arange(len(table)), short)
            table = table.mask(np.broadcast_to(lost[:, None], table.shape)) if short else table
        return table

    def _rows(self, block: Lines) -> list[list[str]]:
        """Cells one by one, for numbers that are written in other ways, and to name the one that is none."""
        rows = split(self.path, block.text.split("\n"), self.layout.delimiter)
        width = self.layout.width
        for line, row in zip(block.numbers, rows, strict=True):
            if self.layout.delimiter == " " and len(row) < width and all(map(is_number, row)):
                row.clear()
            if any(cell.strip() for cell in row[width:]):
                raise LogError(
                    f"{self.path}, line {line}: {len(row)} fields, where the first row has {width}"
                )
        return rows

    def _column(self, block: Lines, position: int, cells: Any) -> FloatArray:
        clock, bad, what = self.layout.stamps.get(position), -1, "a number"
        if clock is not None:
            values, what = (
                floats(times_of(cells, clock.day_first), clock.origin),
                "a time stamp such as 2026-11-22 10:00:00.005",
            )
            unknown = np.flatnonzero(np.isnan(values)).tolist()
            bad = next((k for k in unknown if not is_missing(str(cells[k]))), -1)
        elif isinstance(cells, list):
            values = np.full(len(cells), np.nan)
            for k, cell in enumerate(cells):
                try:
                    values[k] = number(cell, self.layout.style)
                except ValueError:
                    if not is_missing(cell):
                        bad = k
                        break
        else:
            values = cells.to_numpy()
        if bad >= 0:
            title = self.layout.header[position] if self.layout.header else str(position + 1)
            cell = self._rows(block)[bad][position].strip()
            hint = ""
            if clock is None and ":" in cell:
                hint = "; if it is a time stamp, it has an unknown form: give the sample rate instead"
            raise LogError(
                f"{self.path}, line {block.numbers[bad]}, column {shown(title)!r}: {shown(cell)!r} is "
                f"not {what}{hint}"
            )
        return finite(values)


def open_text(path: Path) -> Text:
    """Open a text file with one row per sample; ValueError if it is none."""
    layout = layout_of(path)
    # Time stamps come out in seconds, whatever the header says.
    titles = [
        titled(name or "time", "s") if i in layout.stamps else name for i, name in enumerate(layout.header)
    ]
    return Text(layout, layout.header, titles)
