"""How a text file is written: delimiter, header, blank lines, marks in numbers, and time stamps."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from piezoest.records.text_cells import Style, is_number, is_stamp, style_of
from piezoest.records.text_lines import chunks, encoding_of, numbered

# Blank lines among the others: more are the way the file is written, fewer are samples that were lost.
MOST_BLANK = 0.1
# Lines by which the layout is recognised, and rows in which a time stamp is looked for.
HEAD_LINES, STAMP_ROWS = 10_000, 100
ROWS_AT_A_TIME = 1000


class Layout(NamedTuple):
    """How a text file is written.

    Parameters
    ----------
    path : Path
        The file.
    encoding, delimiter : str
        A blank stands for any number of them.
    header : list of str
        Names of columns; empty if there are none.
    width : int
        Number of columns.
    begins : int
        Number of the first line with a sample.
    skip_blank : bool
        Whether blank lines are the way it is written, and not samples that were lost.
    style : Style
        How numbers are written.
    stamps : frozenset of int
        Columns of time stamps.
    """

    path: Path
    encoding: str
    delimiter: str
    header: list[str]
    width: int
    begins: int
    skip_blank: bool
    style: Style
    stamps: frozenset[int]


def layout_of(path: Path) -> Layout:
    """Recognise the layout; ValueError if the file is no log, or its numbers can be read in two ways."""
    encoding = encoding_of(path)
    head = [
        (number, line)
        for number, line in itertools.islice(_head(path, encoding), HEAD_LINES)
        if not line.lstrip().startswith("#")
    ]
    filled = [(number, line) for number, line in head if line.strip()]
    if not filled:
        raise ValueError(f"{path}: the file is empty")
    between = sum(filled[0][0] < number < filled[-1][0] for number, line in head if not line.strip())
    delimiter = next((mark for mark in ";\t,|" if mark in filled[0][1]), " ")
    first = split(path, [filled[0][1]], delimiter)[0]
    header = [] if all(is_number(cell) for cell in first) else [cell.strip() for cell in first]
    if header and len(filled) == 1:
        raise ValueError(f"{path}: no rows below the header")
    rows = filled[1:] if header else filled
    return Layout(
        path, encoding, delimiter, header, len(first), rows[0][0], between > MOST_BLANK * len(filled),
        _style(path, [line for _, line in rows], delimiter),
        _stamps(path, [line for _, line in rows[:STAMP_ROWS]], delimiter),
    )  # fmt: skip


def _head(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    for first, text, _ in chunks(path, encoding, ROWS_AT_A_TIME):
        yield from numbered(first, text.removesuffix("\n"))


def split(path: Path, lines: list[str], delimiter: str) -> list[list[str]]:
    """Cells of lines; ValueError if they are no table."""
    if delimiter == " ":
        return [line.split() for line in lines]
    try:
        rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=False))
    except csv.Error as error:
        raise ValueError(f"{path}: cannot be read as a table: {error}") from None
    if len(rows) != len(lines) or (len(lines) == 1 and lines[0].count('"') % 2):
        raise ValueError(f"{path}: a quotation mark is left open")
    return rows


def _style(path: Path, lines: list[str], delimiter: str) -> Style:
    # Where commas stand between numbers, one with a comma has quotation marks.
    mark = '"' if delimiter == "," else ","
    if not any(mark in line for line in lines):
        # Without any mark in the beginning, either may come later.
        return Style("." if delimiter == "," or any("." in line for line in lines) else ".,")
    try:
        return style_of(cell for row in split(path, lines, delimiter) for cell in row)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _stamps(path: Path, lines: list[str], delimiter: str) -> frozenset[int]:
    if not any(":" in line for line in lines):
        return frozenset()
    rows = split(path, lines, delimiter)
    return frozenset(i for row in rows for i, cell in enumerate(row) if is_stamp(cell))
