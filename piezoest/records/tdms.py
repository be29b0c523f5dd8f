"""Channels of TDMS files, as LabVIEW and FlexLogger write them."""

from __future__ import annotations

import contextlib
import importlib
import logging
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest.records.binary import EXTRA, RATES, Table, damaged, stated_rate
from piezoest.records.source import Rows, Source, check_size

UNITS = ("unit_string", "NI_UnitDescription", "unit", "units")
INCREMENT = "wf_increment"  # time from one sample of a waveform to the next [s]


def open_tdms(path: Path) -> Source:
    """Open a TDMS file: each channel a column, by ``group/channel``; waveforms state the sample rate."""
    nptdms = _extras.load("nptdms", EXTRA, "reading TDMS")
    # Only the names are wanted now; `read` opens the file for itself and closes it.
    with damaged(path, "TDMS"), _opened(nptdms, path) as file:
        table = _table(path, file)
    check_size(path, sum(8 * length for *_, length in table.columns))
    source = table.source()

    def read(positions: Sequence[int], rows: int) -> Iterator[Rows]:
        with _opened(nptdms, path) as file:
            blocks = _table(path, file).read(positions, rows)
            while True:
                with damaged(path, "TDMS"):
                    block = next(blocks, None)
                if block is None:
                    return
                yield block

    return Source(
        path, source.names, source.titles, source.width, read, source.count,
        sample_rate=source.sample_rate, check=source.check,
    )  # fmt: skip


@contextlib.contextmanager
def _opened(nptdms: Any, path: Path) -> Iterator[Any]:
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


def _table(path: Path, file: Any) -> Table:
    table = Table(path, "/")
    rates: set[float | None] = set()
    for group in file.groups():
        for channel in group.channels():
            if channel.dtype.kind not in "fiuM" or not len(channel):
                continue
            stamped = channel.dtype.kind == "M"
            unit = next((str(channel.properties[key]) for key in UNITS if channel.properties.get(key)), "")
            table.add(f"{group.name}/{channel.name}", _Channel(channel), "s" if stamped else unit)
            increment = stated_rate(channel.properties.get(INCREMENT))
            if not stamped:
                rates.add(None if increment is None else 1.0 / increment)
    stated = [value for name, value in file.properties.items() if name.lower() in RATES]
    if len(rates) == 1:
        table.sample_rate = rates.pop()
    if table.sample_rate is None and stated:
        table.sample_rate = stated_rate(stated[0])
    return table


class _Channel:
    """A channel, sliced as an array is; times of day as seconds since the first."""

    def __init__(self, channel: Any) -> None:
        self._channel = channel
        self.shape = (len(channel),)

    def __getitem__(self, part: Any) -> Any:
        if part == ():  # of a single number
            return self._channel[0]
        values = self._channel.read_data(part.start, part.stop - part.start)
        if values.dtype.kind == "M":
            return (values - self._channel[0]) / np.timedelta64(1, "s")
        return values
