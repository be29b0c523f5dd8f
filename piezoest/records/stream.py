"""A recorded log of any format and any length, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from piezoest._checks import WILDEST, FloatArray, integer
from piezoest.records.log import FEWEST_ROWS, Log, Progress
from piezoest.records.opening import open_source
from piezoest.records.source import ROWS, Source


class Block(NamedTuple):
    """Consecutive samples of a log.

    Parameters
    ----------
    time : ndarray, shape (n,)
        [s].
    voltage, displacement : ndarray, shape (n,)
        [V], [µm]; NaN where a sample is missing.
    """

    time: FloatArray
    voltage: FloatArray
    displacement: FloatArray


class RecordStream:
    """A recorded log that is read in blocks, as often as it is iterated over.

    Made by `stream_record`. The blocks together hold the same numbers, to the last bit, as the
    `Record` that `read_record` makes of the file.

    Parameters
    ----------
    path : str, Path or Source
        As for `read_record`, or what is open already.
    columns, units, sample_rate, rows, progress
        As for `stream_record`.
    held : bool
        Whether the columns are read once, and held in memory.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        As `read_record`.
    """

    __slots__ = ("_log", "_rows", "notes", "sample_rate")

    #: [Hz].
    sample_rate: float
    #: What had to be assumed or converted to read the log, in plain sentences.
    notes: tuple[str, ...]

    def __init__(
        self,
        path: str | Path | Source,
        *,
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        sample_rate: float | None = None,
        rows: int = ROWS,
        held: bool = False,
        progress: Progress | None = None,
    ) -> None:
        self._rows = integer("rows", rows, 1)
        source = path if isinstance(path, Source) else open_source(Path(path))
        self._log = Log(
            source, ("voltage", "displacement"), columns, units, sample_rate, held=held, progress=progress
        )
        self.sample_rate, self.notes = self._log.sample_rate, self._log.notes

    def __repr__(self) -> str:
        return f"RecordStream({str(self.path)!r}, {self.sample_rate:g} Hz)"

    @property
    def path(self) -> Path:
        """The file."""
        return self._log.source.path

    @property
    def whole(self) -> str:
        """Why the file is held in memory as a whole while it is read; empty if it is not."""
        return self._log.source.whole

    def count(self) -> int:
        """Return the number of samples; of text without a column of time, its lines are counted."""
        return self._log.count()

    def __iter__(self) -> Iterator[Block]:
        """Yield the log in blocks, from its start."""
        return self.blocks()

    def blocks(self, progress: Progress | None = None) -> Iterator[Block]:
        """Yield the log in blocks, from its start, and say how far it is read.

        Parameters
        ----------
        progress : callable, optional
            ``progress(done, total)`` is called after each block, in bytes of a text file, in rows of any
            other; at the end `done` is `total`.

        Yields
        ------
        Block
            Time [s], voltage [V] and displacement [µm], shape (n,).

        Raises
        ------
        ValueError
            If there is text in numbers, or there are too few rows.

        Examples
        --------
        >>> log = pz.stream_record(pz.records.example_log())
        >>> for block in log.blocks(progress=lambda done, total: print(f"{done / total:.0%}")):
        ...     pass
        100%
        """
        usable = 0
        for time, voltage, displacement in self._log.samples(self._rows, progress):
            block = Block(time, sane(voltage), sane(displacement))
            usable += int(np.sum(np.isfinite(block.voltage) & np.isfinite(block.displacement)))
            yield block
        if usable < FEWEST_ROWS:
            raise ValueError(f"{self.path}: only {usable} usable rows, at least {FEWEST_ROWS} are needed")


def stream_record(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    sample_rate: float | None = None,
    rows: int = ROWS,
    progress: Progress | None = None,
) -> RecordStream:
    """Open a log that may be larger than memory, to be read in blocks.

    For the recursive estimators, whose ``run`` continues where it stopped::

        log = pz.stream_record("log.parquet")
        estimator = pz.HysteresisRLS(log.sample_rate)
        for block in log:
            estimator.run(block.voltage, block.displacement, every=block.voltage.size)

    leaves the estimator in the same state, to the last bit, as one run over the whole record.

    Parameters
    ----------
    path : str or Path
        As for `read_record`. Text, LabVIEW text, TDMS, HDF5, MATLAB 7.3, Parquet and ``.npy`` are read in
        parts; spreadsheets, ``.npz`` and older ``.mat`` files are refused.
    columns, units : mapping of str to str, optional
        As for `read_record`.
    sample_rate : float, optional
        [Hz], as for `read_record`. Without it the column of time is read before the first block, twice where
        it is uneven.
    rows : int
        Rows of the file that are read at a time, at least 1; a block has at most about as many samples.
    progress : callable, optional
        ``progress(done, total)`` is called while the column of time is read, as by `RecordStream.blocks`
        while the blocks are.

    Returns
    -------
    RecordStream
        Yields blocks of time [s], voltage [V] and displacement [µm], shape (n,).

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        As `read_record`; also if the format cannot be read in parts.
    """
    stream = RecordStream(
        path, columns=columns, units=units, sample_rate=sample_rate, rows=rows, progress=progress
    )
    if stream.whole:
        raise ValueError(
            f"{path}: cannot be streamed: {stream.whole}; or use read_record, if it fits in memory"
        )
    return stream


def sane(values: FloatArray) -> FloatArray:
    """Values with NaN for what no stage can have."""
    return np.where(np.abs(values) < WILDEST, values, np.nan)
