"""NumPy, MATLAB before version 7.3 and TDMS files."""

import contextlib
import importlib
import logging
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest.records.beside import texts_of, unit_of, with_names, words_of
from piezoest.records.rates import stated_rate
from piezoest.records.source import EXTRA, LogError, check_size, damaged
from piezoest.records.table import Named, Table

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
        path, format_, contextlib.nullcontext, lambda _: _numeric(arrays), texts=lambda _: _texts(arrays),
        separator=".", whole=whole,
    )  # fmt: skip


def _texts(arrays: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    """Names and words of arrays of text, also in structures."""
    for name, value in arrays.items():
        if words := words_of(value):
            yield above + name, ", ".join(words)
        array = np.asarray(value)
        if array.dtype.names and array.size == 1:
            yield from _texts({field: array[field].flat[0] for field in array.dtype.names}, f"{above}{name}.")


def _numeric(arrays: Mapping[str, Any], above: str = "") -> Iterator[Named]:
    arrays = with_names(arrays)
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.names:
            alone = array.size == 1 and array.dtype.hasobject  # as MATLAB's structures are
            fields = {field: array[field].flat[0] if alone else array[field] for field in array.dtype.names}
            yield from _numeric(fields, f"{above}{name}." if alone else "")
        elif array.dtype.kind in "fiuM":
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


# ---------------------------------------------------------------- TDMS


class Tdms(Table):
    """A TDMS file: each channel a column, by ``group/channel``; waveforms state the sample rate."""

    def __init__(self, path: Path) -> None:
        nptdms = _extras.load("nptdms", EXTRA, "reading TDMS")
        super().__init__(
            path, "TDMS", lambda: _opened_tdms(nptdms, path), _in_tdms, texts=_properties, separator="/"
        )
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


def _properties(file: Any) -> Iterator[tuple[str, str]]:
    """All properties that are text."""
    for item in (file, *file.groups(), *(channel for group in file.groups() for channel in group.channels())):
        yield from texts_of(item.properties, f"{getattr(item, 'name', '')} ".lstrip())


def _in_tdms(file: Any) -> Iterator[Named]:
    rates: set[float | None] = set()
    for item in (file, *file.groups()):
        for name, value in item.properties.items():
            if np.ndim(value) == 0 and not isinstance(value, str):
                yield name, np.asarray(value), unit_of(item.properties, f"{name}_unit".lower())
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
