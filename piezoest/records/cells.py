"""What a cell of a text file holds: a number, as this file writes numbers, or none."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from piezoest.records.stamps import is_stamp
from piezoest.records.titles import UNITS

WORDS = (
    "nan", "-", "--", "---", "na", "n/a", "n.a.", "<na>", "nat", "?", "null", "none", "missing", "-nan",
    "nan(ind)", "-nan(ind)", "∞", "-∞", "over", "overflow", "overrange", "overload", "ovld", "ovrflw",
)  # fmt: skip
# Errors of spreadsheets: #N/A, #DIV/0!, #WERT!, #¡VALOR!, #NAME?; and of C on Windows: 1.#QNAN, -1.#IND00.
OF_SHEETS = r"#(?:[¡¿]?[A-ZÄÖÜ0/]+[!?]|N/?[ADV])"
ERROR = re.compile(rf"{OF_SHEETS}|##+|\*\*+|[-+]?1\.#[A-Z]+\d*", re.IGNORECASE)
MISSING = sorted({"", *WORDS, *map(str.upper, WORDS), *map(str.capitalize, WORDS), "NaN"})
# Groups of three never begin with zero, so 0.005 holds none.
GROUPS = r"[-+]?[1-9]\d{{0,2}}(?:{0}\d{{3}})+"
# What may stand between such groups without being a decimal mark.
SPACES = "[ '\N{NO-BREAK SPACE}\N{THIN SPACE}\N{NARROW NO-BREAK SPACE}\N{RIGHT SINGLE QUOTATION MARK}]"
SPACED = re.compile(GROUPS.format(SPACES) + r"(?!\d)")
EXPONENT = r"(?:[eE][-+]?\d+)?"
PLAIN = re.compile(rf"[-+]?(\d*)([.,])(\d*){EXPONENT}")
ONE_GROUP = re.compile(GROUPS.format("[.,]") + EXPONENT)
WHOLE = re.compile(r"[-+]?\d+")
WITH_UNIT = re.compile(r"([-+]?\d\S*) +([^\W\d_]+)")
OTHER = {",": ".", ".": ","}
GROUPED = {
    thousands: re.compile(rf"{GROUPS.format(re.escape(thousands))}(?:{re.escape(decimal)}\d*)?{EXPONENT}")
    for thousands, decimal in OTHER.items()
}


class Style(NamedTuple):
    """How a file writes numbers."""

    decimal: str = "."  # ``"."``, ``","``, or ``".,"`` where both stand for decimals
    thousands: str = ""  # ``","``, ``"."``, or empty if neither separates thousands
    guessed: str = ""  # a number such as 1,234 whose comma is only taken for decimals; empty if others tell


def style_of(cells: Iterable[str]) -> Style:
    """How numbers are written, by what cannot be read in another way."""
    seen: dict[tuple[str, str], str] = {}  # what a mark is for, and a cell that shows it
    for cell in cells:
        text = _without_spaces(cell)
        if mark := _separates_thousands(text):
            seen.setdefault((mark, "thousands"), text)
        elif (plain := PLAIN.fullmatch(text)) and (plain[1] or plain[3]):
            seen.setdefault((plain[2], "unclear" if ONE_GROUP.fullmatch(text) else "decimal"), text)
    for mark, other in OTHER.items():
        if (sure := seen.get((mark, "thousands"))) is not None:
            _agree(sure, seen.get((other, "thousands")) or seen.get((mark, "decimal")))
            return Style(other, mark)
    decimals = [mark for mark in OTHER if (mark, "decimal") in seen]
    if len(decimals) == 1:
        _agree(seen.get((OTHER[decimals[0]], "unclear")), seen[decimals[0], "decimal"])
    if not decimals and (".", "unclear") not in seen and (",", "unclear") in seen:
        return Style(",", guessed=seen[",", "unclear"])
    decimals = decimals or [mark for mark in OTHER if (mark, "unclear") in seen]
    return Style(decimals[0] if len(decimals) == 1 else ".,")


class Marks:
    """Refuses 14.027 beside 986 in a column where no number has fewer or more digits behind its mark.

    It may be 14 027.
    """

    def __init__(self) -> None:
        self.marked = self.whole = ""
        self.sure = False

    def see(self, cell: str) -> None:
        """Look at a cell of the column."""
        if self.sure:
            return
        text = cell.strip()
        if WHOLE.fullmatch(text):
            self.whole = self.whole or text
        elif ONE_GROUP.fullmatch(text):
            self.marked = self.marked or text
        else:
            self.sure = PLAIN.fullmatch(text) is not None

    def check(self) -> None:
        """Raise ValueError if the numbers can be read in two ways."""
        if not self.sure:
            _agree(self.marked or None, self.whole or None)


def _agree(one: str | None, other: str | None) -> None:
    if one is not None and other is not None:
        raise ValueError(
            f"{one!r} beside {other!r}: it is not clear which mark is for decimals and which for thousands: "
            "write the log without a separator of thousands"
        )


def _separates_thousands(text: str) -> str:
    """Mark that can only separate thousands in this number; empty if there is none."""
    for mark, pattern in GROUPED.items():
        if mark in text and (OTHER[mark] in text or text.count(mark) > 1) and pattern.fullmatch(text):
            return mark
    return ""


def _without_spaces(cell: str) -> str:
    text = cell.strip().replace("\N{MINUS SIGN}", "-")
    return re.sub(SPACES, "", text) if SPACED.match(text) else text


def number(cell: str, style: Style) -> float:
    """Value of a cell; ValueError if it holds no number."""
    text = _without_spaces(cell)
    mark = style.thousands or _separates_thousands(text)
    if mark and mark not in style.decimal and GROUPED[mark].fullmatch(text):
        text = text.replace(mark, "")
    if any(mark in text and mark not in style.decimal for mark in ".,"):
        raise ValueError("a mark that is not for decimals")
    if "_" in text:
        raise ValueError("an underscore in a number")
    # Fortran writes 1.0D+00.
    return float(re.sub(r"(?<=[\d.])[dD](?=[-+]?\d)", "e", text.replace(",", ".")))


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no number."""
    text = cell.strip()
    return text.lower() in ("", *WORDS) or ERROR.fullmatch(text) is not None


def split_cell(cell: str) -> tuple[str, str]:
    """Number and unit of a cell such as ``0.001 sec``, as MATLAB writes durations; else the cell alone."""
    plain = cell.strip()
    found = WITH_UNIT.fullmatch(plain) if plain[-1:].isalpha() else None
    known = found is not None and any(found[2].lower() in units for units in UNITS.values())
    return (found[1], found[2]) if found and known else (plain, "")


def is_number(cell: str) -> bool:
    """Whether a cell may hold a number, a missing one or a time stamp, in whatever style."""
    text, _ = split_cell(cell)
    if is_missing(text) or is_stamp(text) or any(each.fullmatch(text) for each in GROUPED.values()):
        return True
    try:
        number(text, Style(".,"))
    except ValueError:
        return False
    return True
