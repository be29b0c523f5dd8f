"""A recorded log of any format and any length, block by block."""

import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import WILDEST, FloatArray, instance, integer, positive
from piezoest.records.columns import Column, choose
from piezoest.records.first_rows import (
    FIRST_ROWS,
    check_first_column,
    contradicted,
    ignored,
    in_seconds,
    states_its_rate,
)
from piezoest.records.opening import open_source
from piezoest.records.source import ROWS, Rows, Source, counted
from piezoest.records.timing import Timing, placed, scan
from piezoest.records.titles import BASE_UNITS

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
    columns, units, sample_rate, rows, progress
        As for `stream_record`.
    wanted : tuple of str
        Quantities beside time.
    held : bool
        Whether the columns are read once, and held in memory.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        As `read_record`.
    """

    __slots__ = ("_chosen", "_held", "_positions", "_rows", "_said", "_source", "_timing", "sample_rate")

    #: [Hz].
    sample_rate: float

    def __init__(
        self,
        path: str | Path | Source,
        *,
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        sample_rate: float | None = None,
        rows: int = ROWS,
        progress: Progress | None = None,
        wanted: tuple[str, ...] = ("voltage", "displacement"),
        held: bool = False,
    ) -> None:
        named = {quantity: str(name) for quantity, name in _mapping("columns", columns).items()}
        units = _mapping("units", units)
        self._rows = integer("rows", rows, 1)
        if not isinstance(path, str | os.PathLike | Source):
            raise ValueError(
                f"path must be that of a file, got {type(path).__name__}: use Record.from_arrays, or "
                "Record.from_frame for a table"
            )
        self._source = source = path if isinstance(path, Source) else open_source(Path(path))
        notes = []
        if sample_rate is not None:
            sample_rate = positive("sample_rate", sample_rate)
        if sample_rate is None and "time" not in named and states_its_rate(source):
            sample_rate = source.sample_rate
            notes.append(f"sample rate of {sample_rate:g} Hz as the file states it")
        timed = ("time",) if sample_rate is None else ()
        self._chosen = choose(source, (*timed, *wanted), named, units)
        if not source.titles and not named:
            check_first_column(source, len(self._chosen), bool(timed))
        if sample_rate is not None and not notes:
            notes += contradicted(source, named, units, sample_rate)
        self._positions = [column.position for column in self._chosen.values()]
        source.check(self._positions)
        self._held = list(source.read(self._positions, ROWS)) if held else None
        if timed and (first := next(self._read("time", rows=FIRST_ROWS), None)):
            self._chosen["time"] = in_seconds(source, self._chosen["time"], units, first.values[0])
        self._timing: Timing | None = None
        if sample_rate is None:
            self._timing = scan(str(source.path), source.place, lambda: self._times(progress))
            sample_rate = self._timing.sample_rate
        self.sample_rate = positive("sample_rate", sample_rate)
        timing = self._timing.notes if self._timing else ()
        if self._timing is not None and source.sample_rate is not None:
            timing = (*timing, *ignored(source.sample_rate, self._timing.sample_rate))
        self._said = (*notes, *_notes(source, self._chosen), *timing)

    def __repr__(self) -> str:
        return f"RecordStream({str(self.path)!r}, {self.sample_rate:g} Hz)"

    @property
    def path(self) -> Path:
        """The file."""
        return self._source.path

    @property
    def notes(self) -> tuple[str, ...]:
        """What had to be assumed or converted to read the log, as far as it is read, in plain sentences."""
        return (*self._said, *self._source.notes)

    @property
    def whole(self) -> str:
        """Why the file is held in memory as a whole while it is read; empty if it is not."""
        return self._source.whole

    def count(self) -> int:
        """Return the number of samples; of text without a column of time, its lines are counted."""
        if self._timing is not None:
            return self._timing.samples
        if self._held is not None:
            return sum(block.numbers.size for block in self._held)
        return self._source.count(self._positions)

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
        >>> import piezoest as pz
        >>> log = pz.stream_record(pz.records.example_log())
        >>> for block in log.blocks(progress=lambda done, total: print(f"{done / total:.0%}")):
        ...     pass
        100%
        """
        known, usable = np.zeros(2, np.int64), 0
        for time, voltage, displacement in self._samples(progress):
            block = Block(time, sane(voltage), sane(displacement))
            finite = np.isfinite([block.voltage, block.displacement])
            known, usable = known + finite.sum(axis=1), usable + int(np.sum(finite.all(axis=0)))
            yield block
        if usable < FEWEST_ROWS:
            columns = zip(("voltage", "displacement"), known, strict=True)
            empty = [repr(self._chosen[quantity].title) for quantity, count in columns if not count]
            said = f"; no number in column {' and '.join(empty)}" if empty else ""
            raise ValueError(
                f"{self.path}: only {counted(usable, 'usable row')}, at least {FEWEST_ROWS} are needed{said}"
            )

    def _samples(self, progress: Progress | None = None) -> Iterator[list[FloatArray]]:
        """Yield blocks of time and the wanted columns, evenly sampled, NaN where a row is missing."""
        blocks = (block.values for block in self._read(rows=self._rows, progress=progress))
        first = 0
        for values in blocks if self._timing is None else placed(self._timing, blocks):
            count = values[0].size
            even = np.arange(first, first + count) / self.sample_rate
            yield [even if self._timing is None else self._timing.times(first, count), *values]
            first += count

    def _read(self, *quantities: str, rows: int = ROWS, progress: Progress | None = None) -> Iterator[Rows]:
        """Yield blocks of the file's rows, in s, V and µm."""
        columns = [self._chosen[quantity] for quantity in quantities or self._chosen]
        positions = [column.position for column in columns]
        places = [self._positions.index(position) for position in positions]
        total = self._source.size or self._source.count(positions)
        for block in self._source.read(positions, rows) if self._held is None else self._held:
            kept = block.values if self._held is None else [block.values[k] for k in places]
            values = [c.factor * each for c, each in zip(columns, kept, strict=True)]
            yield Rows(block.numbers, values, block.done)
            if progress is not None and block.done < total:
                progress(block.done, total)
        if progress is not None:
            progress(total, total)

    def _times(self, progress: Progress | None) -> Iterator[tuple[Any, FloatArray]]:
        return ((block.numbers, block.values[0]) for block in self._read("time", progress=progress))


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


def sane(values: FloatArray) -> FloatArray:
    """Values with NaN for what no stage can have."""
    return np.where(np.abs(values) < WILDEST, values, np.nan)


def _mapping(name: str, given: Any) -> dict[str, Any]:
    return dict(
        instance(name, {} if given is None else given, Mapping, f"a mapping: {name}={{'voltage': ...}}")
    )


def _notes(source: Source, chosen: dict[str, Column]) -> list[str]:
    said = [column.note for column in chosen.values() if column.note]
    if not source.titles:
        names = ", ".join(f"{quantity} = {column.title}" for quantity, column in chosen.items())
        units = ", ".join(BASE_UNITS[quantity] for quantity in chosen)
        said.insert(0, f"columns without names: taken as {names}, in {units}")
    return said


def title_of(log: RecordStream, quantity: str) -> str:
    """Title of the column that a quantity is read from."""
    return log._chosen[quantity].title


def without_gaps(log: RecordStream) -> FloatArray:
    """Return the one column of a log, evenly sampled; ValueError that names the line of a gap."""
    where, count = f"{log.path}, {log._source.place}", 0
    for block in log._read():
        count += block.numbers.size
        if not np.isfinite(block.values).all():
            bad = block.numbers[~np.isfinite(block.values).all(axis=0)][0]
            raise ValueError(
                f"{where} {bad}: no number in the time or the reference; a reference must have no gaps"
            )
    if count < FEWEST_ROWS:
        raise ValueError(f"{log.path}: only {counted(count, 'row')}, at least {FEWEST_ROWS} are needed")
    if log._timing is not None and log._timing.samples > count:
        raise ValueError(f"{where} {log._timing.jump}: time jumps here; a reference must have no gaps")
    return np.concatenate([values for _, values in log._samples()])
