"""Columns of a text file: how it is written is recognised here, and pandas reads it."""

import csv
import io
import itertools
import re
import warnings
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records import scopes
from piezoest.records.cells import MISSING, Marks, Style, is_missing, is_number, number, style_of
from piezoest.records.columns import counted_names, names_columns, names_other_order, titled, with_units
from piezoest.records.comments import bare, entries_in, is_comment, numbered_names, rate_in, with_stated_units
from piezoest.records.lines import (
    LONGEST_FOOTER,
    Lines,
    check_table,
    chunks,
    encoding_of,
    end_of_rows,
    sample_lines,
    without_footer,
)
from piezoest.records.source import LogError, Rows, Source, finite, floats, shown
from piezoest.records.stamps import Clock, Onward, is_stamp, times_of

# Blank lines among the others: more are the way the file is written, fewer are samples that were lost.
MOST_BLANK = 0.1
# Lines by which the layout is recognised, and rows in which a time stamp is looked for.
HEAD_LINES, STAMP_ROWS = 10_000, 100
# Lines that instruments write above the header, at most.
LONGEST_PREAMBLE = 200
# A name with a unit in brackets, among other words.
WITH_UNIT = re.compile(r"[^\s,;|]+\s*[\[(][^\s\])]+[\])]")
# A byte order mark that is not the first, and a blank without width.
UNSEEN = "\N{ZERO WIDTH NO-BREAK SPACE}\N{ZERO WIDTH SPACE}"
# Lines that are looked at together.
PART = 500


Numbered = tuple[int, str]  # a line and its number in the file


class Layout(NamedTuple):
    """How a text file is written."""

    path: Path  # the file
    encoding: str
    delimiter: str  # a blank stands for any number of them
    header: list[str]  # names of columns; empty if there are none
    width: int  # number of columns
    begins: int  # number of the first line with a sample
    skip_blank: bool  # whether blank lines are the way it is written, and not samples that were lost
    style: Style  # how numbers are written
    stamps: dict[int, Clock]  # of the columns that hold time stamps
    sample_rate: float | None = None  # that lines above the rows state [Hz]
    units: Mapping[str, str] = MappingProxyType({})  # that such lines state, and the lines


def layout_of(path: Path) -> Layout:
    """Recognise the layout; ValueError if the file is no log, or its numbers can be read in two ways."""
    encoding = encoding_of(path)
    lines = itertools.chain.from_iterable(
        enumerate(text.split("\n"), first) for first, text, _ in chunks(path, encoding, 1000)
    )
    head: list[Numbered] = []
    comments: list[Numbered] = []
    for place, line in itertools.islice(lines, HEAD_LINES):
        (comments if is_comment(line) else head).append((place, line))
    filled = [(place, line) for place, line in head if line.strip()]
    if not filled:
        raise LogError(f"{path}: the file is empty")
    check_table(path, filled[0][1].strip())
    between = sum(filled[0][0] < place < filled[-1][0] for place, line in head if not line.strip())
    delimiter, header, rows = _table(path, filled)
    if not rows:
        raise LogError(f"{path}: no rows below the header")
    above = [line for place, line in comments if place < rows[0][0]]
    preamble = _lines_of_cells(path, filled[: len(filled) - len(rows)][:LONGEST_PREAMBLE])
    if not header:
        header = _named_in_comments(path, above, rows[0][1], delimiter)
    elif below := [line for place, line in comments if filled[-len(rows) - 1][0] < place < rows[0][0]]:
        header = with_units(header, _titles(path, bare(below[-1]), delimiter, len(header))) or header
    header = scopes.with_stated_units(header, preamble)
    header, units = with_stated_units(header, [*above, *map(" ".join, preamble)])
    texts = [line for _, line in rows]
    stamps: dict[int, Clock] = {}
    if any(":" in line or "T" in line for line in texts[:STAMP_ROWS]):
        for row in split(path, texts[:STAMP_ROWS], delimiter):
            for i, cell in enumerate(row):
                if i not in stamps and is_stamp(cell):
                    stamps[i] = Clock.of(cell)
    width, skip_blank = len(header or _cells(path, texts[0])), between > MOST_BLANK * len(filled)
    style = _style(path, _without_footer(texts, delimiter), delimiter)
    begins = rows[0][0]
    rate = rate_in([*above, *entries_in(preamble), *scopes.entries(preamble)], style)
    return Layout(path, encoding, delimiter, header, width, begins, skip_blank, style, stamps, rate, units)


def _delimiter(line: str) -> str:
    return next((mark for mark in ";\t,|" if mark in line), " ")


def _cells(path: Path, line: str) -> list[str]:
    return [cell.strip().strip(UNSEEN) for cell in split(path, [line], _delimiter(line))[0]]


def _lines_of_cells(path: Path, lines: list[Numbered]) -> list[list[str]]:
    return [_cells(path, line) for _, line in lines if line.count('"') % 2 == 0]


def _table(path: Path, filled: list[Numbered]) -> tuple[str, list[str], list[Numbered]]:
    """Delimiter, header and rows; instruments may have written other lines above, units below the header."""
    first, mark = _cells(path, filled[0][1]), _delimiter(filled[0][1])
    head = _lines_of_cells(path, filled[:LONGEST_PREAMBLE])
    if (known := scopes.heading(head)) is not None:
        return mark, known[0], filled[known[1] :]
    pairs = enumerate(itertools.pairwise(head))
    begins = next((k for k, rows in pairs if len(rows[0]) == len(rows[1]) > 1 and _numeric(*rows)), 0)
    like_first = len(head[begins]) == len(first) and _delimiter(filled[begins][1]) == mark
    like_first &= begins < 2 or names_columns(first) or not names_columns(head[begins - 1])
    if begins < 2 or like_first or len(head) < min(len(filled), LONGEST_PREAMBLE):
        header, begins = ([], 0) if _is_row_of_numbers(first) else (first, 1)
        if (counted := counted_names(first, head[1:2])) is not None:
            header, begins = counted, 1
        if header and len(head) > 1:
            # Numbers with decimal commas may be parted by blanks, and rows otherwise than names.
            mark = mark if len(header) != len(head[1]) else _delimiter(filled[1][1])
            second = split(path, [filled[1][1]], mark)[0] if mark == " " else head[1]
            if len(header) != len(second):
                header = _titles(path, filled[0][1], mark, len(second))
        if header and [row[0] for row in head[1:3]] == ["1", "2"] and len(head[1]) == len(first) + 1:
            # R writes no name above its column of numbers.
            header = ["", *first]
        if header and len(head) > 2 and (named := with_units(header, head[1])):
            header, begins = named, 2
        return mark, header, filled[begins:]
    upper, lower = head[begins - 2 : begins]
    header = with_units(upper, lower) or with_units(lower, upper) or lower
    if len(header) != len(head[begins]):
        # Nothing says what is what: columns go by their numbers.
        header = [str(k + 1) for k in range(len(head[begins]))]
    return _delimiter(filled[begins][1]), header, filled[begins:]


def _named_in_comments(path: Path, comments: list[str], row: str, delimiter: str) -> list[str]:
    """Names of columns: one a comment, or all in the last one that has names, perhaps with units below."""
    width = len(split(path, [row], delimiter)[0])
    if len(numbered := numbered_names(comments)) == width:
        return numbered
    below: list[str] = []
    for line in reversed(comments):
        names = _titles(path, bare(line), delimiter, width)
        for found in (with_units(names, below), names):
            if len(found) == width and (names_columns(found) or names_other_order(found)):
                return found
        below = names
    return []


def _titles(path: Path, line: str, delimiter: str, width: int) -> list[str]:
    """Names of columns in a line, parted as the rows are or in another way that gives as many, known ones."""
    text = line.strip()
    ways = [split(path, [text], mark)[0] for mark in (delimiter, _delimiter(text))]
    # Names may hold single blanks, as in ``time (s)``.
    ways += [re.split(r"\s+(?![(\[])", text), re.split(r"\s{2,}|\t", text), re.findall(WITH_UNIT, text)]
    fit = [[cell.strip() for cell in way] for way in ways if len(way) == width]
    return next(filter(names_columns, fit), fit[0] if fit else ways[0])


def _is_row(line: str, delimiter: str) -> bool:
    """Whether a line begins with a number, as rows do."""
    return is_number(line.strip().split(None if delimiter == " " else delimiter, 1)[0].strip(' "'))


def _without_footer(lines: list[str], delimiter: str) -> list[str]:
    """Lines but the last ones that are no rows; all of them if they are many."""
    before, last = lines[:-LONGEST_FOOTER], lines[-LONGEST_FOOTER:]
    return before + last[: end_of_rows(last, lambda line: _is_row(line, delimiter)) or len(last)]


def _is_row_of_numbers(cells: list[str]) -> bool:
    """Whether all cells are numbers, or most beside a text behind them."""
    known = [is_number(cell) for cell in cells]
    return all(known) or (known[0] and cells[0] != "" and 2 * sum(known) > len(cells))


def _numeric(*rows: list[str]) -> bool:
    return all(is_number(cell) for row in rows for cell in row)


def _style(path: Path, lines: list[str], delimiter: str) -> Style:
    # Where commas stand between numbers, one with a comma has quotation marks.
    points, commas = (any(mark in line for line in lines) for mark in (".", '"' if delimiter == "," else ","))
    if not points and not commas:
        # Without any mark in the beginning, either may come later.
        return Style("." if delimiter == "," else ".,")
    try:
        style = Style(".")
        if commas:
            style = style_of(cell for row in split(path, lines, delimiter) for cell in row)
        if not style.thousands:
            _check_columns(path, lines, delimiter, defaultdict(Marks))
        return style
    except LogError:
        raise
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None


def _check_columns(path: Path, lines: list[str], delimiter: str, columns: defaultdict[int, Marks]) -> None:
    """Refuse columns whose numbers can be read in two ways; in parts, which need less memory."""
    for start in range(0, len(lines), PART):
        for row in split(path, lines[start : start + PART], delimiter):
            for i, cell in enumerate(row):
                columns[i].see(cell)
    try:
        for column in columns.values():
            column.check()
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None


def split(path: Path, lines: list[str], delimiter: str) -> list[list[str]]:
    """Cells of lines; ValueError if they are no table."""
    if delimiter == " ":
        return [line.split() for line in lines]
    try:
        rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=False))
    except csv.Error as error:
        raise LogError(f"{path}: cannot be read as a table: {error}") from None
    if len(rows) != len(lines) or (len(lines) == 1 and lines[0].count('"') % 2):
        raise LogError(f"{path}: a quotation mark is left open")
    return rows


class Text(Source):
    """A text file with one row per sample. `names`, `titles`: as for `Source`."""

    place = "line"

    def __init__(self, layout: Layout, names: list[str], titles: list[str]) -> None:
        super().__init__(layout.path, names, titles, layout.width)
        self.layout = layout
        self.sample_rate, self.stated_units = layout.sample_rate, layout.units
        self.size = layout.path.stat().st_size
        self._marks: defaultdict[int, Marks] = defaultdict(Marks)
        if layout.style.guessed:
            self.note(f"{layout.style.guessed!r} and the like: the comma is taken for decimals, no thousands")
        for clock in layout.stamps.values():
            if clock.guessed:
                self.note(f"{clock.guessed!r} and the like: the month is taken to stand first")

    def lines(self, rows: int) -> Iterator[Lines]:
        """Lines with samples."""
        layout = self.layout
        found = sample_lines(layout.path, layout.encoding, layout.begins, layout.skip_blank, rows)
        return without_footer(found, lambda line: _is_row(line, layout.delimiter), self._left_out)

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
            i in self.layout.stamps or table[i].dtype.kind in "fiu" for i in positions
        ):
            cells = {i: table[i] for i in positions}
        else:
            rows = self._rows(block)
            cells = {i: [row[i].strip() if i < len(row) else "" for row in rows] for i in positions}
        return [self._column(block, i, cells[i]) for i in positions]

    def _check_marks(self, block: Lines) -> None:
        """Refuse numbers that can be read in two ways where the lines by which marks are known had none."""
        if self.layout.style.decimal != ".,":
            return
        lines = block.text.split("\n")
        marked = any(mark in block.text for mark in ".,")
        _check_columns(self.path, lines if marked else lines[:PART], self.layout.delimiter, self._marks)

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
        whole = len(table) == block.numbers.size and table[self.layout.width].isna().all()
        return table if whole else None

    def _rows(self, block: Lines) -> list[list[str]]:
        """Cells one by one, for numbers that are written in other ways, and to name the one that is none."""
        rows = split(self.path, block.text.split("\n"), self.layout.delimiter)
        width = self.layout.width
        for line, row in zip(block.numbers, rows, strict=True):
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
            raise LogError(
                f"{self.path}, line {block.numbers[bad]}, column {shown(title)!r}: {shown(cell)!r} is "
                f"not {what}"
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
