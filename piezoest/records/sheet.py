"""Columns of a spreadsheet: the first sheet with a table of numbers, its header above them."""

from __future__ import annotations

import datetime
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest._checks import FloatArray
from piezoest.records.binary import EXTRA, damaged
from piezoest.records.source import Rows, Source, check_size, shown
from piezoest.records.text_cells import MISSING

SPREADSHEET = "a spreadsheet"
DAY = datetime.date(1, 1, 1)
Cells = list[list[Any]]


def open_sheet(path: Path) -> Source:
    """Open an Excel or OpenDocument file, which is read as a whole."""
    calamine = _extras.load("python_calamine", EXTRA, "reading spreadsheets")
    if zipfile.is_zipfile(path):
        with damaged(path, SPREADSHEET), zipfile.ZipFile(path) as packed:
            check_size(path, sum(part.file_size for part in packed.infolist()))
    with damaged(path, SPREADSHEET), calamine.CalamineWorkbook.from_path(path) as book:
        names = list(book.sheet_names)
        # Without the empty rows above the table the numbers of rows would not be those of the sheet.
        found = (_table(book.get_sheet_by_name(name).to_python(skip_empty_area=False)) for name in names)
        table = next((each for each in found if each is not None), None)
    if table is None:
        raise ValueError(
            f"{path}: no sheet has a table of numbers in it; there are {', '.join(map(shown, names))}"
        )
    first, header, rows = table
    stamped = [any(isinstance(row[i], datetime.date) for row in rows) for i in range(len(rows[0]))]
    titles = [f"{name} [s]" if stamp else name for name, stamp in zip(header, stamped, strict=False)]
    numbers = np.arange(first, first + len(rows))

    def read(positions: Sequence[int], block: int) -> Iterator[Rows]:
        columns = [_column(path, first, rows, i, header[i] if header else str(i + 1)) for i in positions]
        for start in range(0, len(rows), block):
            part = slice(start, min(start + block, len(rows)))
            yield Rows(numbers[part], [values[part] for values in columns], part.stop)

    return Source(
        path, header, titles, len(rows[0]), read, lambda positions: len(rows),
        whole="a spreadsheet is read as a whole: save the log as CSV",
    )  # fmt: skip


def _table(cells: Cells) -> tuple[int, list[str], Cells] | None:
    """Number of the first row with numbers, names of the columns, and the rows; None if there are none."""
    while cells and all(_is_empty(cell) for cell in cells[-1]):
        cells.pop()
    begins = next((k for k, row in enumerate(cells) if sum(map(_is_number, row)) > 1), None)
    if begins is None:
        return None
    above = next((row for row in reversed(cells[:begins]) if not all(map(_is_empty, row))), [])
    filled = [i for i in range(len(cells[begins])) if any(not _is_empty(row[i]) for row in cells[begins:])]
    names = [str(above[i]).strip() for i in filled] if above else []
    # A title above the table is no header.
    header = names if sum(map(bool, names)) > 1 else []
    return begins + 1, header, [[row[i] for i in filled] for row in cells[begins:]]


def _is_empty(cell: Any) -> bool:
    return cell is None or (isinstance(cell, str) and not cell.strip())


def _is_number(cell: Any) -> bool:
    kinds = int | float | datetime.date | datetime.time | datetime.timedelta
    return isinstance(cell, kinds) and not isinstance(cell, bool)


def _column(path: Path, first: int, rows: Cells, position: int, title: str) -> FloatArray:
    values = np.full(len(rows), np.nan)
    origin: Any = None
    for k, row in enumerate(rows):
        cell = row[position]
        if isinstance(cell, datetime.time):
            cell = datetime.datetime.combine(DAY, cell)
        elif isinstance(cell, datetime.date) and not isinstance(cell, datetime.datetime):
            cell = datetime.datetime.combine(cell, datetime.time())
        if isinstance(cell, datetime.datetime):
            origin = cell if origin is None else origin
            cell = cell - origin
        if isinstance(cell, datetime.timedelta):
            values[k] = cell.total_seconds()
        elif _is_number(cell):
            values[k] = cell if np.isfinite(cell) else np.nan
        elif not _is_empty(cell) and str(cell).strip().lower() not in MISSING:
            raise ValueError(
                f"{path}, row {first + k}, column {shown(title)!r}: {shown(str(cell))!r} is not a number: "
                "make it one in the spreadsheet"
            )
    return values
