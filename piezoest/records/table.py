"""Columns of a file that holds arrays by name, whichever library opens it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from piezoest.records.beside import units_beside
from piezoest.records.rates import rate_among
from piezoest.records.source import (
    LogError,
    Rows,
    Source,
    check_size,
    damaged,
    finite,
    floats,
)  # fmt: skip
from piezoest.records.titles import titled

# Name, array and unit.
Named = tuple[str, Any, str]


class Table(Source):
    """Columns of a file that is opened once for their names, and again for their numbers.

    `opened`: returns a context manager of what `arrays` takes. `arrays`: yields name, array and unit: a
    vector is one column, a matrix several, a number called fs the sample rate. `texts`: names and texts that
    stand beside the arrays. `separator`: what stands between a name and the folder or structure that it is
    in; empty if there are none. `whole`: as for `Source`.
    """

    def __init__(
        self,
        path: Path,
        format_: str,
        opened: Callable[[], AbstractContextManager[Any]],
        arrays: Callable[[Any], Iterable[Named]],
        *,
        texts: Callable[[Any], Iterable[tuple[str, str]]] = lambda file: (),
        separator: str = "",
        whole: str = "",
    ) -> None:
        self._format, self._opened, self._arrays = format_, opened, arrays

        def leaf(name: str) -> str:
            return name.rsplit(separator, 1)[-1] if separator else name

        with damaged(path, format_), opened() as file:
            found = list(arrays(file))
            self.sample_rate, self.no_rate = rate_among(_numbers_in(found, leaf))
            self.stated_units = units_beside(texts(file))
            said = [f"{name}: {text}" for name, text in texts(file)]
            columns = list(columns_of(found))
            names = [name for name, _, _ in columns]
            self._lengths = [shape_of(values)[0] for _, values, _ in columns]
        if not names:
            raise LogError(
                f"{path}: no arrays of numbers with samples in it; MATLAB's tables, timetables and "
                "timeseries cannot be read: save their columns as arrays"
            )
        check_size(path, 8 * max(self._lengths))
        leaves = [leaf(name) for name in names]
        titles = [titled(title, unit) for title, (_, _, unit) in zip(leaves, columns, strict=True)]
        # One matrix and nothing else: its columns have no names.
        alone = len(names) > 1 and not any(unit for _, _, unit in columns)
        alone = alone and all(name.endswith(f":{i}") for i, name in enumerate(names, 1))
        super().__init__(path, *(([], []) if alone else (names, titles)), len(names))
        self.note_factors(said)
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
            columns = list(columns_of(self._arrays(file)))
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


def _numbers_in(found: Iterable[Named], name_of: Callable[[str], str]) -> Iterator[Named]:
    """Arrays of one number each, by the last part of their names."""
    for name, values, unit in found:
        if np.prod(shape_of(values)) == 1:
            number = np.asarray(values[0:1] if shape_of(values) else values[()])
            yield name_of(name), number.reshape(()), unit


def shape_of(values: Any) -> tuple[int, ...]:
    """Shape of an array, or of what only has a length."""
    return tuple(values.shape) if hasattr(values, "shape") else (len(values),)


def columns_of(found: Iterable[Named]) -> Iterator[Named]:
    """Columns of arrays: a vector is one, a matrix has several, a number is none."""
    for name, values, unit in found:
        shape = shape_of(values)
        if np.prod(shape) <= 1:
            continue
        if len(shape) > 2 and sum(length > 1 for length in shape) < 3:
            # Simulink keeps a signal as 1×1×N.
            values = np.squeeze(values[...])
            shape = values.shape
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
