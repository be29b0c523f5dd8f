"""A recorded log of any format and any length, block by block."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from piezoest._checks import WILDEST, FloatArray, integer, positive
from piezoest.records.columns import BASE_UNITS, Column, choose, has_column
from piezoest.records.opening import open_source
from piezoest.records.source import ROWS, Rows, Source
from piezoest.records.timing import Timing, placed, scan

FEWEST_ROWS = 10

# Called with how much is done, and of how much.
Progress = Callable[[int, int], object]


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

    Made by `stream_record`. The blocks together contain exactly the same numbers as the
    `Record` that `read_record` makes of the file.

    Parameters
    ----------
    path : str, Path or Source
        As for `read_record`, or what is open already.
    columns, units : mapping of str to str, optional
        As for `read_record`.
    sample_rate : float, optional
        [Hz], as for `read_record`.
    rows : int
        Rows of the file that are read at a time, at least 1; a block has at most about as many samples.
    progress : callable, optional
        As for `stream_record`.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        As `read_record`.
    """

    __slots__ = ("_chosen", "_rows", "_source", "_timing", "notes", "sample_rate")

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
        progress: Progress | None = None,
    ) -> None:
        named, stated = dict(columns or {}), dict(units or {})
        self._rows = integer("rows", rows, 1)
        self._source = source = path if isinstance(path, Source) else open_source(Path(path))
        notes = []
        if sample_rate is None and "time" not in named and _states_its_rate(source):
            sample_rate = source.sample_rate
            notes.append(f"sample rate of {sample_rate:g} Hz as the file states it")
        timed = ("time",) if sample_rate is None else ()
        self._chosen = choose(source, (*timed, "voltage", "displacement"), named, stated)
        source.check([column.position for column in self._chosen.values()])
        self._timing = None
        if sample_rate is None:
            self._timing = _scan(source, self._chosen["time"], progress)
            self.sample_rate = self._timing.sample_rate
        else:
            self.sample_rate = positive("sample_rate", sample_rate)
        self.notes = (*notes, *_notes(source, self._chosen), *(self._timing.notes if self._timing else ()))

    def __repr__(self) -> str:
        return f"RecordStream({str(self.path)!r}, {self.sample_rate:g} Hz)"

    @property
    def path(self) -> Path:
        """The file."""
        return self._source.path

    @property
    def whole(self) -> str:
        """Why the file is held in memory as a whole while it is read; empty if it is not."""
        return self._source.whole

    def count(self) -> int:
        """Return the number of samples; of text without a column of time, its lines are counted."""
        if self._timing is not None:
            return self._timing.samples
        return self._source.count([column.position for column in self._chosen.values()])

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
        first = usable = 0
        for voltage, displacement in self._samples(progress):
            voltage, displacement = sane(voltage), sane(displacement)
            time = (
                np.arange(first, first + voltage.size) / self.sample_rate
                if self._timing is None
                else self._timing.times(first, voltage.size)
            )
            first += voltage.size
            usable += int(np.sum(np.isfinite(voltage) & np.isfinite(displacement)))
            yield Block(time, voltage, displacement)
        if usable < FEWEST_ROWS:
            raise ValueError(f"{self.path}: only {usable} usable rows, at least {FEWEST_ROWS} are needed")

    def _samples(self, progress: Progress | None) -> Iterator[list[FloatArray]]:
        columns = list(self._chosen.values())
        blocks = _converted(self._source, columns, self._rows, progress)
        if self._timing is None:
            yield from (values for _, values in blocks)
        else:
            yield from placed(self._timing, ((values[0], values[1:]) for _, values in blocks))


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

    leaves the estimator in exactly the same state as one run over the whole record.

    Parameters
    ----------
    path : str or Path
        As for `read_record`. Text, LabVIEW text, TDMS, HDF5, MATLAB 7.3, Parquet and ``.npy`` are read in
        parts; spreadsheets, ``.npz`` and older ``.mat`` files are refused.
    columns, units : mapping of str to str, optional
        As for `read_record`.
    sample_rate : float, optional
        [Hz], as for `read_record`. Without it the column of time is read twice before the first block.
    rows : int
        Rows of the file that are read at a time, at least 1.
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

    Examples
    --------
    >>> import piezoest as pz
    >>> log = pz.stream_record(pz.records.example_log())
    >>> sum(block.voltage.size for block in log)
    14155
    """
    stream = RecordStream(
        path, columns=columns, units=units, sample_rate=sample_rate, rows=rows, progress=progress
    )
    if stream.whole:
        raise ValueError(
            f"{path}: cannot be streamed: {stream.whole}; or use read_record, if it fits in memory"
        )
    return stream


def _states_its_rate(source: Source) -> bool:
    if source.sample_rate is None:
        return False
    return not has_column(source, "time") if source.titles else source.width == 2


def _scan(source: Source, column: Column, progress: Progress | None) -> Timing:
    passes = itertools.count()

    def times() -> Iterator[tuple[object, FloatArray]]:
        before = next(passes)

        def both(done: int, total: int) -> None:
            if progress is not None:
                progress(before * total + done, 2 * total)

        return ((rows.numbers, values[0]) for rows, values in _converted(source, [column], ROWS, both))

    return scan(str(source.path), source.place, times)


def _converted(
    source: Source, columns: list[Column], rows: int, progress: Progress | None
) -> Iterator[tuple[Rows, list[FloatArray]]]:
    """Blocks of columns in s, V and µm."""
    positions = [column.position for column in columns]
    total = source.size or source.count(positions)
    for block in source.read(positions, rows):
        yield block, [column.factor * values for column, values in zip(columns, block.values, strict=True)]
        if progress is not None and block.done < total:
            progress(block.done, total)
    if progress is not None:
        progress(total, total)


def _notes(source: Source, chosen: dict[str, Column]) -> list[str]:
    said = [column.note for column in chosen.values() if column.note]
    if not source.titles:
        names = ", ".join(f"{quantity} = {column.title}" for quantity, column in chosen.items())
        units = ", ".join(BASE_UNITS[quantity] for quantity in chosen)
        said.insert(0, f"columns without names: taken as {names}, in {units}")
    return said


def sane(values: FloatArray) -> FloatArray:
    """Values with NaN for what no stage can have."""
    return np.where(np.abs(values) < WILDEST, values, np.nan)
