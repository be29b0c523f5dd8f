"""Tidy tables of runs: one row for each run, and one for each period of each run; Parquet or CSV.

Written row by row, so that a million runs need no more memory than one.
"""

from __future__ import annotations

import contextlib
import csv
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from piezoest._files import replacing
from piezoest.bench.runner import COLUMNS, Row

RUNS, PERIODS = "runs", "periods"
PERIOD_COLUMNS: dict[str, type] = {
    "key": str, "scenario": str, "stage": str, "estimator": str, "seed": int, "period": int, "error": float,
}  # fmt: skip
BATCH = 10_000  # rows that are written at a time
FORMATS = ("parquet", "csv")


def default_format() -> str:
    """Parquet where pyarrow is installed, CSV elsewhere."""
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        return "csv"
    return "parquet"


def checked_format(format: str | None) -> str:
    """Format that can be written here.

    Parameters
    ----------
    format : {"parquet", "csv"} or None
        Default Parquet where pyarrow is installed.

    Raises
    ------
    ValueError
        If the format is another, or pyarrow is not installed for Parquet.
    """
    format = default_format() if format is None else format
    if format not in FORMATS:
        raise ValueError(f"table format must be one of {', '.join(FORMATS)}, got {format!r}")
    if format == "parquet" and default_format() == "csv":
        raise ValueError("pyarrow is not installed: pip install 'piezoest[formats]', or take format csv")
    return format


def write_tables(rows: Iterable[Row], folder: Path, format: str | None = None) -> list[Path]:
    """Write `runs` and `periods`.

    Parameters
    ----------
    rows : iterable of dict
        From `piezoest.bench.runner.play`.
    folder : Path
        To write to.
    format : {"parquet", "csv"}, optional
        Default Parquet where pyarrow is installed.

    Returns
    -------
    list of Path
        The two files.

    Raises
    ------
    ValueError
        If the format is another, or pyarrow is not installed for Parquet.
    """
    format = checked_format(format)
    writer = _parquet if format == "parquet" else _csv
    paths = [folder / f"{name}.{format}" for name in (RUNS, PERIODS)]
    with writer(paths[0], COLUMNS) as write_run, writer(paths[1], PERIOD_COLUMNS) as write_period:
        for row in rows:
            write_run(row)
            shared = {name: row[name] for name in PERIOD_COLUMNS if name in row}
            for k, error in enumerate(row["errors"], 1):
                write_period({**shared, "period": k, "error": error})
    return paths


def write_table(rows: Iterable[Row], path: Path, columns: Mapping[str, type]) -> None:
    """Write rows of any columns as one table, Parquet or CSV by the name of the file.

    Parameters
    ----------
    rows : iterable of dict
        What they have beside the columns is left out.
    path : Path
        Ends in .parquet or .csv.
    columns : mapping of str to type
        Names in their order: str, int, float or bool.

    Raises
    ------
    ValueError
        If the name ends in something else, or pyarrow is not installed for Parquet.
    """
    writer = _parquet if checked_format(path.suffix[1:]) == "parquet" else _csv
    with writer(path, columns) as write:
        for row in rows:
            write({name: row.get(name) for name in columns})


def read_runs(folder: Path) -> list[Row]:
    """Rows of the table `runs`, without the errors of each period.

    Parameters
    ----------
    folder : Path
        What `write_tables` wrote to; of two formats the newer one is read.

    Raises
    ------
    ValueError
        If there is none, or it is damaged.
    """
    found = [path for format in FORMATS if (path := folder / f"{RUNS}.{format}").exists()]
    if not found:
        raise ValueError(
            f"{folder} holds no {RUNS}.{' or .'.join(FORMATS)}: is it a folder of piezoest bench?"
        )
    newest = max(found, key=lambda path: path.stat().st_mtime_ns)
    if newest.suffix == ".parquet" and default_format() == "csv":
        raise ValueError(f"{newest}: reading it needs pyarrow, pip install 'piezoest[formats]'")
    try:
        rows = (_read_csv if newest.suffix == ".csv" else _read_parquet)(newest)
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise ValueError(f"{newest} is damaged: {error}") from None
    if missing := sorted(set(COLUMNS).difference(*rows[:1])):
        raise ValueError(f"{newest} lacks {', '.join(missing)}: let the same command write it again")
    return rows


def _read_csv(path: Path) -> list[Row]:
    with path.open(newline="", encoding="utf-8") as file:
        return [_typed(row) for row in csv.DictReader(file)]


def _read_parquet(path: Path) -> list[Row]:
    import pyarrow.parquet as parquet

    return list(parquet.read_table(path).to_pylist())


def _typed(cells: Mapping[str, str]) -> Row:
    return {name: None if text == "" else _value(COLUMNS[name], text) for name, text in cells.items()}


def _value(column: type, text: str) -> Any:
    return text == "True" if column is bool else column(text)


@contextlib.contextmanager
def _csv(path: Path, columns: Mapping[str, type]) -> Iterator[Callable[[Row], None]]:
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(columns), extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        yield lambda row: writer.writerow(row)


@contextlib.contextmanager
def _parquet(path: Path, columns: Mapping[str, type]) -> Iterator[Callable[[Row], None]]:
    import pyarrow
    import pyarrow.parquet as parquet

    types = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64(), bool: pyarrow.bool_()}
    schema = pyarrow.schema([(name, types[column]) for name, column in columns.items()])
    batch: list[Row] = []
    with replacing(path) as temporary, parquet.ParquetWriter(temporary, schema) as writer:

        def flush() -> None:
            if batch:
                writer.write_table(pyarrow.Table.from_pylist(batch, schema=schema))
                batch.clear()

        def write(row: Row) -> None:
            batch.append(row)
            if len(batch) >= BATCH:
                flush()

        yield write
        flush()
