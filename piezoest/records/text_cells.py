"""What a cell of a text file holds: a number, as this file writes numbers, or a time stamp."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

MISSING = frozenset({"", "nan", "-", "--", "na", "n/a", "#n/a", "null", "none", "missing"})
NANOSECONDS = 1e9  # in a second
# Groups of three never begin with zero, so 0.005 holds none.
GROUPS = r"[-+]?[1-9]\d{{0,2}}(?:{0}\d{{3}})+"
# What may stand between such groups without being a decimal mark.
SPACES = "[ '\N{NO-BREAK SPACE}\N{THIN SPACE}\N{NARROW NO-BREAK SPACE}\N{RIGHT SINGLE QUOTATION MARK}]"
SPACED = re.compile(GROUPS.format(SPACES) + r"(?!\d)")
EXPONENT = r"(?:[eE][-+]?\d+)?"
PLAIN = re.compile(rf"[-+]?(\d*)([.,])(\d*){EXPONENT}")
ONE_GROUP = re.compile(GROUPS.format("[.,]") + EXPONENT)
GROUPED = {
    thousands: re.compile(rf"{GROUPS.format(re.escape(thousands))}(?:{re.escape(decimal)}\d*)?{EXPONENT}")
    for thousands, decimal in ((",", "."), (".", ","))
}
STAMP = re.compile(
    r"(\d{4})[-/](\d{2})[-/](\d{2})[T ](\d{2}:\d{2})(:\d{2})?(?:[.,](\d{1,9})\d*)?"
    r"\s*(Z|z|[-+]\d{2}(?::?\d{2})?)?"
)


class Style(NamedTuple):
    """How a file writes numbers.

    Parameters
    ----------
    decimal : str
        ``"."``, ``","``, or ``".,"`` where both stand for decimals.
    thousands : str
        ``","``, ``"."``, or empty if neither separates thousands.
    """

    decimal: str = "."
    thousands: str = ""


def style_of(cells: Iterable[str]) -> Style:
    """How numbers are written, by what cannot be read in another way.

    Raises
    ------
    ValueError
        If the cells contradict each other; the message begins with one of them.
    """
    seen: dict[str, str] = {}  # what a mark is for, and a cell that shows it
    for cell in cells:
        text = _without_spaces(cell)
        if use := _use(text):
            seen.setdefault(use, text)
    for thousands, decimal in ((",", "."), (".", ",")):
        if f"{thousands} thousands" in seen:
            against = seen.get(f"{decimal} thousands") or seen.get(f"{thousands} decimal")
            if against:
                raise ValueError(_contradiction(seen[f"{thousands} thousands"], against))
            return Style(decimal, thousands)
    marks = [mark for mark in ".," if f"{mark} decimal" in seen]
    if len(marks) == 1:
        other = "," if marks == ["."] else "."
        if unclear := seen.get(f"{other} unclear"):
            raise ValueError(_contradiction(unclear, seen[f"{marks[0]} decimal"]))
    if not marks:
        marks = [mark for mark in ".," if f"{mark} unclear" in seen]
    return Style("".join(marks) or ".,")


def _use(text: str) -> str:
    """What a number shows of its mark: that it is for decimals, for thousands, or nothing sure."""
    if mark := _separates_thousands(text):
        return f"{mark} thousands"
    plain = PLAIN.fullmatch(text)
    if plain is None or not (plain[1] or plain[3]):
        return ""
    return f"{plain[2]} unclear" if ONE_GROUP.fullmatch(text) else f"{plain[2]} decimal"


def _separates_thousands(text: str) -> str:
    """Mark that can only separate thousands in this number; empty if there is none."""
    for mark, pattern in GROUPED.items():
        other = "." if mark == "," else ","
        if mark in text and (other in text or text.count(mark) > 1) and pattern.fullmatch(text):
            return mark
    return ""


def _without_spaces(cell: str) -> str:
    text = cell.strip()
    return re.sub(SPACES, "", text) if SPACED.match(text) else text


def _contradiction(one: str, other: str) -> str:
    return (
        f"{one!r} beside {other!r}: it is not clear which mark is for decimals and which for thousands: "
        "write the log without a separator of thousands"
    )


def number(cell: str, style: Style) -> float:
    """Value of a cell; ValueError if it holds no number."""
    text = _without_spaces(cell)
    mark = style.thousands or _separates_thousands(text)
    if mark and mark not in style.decimal and GROUPED[mark].fullmatch(text):
        text = text.replace(mark, "")
    if any(mark in text and mark not in style.decimal for mark in ".,"):
        raise ValueError("a mark that is not for decimals")
    return float(text.replace(",", "."))


def is_number(cell: str) -> bool:
    """Whether a cell may hold a number, a missing one or a time stamp, in whatever style."""
    text = cell.strip()
    if text.lower() in MISSING or is_stamp(text) or any(each.fullmatch(text) for each in GROUPED.values()):
        return True
    try:
        number(text, Style(".,"))
    except ValueError:
        return False
    return True


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a date with a time of day, as ISO 8601 has them."""
    return STAMP.fullmatch(cell.strip()) is not None


def stamp(cell: str) -> int | None:
    """Nanoseconds since 1970, in UTC where a time zone is given; None if missing; ValueError otherwise."""
    text = cell.strip()
    if text.lower() in MISSING or text.lower() == "nat":
        return None
    match = STAMP.fullmatch(text)
    if match is None:
        raise ValueError("no time stamp")
    year, month, day, hour, second, part, zone = match.groups()
    at = np.datetime64(f"{year}-{month}-{day}T{hour}{second or ':00'}", "ns").astype(np.int64)
    return int(at) + int((part or "0").ljust(9, "0")) - _offset(zone)


def _offset(zone: str | None) -> int:
    """Nanoseconds by which a zone is before UTC."""
    if zone is None or zone in "Zz":
        return 0
    minutes = 60 * int(zone[1:3]) + int(zone[3:].lstrip(":") or 0)
    return (-1 if zone[0] == "-" else 1) * minutes * 60_000_000_000


def seconds(ticks: Any, origins: dict[int, int], position: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Times of a column since its first [s], of nanoseconds with NaT where one is missing.

    Parameters
    ----------
    ticks : ndarray of datetime64[ns], shape (n,)
        Nanoseconds since 1970 have no room in a float; their differences have.
    origins : dict
        The first time of each column, kept from block to block.
    position : int
        Number of the column.
    """
    known = ~np.isnat(ticks)
    numbers = ticks.astype(np.int64)
    if position not in origins and known.any():
        origins[position] = int(numbers[known][0])
    times = np.full(numbers.size, np.nan)
    times[known] = (numbers[known] - origins.get(position, 0)) / NANOSECONDS
    return times
