"""Columns of a CSV file: delimiter, header, names and units are recognised."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray

# Names by which logs call the quantities, in lower case; the unit stands beside them.
NAMES = {
    "time": ("time", "t", "timestamp", "seconds", "elapsed", "zeit"),
    "voltage": ("voltage", "u", "v", "volt", "volts", "vin", "drive", "input", "control voltage", "spannung"),
    "displacement": (
        "displacement", "x", "y", "w", "disp", "position", "pos", "measured", "measurement", "output",
        "sensor", "gauge", "weg",
    ),
    "reference": ("reference", "ref", "r", "setpoint", "target", "desired"),
}  # fmt: skip
UNITS = {
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "voltage": {"v": 1.0, "mv": 1e-3, "uv": 1e-6, "kv": 1e3},
    "displacement": {"um": 1.0, "micron": 1.0, "microns": 1.0, "nm": 1e-3, "pm": 1e-6, "mm": 1e3, "m": 1e6},
}
UNITS["reference"] = UNITS["displacement"]
BASE_UNITS = {"time": "s", "voltage": "V", "displacement": "µm", "reference": "µm"}
MOST_BLANK = 0.1
MISSING = frozenset({"", "nan", "-", "--", "na", "n/a", "#n/a", "null", "none", "missing"})


class Table(NamedTuple):
    """Columns as read, converted to s, V, µm; NaN where there was no number."""

    path: Path
    lines: list[int]
    values: dict[str, FloatArray]
    notes: list[str]


class _Column(NamedTuple):
    position: int
    header: str
    factor: float
    note: str


def read_table(path: Path, wanted: tuple[str, ...], named: dict[str, str]) -> Table:
    """Columns of the wanted quantities, by the names given or guessed; ValueError if that cannot be."""
    if unknown := sorted(set(named) - set(NAMES)):
        raise ValueError(f"columns has {unknown}: known are time, voltage and displacement")
    lines, rows = _read_rows(path)
    header: list[str] = []
    if not all(_is_number(cell) for cell in rows[0]):
        header, lines, rows = [cell.strip() for cell in rows[0]], lines[1:], rows[1:]
        while rows and not any(rows[0]):
            lines, rows = lines[1:], rows[1:]
    width = len(header) or len(rows[0])
    for line, row in zip(lines, rows, strict=True):
        if len(row) > width and any(cell.strip() for cell in row[width:]):
            raise ValueError(f"{path}, line {line}: {len(row)} fields, where the first row has {width}")
    chosen = _choose(path, header, width, wanted, named)
    values = {
        quantity: column.factor * _numbers(path, lines, rows, column) for quantity, column in chosen.items()
    }
    notes = [column.note for column in chosen.values() if column.note]
    if not header:
        order = ", ".join(chosen)
        notes.insert(0, f"no header: columns taken as {order}, in {', '.join(BASE_UNITS[q] for q in chosen)}")
    return Table(path, lines, values, notes)


def _read_rows(path: Path) -> tuple[list[int], list[list[str]]]:
    """Rows that are neither blank nor comments, with their line numbers."""
    raw = path.read_bytes()
    if b"\0" in raw[:4096] and not raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise ValueError(f"{path}: this is not a text file: save the log as CSV")
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = raw.decode("utf-16", errors="replace")
    else:
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("latin-1")
    numbered = [
        (number, line)
        for number, line in enumerate(text.strip().splitlines(), start=1 + _leading_lines(text))
        if not line.lstrip().startswith("#")
    ]
    filled = [(number, line) for number, line in numbered if line.strip()]
    if not filled:
        raise ValueError(f"{path}: the file is empty")
    # A few blank lines are samples that were lost; many are the way the file is written.
    if len(numbered) - len(filled) > MOST_BLANK * len(filled):
        numbered = filled
    numbered = numbered[numbered.index(filled[0]) :]
    first = numbered[0][1]
    delimiter = next((mark for mark in ";\t,|" if mark in first), " ")
    lines = (line for _, line in numbered)
    if delimiter != ",":
        # A decimal comma; in a header it would only be part of a name.
        lines = (line.replace(",", ".") for line in lines)
    if delimiter == " ":
        rows = [line.split() for line in lines]
    else:
        rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=False))
    if len(rows) != len(numbered):
        raise ValueError(f"{path}: a quotation mark is left open")
    return [number for number, _ in numbered], rows


def _leading_lines(text: str) -> int:
    return len(text[: len(text) - len(text.lstrip())].splitlines())


def _is_number(cell: str) -> bool:
    text = cell.strip().lower()
    if text in MISSING:
        return True
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _numbers(path: Path, lines: list[int], rows: list[list[str]], column: _Column) -> FloatArray:
    values = np.full(len(rows), np.nan)
    for k, row in enumerate(rows):
        cell = row[column.position].strip() if column.position < len(row) else ""
        try:
            value = float(cell)
        except ValueError:
            if cell.lower() not in MISSING:
                raise ValueError(
                    f"{path}, line {lines[k]}, column {column.header!r}: {cell!r} is not a number"
                ) from None
            continue
        if math.isfinite(value):
            values[k] = value
    return values


def _choose(
    path: Path, header: list[str], width: int, wanted: tuple[str, ...], named: dict[str, str]
) -> dict[str, _Column]:
    """Which column holds what: as told, else by name, else by unit."""
    chosen: dict[str, _Column] = {}
    if not header and not named:
        if width < len(wanted):
            raise ValueError(
                f"{path}: {width} columns without a header, {len(wanted)} are needed: {', '.join(wanted)}"
            )
        # Without a column of time wanted, a first of three columns is still time.
        shift = width - len(wanted) if width == 3 and "time" not in wanted else 0
        return {q: _Column(i + shift, str(i + shift + 1), 1.0, "") for i, q in enumerate(wanted)}
    for quantity in wanted:
        if quantity in named:
            index = _find(path, header, width, quantity, named[quantity])
        else:
            index = _guess(path, header, quantity)
        name = header[index] if header else str(index + 1)
        chosen[quantity] = _Column(index, name, *_factor(path, name, quantity))
    indices = [column.position for column in chosen.values()]
    for quantity, column in chosen.items():
        if indices.count(column.position) > 1:
            raise ValueError(
                f"{path}: column {column.header!r} would be {quantity} and something else: name the columns"
            )
    return chosen


def _find(path: Path, header: list[str], width: int, quantity: str, name: str) -> int:
    for candidates in (header, [_split_unit(title)[0] for title in header]):
        if candidates.count(name) == 1:
            return candidates.index(name)
    if name.isdigit() and 1 <= int(name) <= width:
        return int(name) - 1
    raise ValueError(f"{path}: no column {name!r} for {quantity}; there {_listed(header, width)}")


def _guess(path: Path, header: list[str], quantity: str) -> int:
    split = [_split_unit(title) for title in header]
    found = [i for i, (name, _) in enumerate(split) if name.lower() in NAMES[quantity]]
    if not found and quantity == "reference":
        return _guess(path, header, "displacement")
    if not found:
        known = {name for names in NAMES.values() for name in names}
        found = [
            i for i, (name, unit) in enumerate(split)
            if unit in UNITS[quantity] and name.lower() not in known
        ]  # fmt: skip
    if len(found) == 1:
        return found[0]
    if found:
        titles = ", ".join(header[i] for i in found)
        raise ValueError(f"{path}: the columns {titles} could all be the {quantity}: name the one that is")
    hint = " or give the sample rate" if quantity == "time" else ""
    raise ValueError(
        f"{path}: no column for {quantity} found; there {_listed(header, len(header))}: name it{hint}"
    )


def _listed(header: list[str], width: int) -> str:
    return f"are the columns {', '.join(header)}" if header else f"are {width} columns without names"


def _split_unit(title: str) -> tuple[str, str]:
    """Split ``drive_mV``, ``pos [nm]``, ``t (ms)``, ``x/µm`` into name and unit in lower case."""
    plain = title.strip().replace("µ", "u").replace("μ", "u").replace("\N{REPLACEMENT CHARACTER}", "u")
    match = re.fullmatch(r"(.+?)\s*(?:\[(\w+)\]|\((\w+)\)|[/_\s.]\s*(\w+))", plain)
    if match is None:
        return plain, ""
    unit = next(group for group in match.groups()[1:] if group)
    if any(_unit_key(unit) in units for units in UNITS.values()):
        return match[1].replace("_", " ").strip(), _unit_key(unit)
    return plain.replace("_", " "), ""


def _unit_key(unit: str) -> str:
    """Unit in lower case; only mega would differ from milli by case, and no log has it."""
    return unit.lower()


def _factor(path: Path, title: str, quantity: str) -> tuple[float, str]:
    """Factor to the base unit, and a note where one was applied or a unit assumed."""
    _, unit = _split_unit(title)
    base = BASE_UNITS[quantity]
    if unit and unit not in UNITS[quantity]:
        raise ValueError(
            f"{path}: column {title!r} has the unit {unit}, but {quantity} must be in {base}: convert it"
        )
    if not unit:
        return 1.0, f"column {title!r}: unit taken as {base}"
    factor = UNITS[quantity][unit]
    return factor, "" if factor == 1.0 else f"column {title!r}: converted to {base} (factor {factor:g})"
