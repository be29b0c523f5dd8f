"""Tables of runs in memory and as files: Parquet where pyarrow is installed, else CSV."""

from collections.abc import Iterable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pandas as pd

from piezoest._files import replacing

FORMATS = ("parquet", "csv")
# Types that know what is missing: a run that failed has no numbers.
TYPES: dict[type, str] = {str: "string", int: "Int64", float: "Float64", bool: "boolean"}


def checked_format(format: str | None) -> str:
    """Format that can be written here. `format`: default Parquet where pyarrow is installed."""
    has_parquet = find_spec("pyarrow") is not None
    if format is None:
        return "parquet" if has_parquet else "csv"
    if format not in FORMATS:
        raise ValueError(f"table format must be one of {', '.join(FORMATS)}, got {format!r}")
    if format == "parquet" and not has_parquet:
        raise ValueError("pyarrow is not installed: pip install 'piezoest[formats]', or take format csv")
    return format


def table_of(rows: Iterable[Mapping[str, Any]], columns: Mapping[str, type]) -> pd.DataFrame:
    """Table of rows, as `TYPES`; what is not in a row is missing."""
    cells = [[row.get(name) for name in columns] for row in rows]
    return pd.DataFrame(cells, columns=list(columns)).astype(_types(columns))


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write a table, whole or not at all."""
    write = table.to_parquet if checked_format(path.suffix[1:]) == "parquet" else table.to_csv
    with replacing(path) as temporary:
        write(temporary, index=False)


def read_table(folder: Path, name: str, columns: Mapping[str, type]) -> pd.DataFrame:
    """Read a table of a folder; of two formats the newer one. `folder`: what `write_table` wrote to."""
    found = [path for format in FORMATS if (path := folder / f"{name}.{format}").exists()]
    if not found:
        raise ValueError(
            f"{folder} holds no {name}.{' or .'.join(FORMATS)}: is it a folder of piezoest bench?"
        )
    path = max(found, key=lambda each: each.stat().st_mtime_ns)
    checked_format(path.suffix[1:])
    try:
        if path.suffix == ".csv":
            return pd.read_csv(path, dtype=_types(columns), usecols=list(columns))
        return pd.read_parquet(path, columns=list(columns)).astype(_types(columns))
    except (KeyError, TypeError, ValueError, OSError) as error:
        raise ValueError(f"{path} is damaged, or another version wrote it: {error}") from None


def _types(columns: Mapping[str, type]) -> dict[str, str]:
    return {name: TYPES[kind] for name, kind in columns.items()}
