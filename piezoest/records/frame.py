"""Columns of a table in memory: a DataFrame of pandas or Polars, or the sheet of a spreadsheet."""

import datetime
import zipfile
from collections.abc import Iterator, Sequence
from numbers import Number
from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest._checks import FloatArray
from piezoest.records.beside import units_beside
from piezoest.records.cells import Style, is_missing
from piezoest.records.comments import entries_in, rate_in, with_stated_units
from piezoest.records.lines import LONGEST_MEANS
from piezoest.records.source import EXTRA, LogError, Rows, Source, check_size, damaged, floats, shown
from piezoest.records.titles import NAMES, split_unit, titled, with_units

TIMES = datetime.date | datetime.time | datetime.timedelta
NO_FLOATS = [datetime.datetime, datetime.date, datetime.time, datetime.timedelta]
NO_NUMBERS = bool | np.bool_ | complex | np.complexfloating


class Frame(Source):
    """A DataFrame of pandas, whose columns may have any names; the rest as for `Source`."""

    def __init__(
        self, path: Path, series: list[Any], names: list[str], titles: list[str], first: int, whole: str
    ) -> None:
        titles = [
            titled(title, "s") if each.dtype.kind in "mM" else title
            for title, each in zip(titles, series, strict=False)
        ]
        super().__init__(path, names, titles, len(series))
        self._series, self._first, self.whole = series, first, whole

    def count(self, positions: Sequence[int]) -> int:
        return len(self._series[0])

    def read(self, positions: Sequence[int], rows: int) -> Iterator[Rows]:
        columns = [self._floats(position) for position in positions]
        for start in range(0, self.count(positions), rows):
            numbers = np.arange(start, min(start + rows, self.count(positions))) + self._first
            yield Rows(numbers, [each[start : start + rows] for each in columns], start + numbers.size)

    def _floats(self, position: int) -> FloatArray:
        cells = self._series[position]
        bad = (
            np.zeros(1) if cells.dtype.kind in "mMfiu" else (cells.notna() & ~_are_numbers(cells)).to_numpy()
        )
        if not bad.any() and cells.dtype.kind == "O" and cells.map(type).isin(NO_FLOATS).any():
            raise LogError(
                f"{self.path}: {self._title(position)} has several kinds of times: make it seconds"
            )
        if not bad.any():
            return floats(cells)
        k = int(np.argmax(bad))
        raise LogError(
            f"{self.path}, row {self._first + k}, {self._title(position)}: {shown(str(cells.iloc[k]))!r} is "
            "not a number: make it one"
        )

    def _title(self, position: int) -> str:
        return f"column {shown(self.names[position] if self.names else str(position + 1))!r}"


def _are_numbers(cells: Any) -> Any:
    return cells.map(lambda cell: isinstance(cell, Number | TIMES) and not isinstance(cell, NO_NUMBERS))


# ---------------------------------------------------------------- DataFrames


def is_frame(data: Any) -> bool:
    """Whether something is a DataFrame of pandas or Polars."""
    return (hasattr(data, "iloc") or hasattr(data, "get_columns")) and hasattr(data, "columns")


def frame_source(frame: Any) -> Frame:
    """Columns of a DataFrame; ValueError if it is none, or has no columns or no rows."""
    if hasattr(frame, "collect") and not is_frame(frame):
        raise LogError("frame is a LazyFrame, which holds no numbers yet: pass frame.collect()")
    if not is_frame(frame):
        raise LogError(f"frame must be a DataFrame of pandas or Polars, got {type(frame).__name__}")
    import pandas as pd

    names = ["/".join(map(str, name)) if isinstance(name, tuple) else str(name) for name in frame.columns]
    if hasattr(frame, "iloc"):
        series = [frame.iloc[:, i] for i in range(len(names))]
    else:
        series = [pd.Series(each.to_numpy()) for each in frame.get_columns()]
    # The columns of an array that became a frame are only numbered.
    nameless = list(frame.columns) == list(range(len(series)))
    series, titles = list(map(_typed, series)), list(names)
    index = getattr(frame, "index", pd.RangeIndex(0))
    if index.dtype.kind in "mM" or (index.dtype.kind in "fiu" and _is_time(str(index.name))):
        names = [str(index.name) if index.name is not None else "index", *names]
        # Whatever its name is: the index is the time.
        titles = [names[0] if _is_time(names[0]) else "time", *titles]
        series, nameless = [index.to_series(), *series], False
    if not series or not len(series[0]):
        raise LogError("frame has no rows" if series else "frame has no columns")
    if nameless:
        names = titles = []
    found = Frame(Path("frame"), series, names, titles, 1, "it is in memory already")
    attributes = getattr(frame, "attrs", {})
    found.stated_units = units_beside((str(key), str(text)) for key, text in attributes.items())
    return found


def _is_time(name: str) -> bool:
    return split_unit(name)[0].lower() in NAMES["time"]


# ---------------------------------------------------------------- spreadsheets


def open_sheet(path: Path) -> Frame:
    """Open an Excel or OpenDocument file: the first sheet with a table of numbers, its header above them."""
    _extras.load("python_calamine", EXTRA, "reading spreadsheets")
    import pandas as pd

    if zipfile.is_zipfile(path):
        with damaged(path, "a spreadsheet"), zipfile.ZipFile(path) as packed:
            check_size(path, sum(part.file_size for part in packed.infolist()))
    with damaged(path, "a spreadsheet"):
        # As objects, so that text stays text: 1.234 may be 1234 where it was typed.
        sheets = pd.read_excel(
            path, sheet_name=None, header=None, dtype=object, engine="calamine", na_filter=False
        )
    for title in sheets:
        sheet = sheets[title]
        sheet = sheet.mask(sheet.map(lambda cell: is_missing(str(cell))))
        numbers, cells = (_are_numbers(sheet) & sheet.notna()).sum(axis=1), sheet.notna().sum(axis=1)
        numeric = np.flatnonzero(numbers > 1)
        if numeric.size:
            break
    else:
        raise LogError(
            f"{path}: no sheet has a table of numbers in it; there are {', '.join(map(shown, sheets))}"
        )
    begins = int(numeric[0])
    while begins > 0 and numbers[begins - 1] == cells[begins - 1] > 0:
        # A sample of which only one cell is not missing.
        begins -= 1
    table = sheet.iloc[begins:].dropna(axis=1, how="all")
    table = table.loc[: table.last_valid_index()]
    empty = np.flatnonzero(table.iloc[:, 0].isna())
    means = 0 < empty.size <= LONGEST_MEANS and empty[0] == len(table) - empty.size > 0
    # Lines below the rows, such as of means, have no time.
    table = table.iloc[: empty[0]] if means else table
    above = sheet.iloc[:begins][table.columns].dropna(how="all")
    lines = [[str(name).strip() for name in line] for line in above.fillna("").to_numpy()]
    names = lines[-1] if lines else []
    if len(lines) > 1:
        # The names of a group stand above them.
        own = [name or group for name, group in zip(names, lines[-2], strict=True)]
        names = with_units(lines[-2], names) or with_units(names, lines[-2]) or own
    # A title above the table is no header.
    header = names if sum(map(bool, names)) > 1 else []
    # Other lines above may be longer than the table.
    said = [list(map(str, line)) for line in sheet.iloc[:begins].fillna("").to_numpy()]
    header, units = with_stated_units(header, list(map(" ".join, said)))
    series = [_typed(table[i]) for i in table.columns]
    found = Frame(
        path, series, header, header, begins + 1, "a spreadsheet is read as a whole: save the log as CSV"
    )
    if means:
        found.note(f"row {begins + 1 + len(table)} has no first cell: the log is taken to end before it")
    found.note_factors(map(" ".join, said))
    found.stated_units, found.sample_rate = units, rate_in(entries_in(said), Style())
    if len(sheets) > 1:
        found.note(f"sheet {shown(title)!r} of {len(sheets)} is read")
    return found


def _typed(cells: Any) -> Any:
    """Column with dates and times of day as pandas has them."""
    import pandas as pd

    if cells.dtype.kind != "O":
        return cells
    known = cells.dropna()
    if known.map(lambda cell: isinstance(cell, datetime.time)).all():
        return pd.Timestamp(0) + pd.to_timedelta(cells.astype(str), errors="coerce")
    if known.map(lambda cell: isinstance(cell, datetime.timedelta)).all():
        return pd.to_timedelta(cells)
    if known.map(lambda cell: isinstance(cell, datetime.date)).all():
        return pd.to_datetime(cells, utc=True)
    return cells.infer_objects()
