"""Columns of NumPy, Parquet and older MATLAB files."""

from __future__ import annotations

import contextlib
import os
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest._checks import FloatArray
from piezoest.records.source import Rows, Source, check_size, shown

EXTRA = "formats"
COMPRESSED = 15  # mark of a compressed variable in a MATLAB file
# Names under which a file may state its sample rate [Hz], in lower case.
RATES = ("fs", "f_s", "sample_rate", "samplerate", "sampling_rate", "sample_rate_hz")


@contextlib.contextmanager
def damaged(path: Path, format_: str) -> Iterator[None]:
    """Turn whatever a library raises about a damaged file into one sentence."""
    try:
        yield
    except Exception as error:
        # None of them keeps to exceptions of its own: IndexError, TypeError and MemoryError happen too.
        reason = shown(str(error), 200)
        raise ValueError(f"{path}: cannot be read as {format_}, it may be truncated: {reason}") from None


def column(values: Any) -> FloatArray:
    """Values as float64, with NaN for infinity."""
    numbers = np.array(values, dtype=np.float64)
    numbers[~np.isfinite(numbers)] = np.nan
    return numbers


def stated_rate(value: Any) -> float | None:
    """Sample rate that a file states [Hz]; None if it is not one number above zero."""
    try:
        number = float(np.asarray(value).reshape(()))
    except (TypeError, ValueError, OverflowError):
        return None
    return number if 0.0 < number < np.inf else None


def row_numbers(start: int, count: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Numbers of rows, the first of a file being 1."""
    return np.arange(start + 1, start + count + 1, dtype=np.int64)


def with_units(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Names with the units that the file states beside them."""
    return [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]


class Table:
    """Columns in arrays, or in what is sliced like arrays, of files that name them.

    Parameters
    ----------
    path : Path
        For messages.
    separator : str
        What stands between a name and the folder or structure that it is in; empty if there are none.
    """

    def __init__(self, path: Path, separator: str = "") -> None:
        self.path = path
        self.separator = separator
        self.names: list[str] = []
        self.units: list[str] = []
        self.columns: list[tuple[Any, int | None, int, int]] = []  # array, place, axis of rows, length
        self.sample_rate: float | None = None

    def add(self, name: str, array: Any, unit: str = "") -> None:
        """Take an array: a vector as one column, a matrix as several, a number called fs as the rate."""
        shape = array.shape
        size = int(np.prod(shape))
        if size == 1 and self._leaf(name).lower() in RATES:
            self.sample_rate = stated_rate(array[()])
        elif len(shape) == 1 and size > 1:
            self._append(name, unit, array, None, 0)
        elif len(shape) == 2 and size > 1:
            rows = int(shape[1] > shape[0])
            for place in range(shape[1 - rows]):
                named = name if 1 in shape else f"{name}:{place + 1}"
                self._append(named, unit, array, place, rows)

    def _leaf(self, name: str) -> str:
        return name.rsplit(self.separator, 1)[-1] if self.separator else name

    def _append(self, name: str, unit: str, array: Any, place: int | None, rows: int) -> None:
        self.names.append(name)
        self.units.append(unit)
        self.columns.append((array, place, rows, int(array.shape[rows])))

    def source(self, whole: str = "") -> Source:
        """Return the source; ValueError if there is no column."""
        if not self.names:
            raise ValueError(
                f"{self.path}: no arrays of numbers with samples in it; MATLAB's tables, timetables and "
                "timeseries cannot be read: save their columns as arrays"
            )
        # One matrix and nothing else: its columns have no names.
        alone = len(self.names) > 1 and all(name.endswith(f":{i}") for i, name in enumerate(self.names, 1))
        names = [] if alone else self.names
        leaves = [self._leaf(name) for name in names]
        titles = leaves if len(set(leaves)) == len(leaves) else names
        return Source(
            self.path, names, with_units(titles, self.units if titles else ()), len(self.names), self.read,
            self._count, whole=whole, sample_rate=self.sample_rate, check=self._check,
        )  # fmt: skip

    def _count(self, positions: Sequence[int]) -> int:
        return self.columns[positions[0]][3]

    def _check(self, positions: Sequence[int]) -> None:
        lengths = {self.names[i]: self.columns[i][3] for i in positions}
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{name} has {length}" for name, length in lengths.items())
            raise ValueError(f"{self.path}: the columns differ in length: {said}")

    def read(self, positions: Sequence[int], rows: int) -> Iterator[Rows]:
        """Yield blocks of at most so many rows."""
        length = self.columns[positions[0]][3]
        for start in range(0, length, rows):
            part = slice(start, min(start + rows, length))
            values = []
            for position in positions:
                array, place, axis, _ = self.columns[position]
                if place is None:
                    values.append(column(array[part]))
                else:
                    values.append(column(array[part, place] if axis == 0 else array[place, part]))
            yield Rows(row_numbers(start, values[0].size), values, part.stop)


# ---------------------------------------------------------------- NumPy


def open_npy(path: Path) -> Source:
    """Open an array of shape (N, k) or (k, N), or one with named fields; it stays on disk."""
    with damaged(path, "NumPy"):
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    table = Table(path)
    _add_array(table, "array", array)
    return table.source()


def open_npz(path: Path) -> Source:
    """Open an archive of arrays, which is read as a whole."""
    with damaged(path, "NumPy"), zipfile.ZipFile(path) as packed:
        parts = packed.infolist()
    if any(not part.filename.endswith(".npy") for part in parts):
        raise ValueError(
            f"{path}: this is no NumPy file but another archive, such as a spreadsheet: save the log as CSV"
        )
    check_size(path, sum(part.file_size for part in parts))
    # NumPy leaves a file that it opened open where the archive is damaged.
    with damaged(path, "NumPy"), path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    table = Table(path)
    for name, array in arrays.items():
        _add_array(table, name, array)
    return table.source("an archive is read as a whole: save the columns as one .npy array")


def _add_array(table: Table, name: str, array: Any) -> None:
    if array.dtype.names:
        for field in array.dtype.names:
            if array[field].dtype.kind in "fiu":
                table.add(field, array[field])
    elif array.dtype.kind in "fiu":
        table.add(name, array)


# ---------------------------------------------------------------- MATLAB before version 7.3


def open_mat(path: Path) -> Source:
    """Open a MATLAB file of version 4 to 7.2, which is read as a whole; structures have dotted names."""
    from scipy.io import loadmat

    check_size(path, _unpacked(path))
    with damaged(path, "a MATLAB file"):
        variables = loadmat(path)
    table = Table(path, ".")
    for name, value in _flat({name: value for name, value in variables.items() if not name.startswith("__")}):
        table.add(name, value)
    return table.source("MATLAB files before version 7.3 are read as a whole: save with '-v7.3'")


def _unpacked(path: Path) -> int:
    """Bytes that the compressed variables of a version 5 file declare."""
    size = 0
    with path.open("rb") as file:
        start = file.read(128)
        order = ">" if start[126:128] == b"MI" else "<"
        while start.startswith(b"MATLAB 5.0") and len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}2I", tag)
            if kind == COMPRESSED:
                try:
                    inner = zlib.decompressobj().decompress(file.read(min(length, 512)), 8)
                except zlib.error:
                    break  # the reader says so
                size += struct.unpack(f"{order}2I", inner)[1] if len(inner) == 8 else 0
                length -= min(length, 512)
            file.seek(length, os.SEEK_CUR)
    return size


def _flat(variables: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in variables.items():
        array = np.asarray(value)
        if array.dtype.names and array.size == 1:
            fields = {field: array[field].flat[0] for field in array.dtype.names}
            yield from _flat(fields, f"{above}{name}.")
        elif array.dtype.kind in "fiu":
            yield above + name, array


# ---------------------------------------------------------------- Parquet


def open_parquet(path: Path) -> Source:
    """Open a Parquet file; columns of times of day become seconds since the first."""
    parquet = _extras.load("pyarrow.parquet", EXTRA, "reading Parquet")
    import pyarrow

    with damaged(path, "Parquet"):
        contents = parquet.read_metadata(path)
        schema = contents.schema.to_arrow_schema()
    check_size(path, contents.num_rows * np.dtype(float).itemsize)
    fields = [field for field in schema if _is_numeric(pyarrow.types, field.type)]
    if not fields:
        raise ValueError(f"{path}: no columns of numbers in it; there are {', '.join(schema.names)}")
    names = [field.name for field in fields]
    units = [_unit_of(pyarrow.types, field) for field in fields]

    def read(positions: Sequence[int], rows: int) -> Iterator[Rows]:
        start = 0
        origins: dict[int, int] = {}
        # Without the buffer a whole group of rows, which may be the whole file, would be held.
        with parquet.ParquetFile(path, buffer_size=1 << 16, pre_buffer=False) as file:
            try:
                for batch in file.iter_batches(rows, columns=[names[i] for i in positions]):
                    values = [_parquet_column(pyarrow, batch.column(names[i]), i, origins) for i in positions]
                    start += batch.num_rows
                    yield Rows(row_numbers(start - batch.num_rows, batch.num_rows), values, start)
            except (pyarrow.ArrowException, OSError, ValueError) as error:
                raise ValueError(f"{path}: damaged behind row {start}: {shown(str(error), 200)}") from None

    return Source(
        path, names, with_units(names, units), len(names), read, lambda positions: int(contents.num_rows),
        sample_rate=_rate(schema.metadata),
    )  # fmt: skip


def _is_numeric(types: Any, kind: Any) -> bool:
    return any(
        test(kind) for test in (types.is_integer, types.is_floating, types.is_timestamp, types.is_duration)
    )


def _unit_of(types: Any, field: Any) -> str:
    if types.is_timestamp(field.type) or types.is_duration(field.type):
        return str(field.type.unit)
    stated = {key.lower(): value for key, value in (field.metadata or {}).items()}
    return next((stated[key].decode(errors="replace") for key in (b"unit", b"units") if key in stated), "")


def _parquet_column(pyarrow: Any, values: Any, position: int, origins: dict[int, int]) -> FloatArray:
    if pyarrow.types.is_timestamp(values.type) or pyarrow.types.is_duration(values.type):
        # Nanoseconds since 1970 are too many for a float: their differences are not.
        ticks = values.cast(pyarrow.int64())
        if position not in origins and ticks.null_count < len(ticks):
            origins[position] = next(tick.as_py() for tick in ticks if tick.is_valid)
        values = pyarrow.compute.subtract(ticks, origins.get(position, 0))
    return column(values.to_numpy(zero_copy_only=False))


def _rate(metadata: Mapping[bytes, bytes] | None) -> float | None:
    items: Iterable[tuple[bytes, bytes]] = (metadata or {}).items()
    for key, value in items:
        if key.decode(errors="replace").lower() in RATES:
            return stated_rate(value)
    return None
