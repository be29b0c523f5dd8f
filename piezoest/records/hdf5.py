"""Columns of HDF5 files, among which are MATLAB's of version 7.3."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from piezoest import _extras
from piezoest.records.binary import EXTRA, RATES, Table, stated_rate
from piezoest.records.source import Rows, Source, check_size, shown

ONE_FILE = "save all columns in one file, for no other is opened"


def open_hdf5(path: Path) -> Source:
    """Open an HDF5 file: each array a column, or several, by its path; fields of compound types too."""
    h5py = _extras.load("h5py", EXTRA, "reading HDF5 and MATLAB 7.3")
    try:
        # Only the names are wanted now; `read` opens the file for itself and closes it.
        with h5py.File(path, "r") as file:
            table = _table(h5py, path, file)
            source = table.source()
    except (OSError, RuntimeError, KeyError) as error:
        raise ValueError(f"{path}: cannot be read as HDF5, it may be truncated: {error}") from None

    def read(positions: Sequence[int], rows: int) -> Iterator[Rows]:
        try:
            with h5py.File(path, "r") as file:
                yield from _table(h5py, path, file).read(positions, rows)
        except (OSError, RuntimeError) as error:
            raise ValueError(f"{path}: damaged: {error}") from None

    return Source(
        path, source.names, source.titles, source.width, read, source.count,
        sample_rate=source.sample_rate, check=source.check,
    )  # fmt: skip


def _table(h5py: Any, path: Path, file: Any) -> Table:
    table = Table(path, "/")
    for name, value in file.attrs.items():
        if name.lower() in RATES:
            table.sample_rate = stated_rate(value)
    # Links are not followed, but they are noted: otherwise nobody could see why a column is not found.
    if outside := file.visititems_links(
        lambda name, link: name if isinstance(link, h5py.ExternalLink) else None
    ):
        raise ValueError(f"{path}: {shown(outside)} lies in another file: {ONE_FILE}")

    def visit(name: str, item: Any) -> None:
        # MATLAB keeps what cells and objects refer to in these; its text is an array of numbers.
        # An array may also have no shape, and no values.
        # A group has none either.
        if name.startswith(("#refs#", "#subsystem#")) or getattr(item, "shape", None) is None:
            return
        _check_storage(path, name, item)
        if item.dtype.names:
            for field in item.dtype.names:
                if item.dtype[field].kind in "fiu":
                    table.add(f"{name}/{field}", _Field(item, field))
        elif item.dtype.kind in "fiu" and item.attrs.get("MATLAB_class") not in (b"char", "char"):
            unit = next((item.attrs[key] for key in ("unit", "units") if key in item.attrs), "")
            table.add(name, item, unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit))

    file.visititems(visit)
    return table


def _check_storage(path: Path, name: str, dataset: Any) -> None:
    """Refuse numbers that lie in other files, and more of them than this one can hold."""
    others = [entry[0] for entry in dataset.external or ()]
    if dataset.is_virtual:
        others = [source.file_name for source in dataset.virtual_sources() if source.file_name != "."]
    if others:
        raise ValueError(f"{path}: {shown(name)} lies in another file, {shown(others[0])}: {ONE_FILE}")
    check_size(path, int(dataset.nbytes))


class _Field:
    """A field of a compound dataset, sliced as an array is."""

    def __init__(self, dataset: Any, field: str) -> None:
        self._dataset, self._field = dataset, field
        self.shape = dataset.shape

    def __getitem__(self, part: Any) -> Any:
        return self._dataset.fields(self._field)[part]
