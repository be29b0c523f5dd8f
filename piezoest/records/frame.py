"""Columns of a table in memory, of pandas or Polars, neither of which is imported for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.binary import column
from piezoest.records.columns import NAMES, split_unit
from piezoest.records.source import Rows, Source, shown
from piezoest.records.text_cells import seconds

FRAME = Path("frame")


def is_frame(data: Any) -> bool:
    """Whether something is a DataFrame of pandas or Polars."""
    return (hasattr(data, "iloc") or hasattr(data, "get_columns")) and hasattr(data, "columns")


def frame_source(frame: Any) -> Source:
    """Columns of a DataFrame.

    Raises
    ------
    ValueError
        If it is none, or has no columns or no rows.
    """
    if hasattr(frame, "collect") and not is_frame(frame):
        raise ValueError("frame is a LazyFrame, which holds no numbers yet: pass frame.collect()")
    if not is_frame(frame):
        raise ValueError(f"frame must be a DataFrame of pandas or Polars, got {type(frame).__name__}")
    series = (
        [frame.iloc[:, i] for i in range(len(frame.columns))]
        if hasattr(frame, "iloc")
        else frame.get_columns()
    )
    names = [_name(each) for each in frame.columns]
    # The columns of an array that became a frame are only numbered.
    nameless = list(frame.columns) == list(range(len(series)))
    index = getattr(frame, "index", None)
    if index is not None and _is_time(index):
        series, nameless = [index, *series], False
        names = [_name(index.name) if index.name is not None else "index", *names]
    if not series or not len(series[0]):
        raise ValueError("frame has no rows" if series else "frame has no columns")
    titles = [
        f"{split_unit(name)[0]} [s]" if _is_stamped(each) else name
        for name, each in zip(names, series, strict=True)
    ]
    if series[0] is index:
        # Whatever its name is: the index is the time.
        titles[0] = "time [s]" if _is_stamped(index) else names[0]
    length = len(series[0])

    def read(positions: Sequence[int], rows: int) -> Iterator[Rows]:
        columns = [_values(series[i], names[i]) for i in positions]
        for start in range(0, length, rows):
            stop = min(start + rows, length)
            yield Rows(np.arange(start + 1, stop + 1), [each[start:stop] for each in columns], stop)

    return Source(
        FRAME, [] if nameless else names, [] if nameless else titles, len(series), read,
        lambda positions: length, whole="it is in memory already",
    )  # fmt: skip


def _name(name: Any) -> str:
    return "/".join(map(str, name)) if isinstance(name, tuple) else str(name)


def _is_time(index: Any) -> bool:
    """Whether an index of pandas is a column of time: by what it holds, or by its name."""
    if _is_stamped(index):
        return True
    numeric = getattr(index.dtype, "kind", "O") in "fiu"
    return numeric and index.name is not None and split_unit(_name(index.name))[0].lower() in NAMES["time"]


def _is_stamped(values: Any) -> bool:
    """Whether times of day or durations, with or without a time zone."""
    return str(values.dtype).lower().startswith(("datetime", "timestamp", "timedelta", "duration"))


def _values(values: Any, name: str) -> FloatArray:
    try:
        if _is_stamped(values):
            return _seconds(values)
        # A missing value of pandas' own types is no number for NumPy.
        if hasattr(values, "iloc"):
            return column(values.to_numpy(dtype=np.float64, na_value=np.nan))
        return column(values.to_numpy())
    except (TypeError, ValueError) as error:
        raise ValueError(f"frame: column {shown(name)!r} holds no numbers: {shown(str(error))}") from None


def _seconds(values: Any) -> FloatArray:
    """Seconds since the first time of day, or of durations as they are."""
    if hasattr(values, "dt") and hasattr(values, "iloc") and getattr(values.dt, "tz", None) is not None:
        values = values.dt.tz_convert(None)
    elif getattr(values, "tz", None) is not None:
        values = values.tz_convert(None)
    ticks = np.asarray(values.to_numpy())
    if ticks.dtype.kind == "m":
        nanoseconds = ticks.astype("timedelta64[ns]")
        return np.where(np.isnat(nanoseconds), np.nan, nanoseconds.astype(np.int64) / 1e9)
    return seconds(ticks.astype("datetime64[ns]"), {}, 0)
