"""NumPy, MATLAB, HDF5, TDMS and Parquet files: the arrays in them, by name."""

import contextlib
import importlib
import logging
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from piezoest import _extras
from piezoest.records.beside import NAMES, UNITS, stated, unit_of, with_names, words_of
from piezoest.records.columns import titled
from piezoest.records.source import (
    EXTRA,
    RATES,
    LogError,
    Rows,
    Source,
    check_size,
    damaged,
    finite,
    floats,
    shown,
    stated_rate,
)  # fmt: skip

# Name, array and unit.
Named = tuple[str, Any, str]


class Table(Source):
    """Columns of a file that is opened once for their names, and again for their numbers.

    `opened`: returns a context manager of what `arrays` takes. `arrays`: yields name, array and unit: a
    vector is one column, a matrix several, a number called fs the sample rate. `separator`: what stands
    between a name and the folder or structure that it is in; empty if there are none. `whole`: as for
    `Source`.
    """

    def __init__(
        self,
        path: Path,
        format_: str,
        opened: Callable[[], AbstractContextManager[Any]],
        arrays: Callable[[Any], Iterable[Named]],
        *,
        separator: str = "",
        whole: str = "",
    ) -> None:
        self._format, self._opened, self._arrays = format_, opened, arrays

        def leaf(name: str) -> str:
            return name.rsplit(separator, 1)[-1] if separator else name

        with damaged(path, format_), opened() as file:
            found = list(arrays(file))
            for name, values, unit in found:
                if leaf(name).lower() in RATES and np.prod(_shape(values)) == 1:
                    self.sample_rate = stated_rate(values[0:1] if _shape(values) else values[()], unit)
            columns = list(_columns(found))
            names = [name for name, _, _ in columns]
            self._lengths = [_shape(values)[0] for _, values, _ in columns]
        if not names:
            raise LogError(
                f"{path}: no arrays of numbers with samples in it; MATLAB's tables, timetables and "
                "timeseries cannot be read: save their columns as arrays"
            )
        check_size(path, 8 * max(self._lengths))
        leaves = [leaf(name) for name in names]
        titles = [titled(title, unit) for title, (_, _, unit) in zip(leaves, columns, strict=True)]
        # One matrix and nothing else: its columns have no names.
        alone = len(names) > 1 and all(name.endswith(f":{i}") for i, name in enumerate(names, 1))
        super().__init__(path, *(([], []) if alone else (names, titles)), len(names))
        self.whole = whole
        self._names = names

    def count(self, positions: Sequence[int]) -> int:
        return self._lengths[positions[0]]

    def check(self, positions: Sequence[int]) -> None:
        """Refuse columns of different lengths."""
        lengths = {self._names[i]: self._lengths[i] for i in positions}
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{name} has {length}" for name, length in lengths.items())
            raise LogError(f"{self.path}: the columns differ in length: {said}")

    def read(self, positions: Sequence[int], rows: int) -> Iterator[Rows]:
        length = self.count(positions)
        with damaged(self.path, self._format), self._opened() as file:
            columns = list(_columns(self._arrays(file)))
            arrays = [columns[i][1] for i in positions]
            for start in range(0, length, rows):
                stop = min(start + rows, length)
                yield Rows(
                    np.arange(start + 1, stop + 1), [_numbers(array, start, stop) for array in arrays], stop
                )


class _Part(NamedTuple):
    """One column of a matrix."""

    matrix: Any
    place: int
    axis: int  # of the rows

    @property
    def shape(self) -> tuple[int]:
        return (self.matrix.shape[self.axis],)

    def __getitem__(self, part: Any) -> Any:
        return self.matrix[part, self.place] if self.axis == 0 else self.matrix[self.place, part]


class _Packed(NamedTuple):
    """Numbers that a file holds as others, as netCDF does: number = factor stored + offset."""

    stored: Any
    factor: Any
    offset: Any

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self.stored.shape)

    def __getitem__(self, part: Any) -> Any:
        return self.stored[part] * self.factor + self.offset


def _shape(values: Any) -> tuple[int, ...]:
    return tuple(values.shape) if hasattr(values, "shape") else (len(values),)


def _columns(found: Iterable[Named]) -> Iterator[Named]:
    for name, values, unit in found:
        shape = _shape(values)
        if np.prod(shape) <= 1:
            continue
        if len(shape) == 1:
            yield name, values, unit
        elif len(shape) == 2:
            axis = int(shape[1] > shape[0])
            for place in range(shape[1 - axis]):
                yield name if 1 in shape else f"{name}:{place + 1}", _Part(values, place, axis), unit


def _numbers(array: Any, start: int, stop: int) -> Any:
    values = array[start:stop]
    if values.dtype.kind != "M":
        return finite(values)
    import pandas as pd

    return floats(pd.Series(values), pd.Timestamp(array[0:1][0]))


PACKING = (("scale_factor", 1.0), ("add_offset", 0.0))
ONE_FILE = "save all columns in one file, for no other is opened"
TDMS_UNITS = ("unit_string", "ni_unitdescription", "unit", "units")
INCREMENT = "wf_increment"  # time from one sample of a waveform to the next [s]

# ---------------------------------------------------------------- NumPy


def open_npy(path: Path) -> Table:
    """Open an array of shape (N, k) or (k, N), or one with named fields; it stays on disk."""
    with damaged(path, "NumPy"):
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    return _held(path, "NumPy", {"array": array})


def open_npz(path: Path) -> Table:
    """Open an archive of arrays, which is read as a whole."""
    with damaged(path, "NumPy"), zipfile.ZipFile(path) as packed:
        parts = packed.infolist()
    if any(not part.filename.endswith(".npy") for part in parts):
        raise LogError(f"{path}: this is an archive but none of NumPy: unpack it, or save the log as CSV")
    check_size(path, sum(part.file_size for part in parts))
    # NumPy leaves a file that it opened open where the archive is damaged.
    with damaged(path, "NumPy"), path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        arrays = dict(archive)
    return _held(path, "NumPy", arrays, "an archive is read as a whole: save the columns as one .npy array")


def _held(path: Path, format_: str, arrays: Mapping[str, Any], whole: str = "") -> Table:
    """Table of what is in memory already; structures have dotted names."""
    return Table(
        path, format_, contextlib.nullcontext, lambda _: _numeric(arrays), separator=".", whole=whole
    )


def _numeric(arrays: Mapping[str, Any], above: str = "") -> Iterator[Named]:
    arrays = with_names(arrays)
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.names:
            alone = array.size == 1 and array.dtype.hasobject  # as MATLAB's structures are
            fields = {field: array[field].flat[0] if alone else array[field] for field in array.dtype.names}
            yield from _numeric(fields, f"{above}{name}." if alone else "")
        elif array.dtype.kind in "fiu":
            unit = next(
                (each for end in ("_unit", "_units") for each in words_of(arrays.get(name + end))), ""
            )
            yield above + name, array, unit


# ---------------------------------------------------------------- MATLAB before version 7.3


def open_mat(path: Path) -> Table:
    """Open a MATLAB file of version 4 to 7.2, which is read as a whole; structures have dotted names."""
    from scipy.io import loadmat, whosmat

    with damaged(path, "a MATLAB file"):
        check_size(path, sum(8 * int(np.prod(shape, dtype=object)) for _, shape, _ in whosmat(path)))
        variables = {name: value for name, value in loadmat(path).items() if not name.startswith("__")}
    return _held(
        path, "MATLAB", variables, "MATLAB files before version 7.3 are read as a whole: save with '-v7.3'"
    )


# ---------------------------------------------------------------- HDF5, and MATLAB 7.3


def open_hdf5(path: Path) -> Table:
    """Open an HDF5 file: each array a column, or several, by its path; fields of compound types too."""
    h5py = _extras.load("h5py", EXTRA, "reading HDF5 and MATLAB 7.3")
    return Table(
        path, "HDF5", lambda: h5py.File(path, "r"), lambda file: _in_hdf5(h5py, path, file), separator="/"
    )


def _columns_of(name: str, values: Any, names: list[str], units: list[str]) -> list[Named]:
    """A dataset, or its columns where attributes have a name or a unit for each of them."""
    columns = [each for _, each, _ in _columns([(name, values, "")])]
    if len(columns) > 1 and len(columns) in (len(names), len(units)):
        names = names if len(names) == len(columns) else [f"{name}:{k}" for k in range(1, len(columns) + 1)]
        units = units if len(units) == len(columns) else [""] * len(columns)
        return list(zip(names, columns, units, strict=True))
    return [(name, values, units[0] if len(units) == 1 else "")]


def _in_hdf5(h5py: Any, path: Path, file: Any) -> list[Named]:
    found: list[Named] = [
        (name, np.asarray(value), unit_of(file.attrs, f"{name}_unit".lower(), f"{name}_units".lower()))
        for name, value in file.attrs.items()
        if name.lower() in RATES and np.size(value) == 1
    ]
    # A link is followed by nobody here, but a column that is not found for it would be a riddle.
    if outside := file.visititems_links(
        lambda name, link: name if isinstance(link, h5py.ExternalLink) else None
    ):
        raise LogError(f"{path}: {shown(outside)} lies in another file: {ONE_FILE}")

    def visit(name: str, item: Any) -> None:
        # MATLAB keeps what cells and objects refer to in these; its text is an array of numbers.
        # A group has no shape, and an array may have none either.
        if name.startswith(("#refs#", "#subsystem#")) or getattr(item, "shape", None) is None:
            return
        others = [entry[0] for entry in item.external or ()]
        if item.is_virtual:
            others = [source.file_name for source in item.virtual_sources() if source.file_name != "."]
        if others:
            raise LogError(f"{path}: {shown(name)} lies in another file, {shown(others[0])}: {ONE_FILE}")
        check_size(path, int(item.nbytes))
        if item.dtype.names:
            fields = [field for field in item.dtype.names if item.dtype[field].kind in "fiu"]
            found.extend((f"{name}/{field}", item.fields(field), "") for field in fields)
        elif item.dtype.kind in "fiu" and item.attrs.get("MATLAB_class") not in (b"char", "char"):
            factor, offset = (item.attrs.get(key, usual) for key, usual in PACKING)
            values = item if (factor, offset) == (1.0, 0.0) else _Packed(item, factor, offset)
            found.extend(_columns_of(name, values, stated(item.attrs, *NAMES), stated(item.attrs, *UNITS)))

    file.visititems(visit)
    return found


# ---------------------------------------------------------------- TDMS


class Tdms(Table):
    """A TDMS file: each channel a column, by ``group/channel``; waveforms state the sample rate."""

    def __init__(self, path: Path) -> None:
        nptdms = _extras.load("nptdms", EXTRA, "reading TDMS")
        super().__init__(path, "TDMS", lambda: _opened_tdms(nptdms, path), _in_tdms, separator="/")
        with damaged(path, "TDMS"), self._opened() as file:
            steps = {_step(channel) for group in file.groups() for channel in group.channels()} - {None}
        if len(steps) > 1:
            rates = " and ".join(f"{rate:.6g} Hz" for rate in sorted(1.0 / step for step in steps if step))
            self.no_rate = f"its channels have different sample rates, {rates}"


@contextlib.contextmanager
def _opened_tdms(nptdms: Any, path: Path) -> Iterator[Any]:
    """Open with a file of our own: the library leaves its own open where the contents are damaged."""
    # What it logs about damage is said by the error, or is no loss: a file whose end was not written.
    logs = importlib.import_module("nptdms.log").log_manager
    level = logs.log_level
    logs.set_level(logging.ERROR)
    try:
        with path.open("rb") as raw, nptdms.TdmsFile.open(raw) as file:
            yield file
    finally:
        logs.set_level(level)


def _in_tdms(file: Any) -> Iterator[Named]:
    rates: set[float | None] = set()
    for name, value in file.properties.items():
        if name.lower() in RATES:
            yield name, np.asarray(value), unit_of(file.properties, f"{name}_unit".lower())
    for group in file.groups():
        for channel in group.channels():
            if channel.dtype.kind not in "fiuM" or not len(channel):
                continue
            stamped = channel.dtype.kind == "M"
            unit = unit_of(channel.properties, *TDMS_UNITS)
            yield f"{group.name}/{channel.name}", channel, "s" if stamped else unit
            if not stamped:
                rates.add(_step(channel))
    if len(rates) == 1 and (increment := rates.pop()):
        yield "fs", np.asarray(1.0 / increment), ""


def _step(channel: Any) -> float | None:
    """Time from one sample of a channel to the next [s], if it is stated."""
    return stated_rate(channel.properties.get(INCREMENT))


class Parquet(Source):
    """A Parquet file; columns of times of day become seconds since the first."""

    def __init__(self, path: Path) -> None:
        self._parquet = _extras.load("pyarrow.parquet", EXTRA, "reading Parquet")
        types = _extras.load("pyarrow.types", EXTRA, "reading Parquet")
        with damaged(path, "Parquet"):
            contents = self._parquet.read_metadata(path)
            schema = contents.schema.to_arrow_schema()
        self._length = int(contents.num_rows)
        check_size(path, 8 * self._length)
        units: dict[str, str] = {}
        for field in schema:
            if types.is_timestamp(field.type) or types.is_duration(field.type):
                units[field.name] = "s"
            elif types.is_integer(field.type) or types.is_floating(field.type):
                units[field.name] = unit_of(_items(field), *UNITS)
        if not units:
            raise LogError(f"{path}: no columns of numbers in it; there are {', '.join(schema.names)}")
        known = _items(schema)
        for name in known.keys() & RATES:
            self.sample_rate = stated_rate(known[name], unit_of(known, f"{name}_unit"))
        super().__init__(path, list(units), [titled(*named) for named in units.items()], len(units))

    def count(self, positions: Sequence[int]) -> int:
        return self._length

    def read(self, positions: Sequence[int], rows: int) -> Iterator[Rows]:
        start, names = 0, [self.names[i] for i in positions]
        origins: dict[str, Any] = {}
        # Without the buffer a whole group of rows, which may be the whole file, would be held.
        with (
            damaged(self.path, "Parquet"),
            self._parquet.ParquetFile(self.path, buffer_size=1 << 16, pre_buffer=False) as file,
        ):
            for batch in file.iter_batches(rows, columns=names):
                columns = [batch.column(name).to_pandas() for name in names]
                for name, column in zip(names, columns, strict=True):
                    if column.dtype.kind == "M" and column.notna().any():
                        origins.setdefault(name, column.min())
                stop = start + batch.num_rows
                values = [
                    floats(column, origins.get(name)) for name, column in zip(names, columns, strict=True)
                ]
                yield Rows(np.arange(start + 1, stop + 1), values, stop)
                start = stop


def _items(described: Any) -> dict[str, bytes]:
    return {key.decode(errors="replace").lower(): value for key, value in (described.metadata or {}).items()}
