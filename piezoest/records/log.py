"""Columns of a source by what they hold, in s, V and µm, and where their samples lie in time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, positive
from piezoest.records.columns import BASE_UNITS, Column, choose, has_column
from piezoest.records.source import ROWS, Rows, Source
from piezoest.records.timing import Timing, placed, scan

FEWEST_ROWS = 10

# Called with how much is done, and of how much.
Progress = Callable[[int, int], object]


class Log:
    """Columns of a source, chosen and with their timing.

    Parameters
    ----------
    source : Source
        A file, or a table in memory.
    wanted : tuple of str
        Quantities beside time.
    columns, units, sample_rate
        As for `read_record`.
    held : bool
        Whether the columns are read once, and held in memory.
    progress : callable, optional
        Called while the column of time is read.
    """

    def __init__(
        self,
        source: Source,
        wanted: tuple[str, ...],
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        sample_rate: float | None = None,
        *,
        held: bool = False,
        progress: Progress | None = None,
    ) -> None:
        named = dict(columns or {})
        notes = []
        if sample_rate is None and "time" not in named and _states_its_rate(source):
            sample_rate = source.sample_rate
            notes.append(f"sample rate of {sample_rate:g} Hz as the file states it")
        timed = ("time",) if sample_rate is None else ()
        self.source = source
        self.chosen = choose(source, (*timed, *wanted), named, dict(units or {}))
        self.positions = [column.position for column in self.chosen.values()]
        source.check(self.positions)
        self._held: list[Rows] | None = None
        if held:
            self._held = list(source.read(self.positions, ROWS))
        self.timing: Timing | None = None
        if sample_rate is None:
            self.timing = scan(str(source.path), source.place, lambda: self._times(progress))
        self.sample_rate = (
            self.timing.sample_rate if self.timing is not None else positive("sample_rate", sample_rate)
        )
        self.notes = (*notes, *_notes(source, self.chosen), *(self.timing.notes if self.timing else ()))

    def _times(self, progress: Progress | None) -> Iterator[tuple[Any, FloatArray]]:
        for block in self.read(("time",), ROWS, progress):
            yield block.numbers, block.values[0]

    def read(
        self, quantities: tuple[str, ...] | None = None, rows: int = ROWS, progress: Progress | None = None
    ) -> Iterator[Rows]:
        """Yield blocks of the file's rows, by default of all columns that were chosen, in s, V and µm."""
        columns = [self.chosen[quantity] for quantity in quantities or self.chosen]
        positions = [column.position for column in columns]
        if self._held is None:
            blocks = self.source.read(positions, rows)
        else:
            places = [self.positions.index(position) for position in positions]
            blocks = (each._replace(values=[each.values[k] for k in places]) for each in self._held)
        total = self.source.size or (self.source.count(positions) if progress is not None else 0)
        for block in blocks:
            values = [column.factor * each for column, each in zip(columns, block.values, strict=True)]
            yield block._replace(values=values)
            if progress is not None and block.done < total:
                progress(block.done, total)
        if progress is not None:
            progress(total, total)

    def samples(self, rows: int = ROWS, progress: Progress | None = None) -> Iterator[list[FloatArray]]:
        """Yield blocks of time and the wanted columns, evenly sampled, NaN where a row is missing."""
        blocks = (block.values for block in self.read(None, rows, progress))
        first = 0
        for values in blocks if self.timing is None else placed(self.timing, blocks):
            count = values[0].size
            even = np.arange(first, first + count) / self.sample_rate
            yield [even if self.timing is None else self.timing.times(first, count), *values]
            first += count

    def count(self) -> int:
        """Return the number of samples; of text without a column of time, its lines are counted."""
        return self.source.count(self.positions) if self.timing is None else self.timing.samples


def _states_its_rate(source: Source) -> bool:
    if source.sample_rate is None:
        return False
    return not has_column(source, "time") if source.titles else source.width == 2


def _notes(source: Source, chosen: dict[str, Column]) -> list[str]:
    said = [column.note for column in chosen.values() if column.note]
    if not source.titles:
        names = ", ".join(f"{quantity} = {column.title}" for quantity, column in chosen.items())
        units = ", ".join(BASE_UNITS[quantity] for quantity in chosen)
        said.insert(0, f"columns without names: taken as {names}, in {units}")
    return said
