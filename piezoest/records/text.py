"""Columns of a text file: encoding, delimiter, decimal comma, header and blank lines are recognised."""

from __future__ import annotations

import codecs
import csv
import itertools
import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.source import Rows, Source, shown

MOST_BLANK = 0.1
MISSING = frozenset({"", "nan", "-", "--", "na", "n/a", "#n/a", "null", "none", "missing"})
# What the layout of a file is recognised by: bytes for the encoding, lines for the rest.
HEAD_BYTES, HEAD_LINES = 1 << 16, 10_000
# Characters of a line; more are no row of a log, and would fill the memory.
LONGEST_LINE = 1 << 20
# Characters that no text has, unless as UTF-16.
CONTROL = frozenset(range(32)) - frozenset(b"\t\n\v\f\r\x1a\x1b")
UTF_16 = (b"\xff\xfe", b"\xfe\xff")


class _Layout(NamedTuple):
    """How the file is written."""

    path: Path
    encoding: str
    delimiter: str
    header: list[str]
    width: int
    begins: int  # number of the first line with numbers
    skip_blank: bool  # whether blank lines are the way it is written, and not samples that were lost


def open_text(path: Path) -> Source:
    """Open a text file with one row per sample; ValueError if it is none."""
    layout = _layout(path)

    def read(positions: Sequence[int], rows: int) -> Iterator[Rows]:
        lines = _lines(layout)
        while block := list(itertools.islice(lines, rows)):
            numbers = np.fromiter((number for number, _ in block), np.int64, len(block))
            yield Rows(numbers, _values(layout, numbers, [line for _, line in block], positions))

    return Source(path, layout.header, layout.header, layout.width, read, place="line")


def _layout(path: Path) -> _Layout:
    encoding = _encoding(path)
    with path.open(encoding=encoding, errors="replace") as file:
        head = [
            (number, line)
            for number, line in itertools.islice(_numbered(path, file), HEAD_LINES)
            if not line.lstrip().startswith("#")
        ]
    filled = [(number, line) for number, line in head if line.strip()]
    if not filled:
        raise ValueError(f"{path}: the file is empty")
    # A few blank lines are samples that were lost; many are the way the file is written.
    between = sum(filled[0][0] < number < filled[-1][0] for number, line in head if not line.strip())
    delimiter = next((mark for mark in ";\t,|" if mark in filled[0][1]), " ")
    first = _split(path, [_decimal(filled[0][1], delimiter)], delimiter)[0]
    header = [] if all(_is_number(cell) for cell in first) else [cell.strip() for cell in first]
    if header and len(filled) == 1:
        raise ValueError(f"{path}: no rows below the header")
    begins = filled[1][0] if header else filled[0][0]
    return _Layout(path, encoding, delimiter, header, len(first), begins, between > MOST_BLANK * len(filled))


def _encoding(path: Path) -> str:
    with path.open("rb") as file:
        raw = file.read(HEAD_BYTES)
    if raw.startswith(UTF_16):
        return "utf-16"
    if CONTROL.intersection(raw[:4096]):
        raise ValueError(
            f"{path}: this is not a text file: save the log as CSV, or name it by its format "
            "(.mat, .h5, .parquet, .npy, .npz)"
        )
    try:
        # The last character may be cut in two.
        codecs.getincrementaldecoder("utf-8")().decode(raw)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _lines(layout: _Layout) -> Iterator[tuple[int, str]]:
    """Lines with samples and their numbers; a blank one is a sample if another follows it."""
    blank: list[tuple[int, str]] = []
    with layout.path.open(encoding=layout.encoding, errors="replace") as file:
        for number, line in _numbered(layout.path, file):
            if number < layout.begins or line.lstrip().startswith("#"):
                continue
            if not line.strip():
                if not layout.skip_blank:
                    blank.append((number, ""))
                continue
            yield from blank
            blank.clear()
            yield number, _decimal(line.rstrip("\r\n"), layout.delimiter)


def _numbered(path: Path, file: TextIO) -> Iterator[tuple[int, str]]:
    """Lines and their numbers from 1."""
    for number, line in enumerate(iter(partial(file.readline, LONGEST_LINE), ""), 1):
        if len(line) == LONGEST_LINE:
            raise ValueError(f"{path}, line {number}: more than {LONGEST_LINE} characters: this is no log")
        yield number, line


def _decimal(line: str, delimiter: str) -> str:
    """A decimal comma as a point; in a header it would only be part of a name."""
    return line if delimiter == "," else line.replace(",", ".")


def _split(path: Path, lines: list[str], delimiter: str) -> list[list[str]]:
    if delimiter == " ":
        return [line.split() for line in lines]
    try:
        rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=False))
    except csv.Error as error:
        raise ValueError(f"{path}: cannot be read as a table: {error}") from None
    if len(rows) != len(lines) or (len(lines) == 1 and lines[0].count('"') % 2):
        raise ValueError(f"{path}: a quotation mark is left open")
    return rows


def _values(
    layout: _Layout, numbers: np.ndarray[Any, Any], lines: list[str], positions: Sequence[int]
) -> list[FloatArray]:
    fast = _plain_numbers(layout, lines, positions)
    if fast is not None:
        return fast
    rows = _split(layout.path, lines, layout.delimiter)
    for number, row in zip(numbers, rows, strict=True):
        if len(row) > layout.width and any(cell.strip() for cell in row[layout.width :]):
            raise ValueError(
                f"{layout.path}, line {number}: {len(row)} fields, where the first row has {layout.width}"
            )
    return [_numbers(layout, numbers, rows, position) for position in positions]


def _plain_numbers(layout: _Layout, lines: list[str], positions: Sequence[int]) -> list[FloatArray] | None:
    """The same, several times faster, where every field is there and holds a number; else None."""
    blanks = layout.delimiter == " "
    text = "".join(lines)
    if '"' in text or not (blanks or text.count(layout.delimiter) == (layout.width - 1) * len(lines)):
        return None
    try:
        values = np.loadtxt(
            lines,
            delimiter=None if blanks else layout.delimiter,
            usecols=None if blanks else positions,
            comments=None,
            ndmin=2,
        )
    except ValueError:
        return None
    if len(values) != len(lines) or (blanks and values.shape[1] != layout.width):
        return None
    values[~np.isfinite(values)] = np.nan
    return [values[:, position].copy() for position in (positions if blanks else range(len(positions)))]


def _is_number(cell: str) -> bool:
    text = cell.strip().lower()
    if text in MISSING:
        return True
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _numbers(
    layout: _Layout, numbers: np.ndarray[Any, Any], rows: list[list[str]], position: int
) -> FloatArray:
    values = np.full(len(rows), np.nan)
    for k, row in enumerate(rows):
        cell = row[position].strip() if position < len(row) else ""
        try:
            value = float(cell)
        except ValueError:
            if cell.lower() not in MISSING:
                title = layout.header[position] if layout.header else str(position + 1)
                raise ValueError(
                    f"{layout.path}, line {numbers[k]}, column {shown(title)!r}: {shown(cell)!r} is "
                    "not a number"
                ) from None
            continue
        if math.isfinite(value):
            values[k] = value
    return values
