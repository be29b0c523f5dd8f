"""Parquet files."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest.records.beside import UNITS, texts_of, unit_of, units_beside
from piezoest.records.rates import rate_among
from piezoest.records.source import (
    EXTRA,
    LogError,
    Rows,
    Source,
    check_size,
    damaged,
    floats,
)  # fmt: skip
from piezoest.records.titles import titled


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
        of_fields = [each for field in schema for each in texts_of(_items(field), f"{field.name} ")]
        stated = [(name, value, unit_of(known, f"{name}_unit")) for name, value in known.items()]
        self.sample_rate, self.no_rate = rate_among([*stated, *((*each, "") for each in of_fields)])
        self.stated_units = units_beside([*texts_of(known), *of_fields])
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
