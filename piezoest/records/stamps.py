"""Time stamps in the cells of a text file: of an hour, of a day, or behind a date."""

import re
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray

HALF = r"(\s*[AaPp]\.?[Mm]\.?)"
# 2026-11-22T10:00:00.005+01:00, as ISO 8601 has it.
ISO = re.compile(r"\d{4}[-/]\d{2}[-/]\d{2}[T ]\d{2}:\d{2}(:\d{2})?([.,]\d+)?\s*(Z|z|[-+]\d{2}(:?\d{2})?)?")
# 22.11.2026 10:00:00,005 and 11/22/26 10:00:00.005 AM, and a date of ISO 8601 before AM or PM.
DATE = r"(\d{1,2})([./]|-(?=\d{1,2}-\d{4}))(\d{1,2})\2(\d{4}|\d{2})[,.]?\s+"
ISO_DATE = r"(\d{4}[-/]\d{2}[-/]\d{2})\s+"
TIME = rf"(\d{{1,2}})(:\d{{2}}(?::\d{{2}}(?:[.,]\d+)?)?){HALF}?"
DATED, PARTS = (re.compile(rf"(?:{DATE}|{ISO_DATE}){often}{TIME}") for often in ("", "?"))
OF_DAY = re.compile(rf"\d{{1,2}}:\d{{2}}:\d{{2}}([.,]\d+)?{HALF}?")
OF_HOUR = re.compile(r"\d{1,2}:\d{2}[.,]\d+")  # minutes and seconds: with two parts, only a fraction tells
TURNS = {OF_DAY: 86_400.0, OF_HOUR: 3600.0}
SLASHES = re.compile(r"(\d{1,2})([/-])(\d{1,2})\2\d{2}")
# 22-Nov-2026 10:00:00:005
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
NAME = rf"({'|'.join(MONTHS)})[a-z]*"
NAMED = re.compile(rf"(\d{{1,2}})[-. ]\s*{NAME}[-. ]\s*(?=\d)", re.IGNORECASE)
# Nov 22, 2026 10:00:00, and Sun Nov 22 10:00:00 2026 of the C library
NAME_FIRST = re.compile(rf"{NAME}\.? +(\d{{1,2}})[,.]? +(?=\d{{4}}\b)", re.IGNORECASE)
YEAR_LAST = re.compile(rf"[a-z]{{3}} +{NAME} +(\d{{1,2}}) +(\d\d:\d\d:\d\d\S*) +(\d{{4}})", re.IGNORECASE)
# 20261122T100000, 2026/1/2 and the 0 days 10:00:00 of pandas
WITHOUT_MARKS = re.compile(
    r"(?<![\d.])((?:19|20)\d\d)(0[1-9]|1[0-2])([0-2]\d|3[01])[T _-]?"
    r"([01]\d|2[0-3]):?([0-5]\d):?([0-5]\d)(?!\d)"
)
SHORT_DATE = re.compile(r"(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})(?=[T ])")
DAYS = re.compile(r"([0-9]|[12]\d) days? \+?(?=\d)")
# What stands behind a time says nothing more: a time without zone is taken as UTC.
ZONE = re.compile(r"\s*(?:UTC|GMT|CES?T|[EMP][SD]T|MES?Z|Uhr|\[[\w/]+\])$")
DAY_OF_WEEK = re.compile(r"(?:mon|tue|wed|thu|fri|sat|sun)[a-z]*, +", re.IGNORECASE)
MILLISECONDS = re.compile(r"(:\d{2}:\d{2}):(?=\d{3}(?!\d))")
DAY = "2000-01-01T"
# A clock that begins anew stands so near its beginning, in parts of a turn; elsewhere it was set.
NEAR = 1.0 / 24.0


def _plain(cell: str) -> str:
    """Cell with numbers for names of months, the usual marks, and a point before milliseconds."""
    cell = re.sub(r"^(\S{8,10})_(?=\d\d:)", r"\1 ", DAY_OF_WEEK.sub("", cell.strip(" ['\t")))
    cell = ZONE.sub("", cell).rstrip(" ]")
    cell = WITHOUT_MARKS.sub(r"\1-\2-\3 \4:\5:\6", YEAR_LAST.sub(r"\2-\1-\4 \3", cell))
    cell = SHORT_DATE.sub(lambda date: f"{date[1]}-{date[2]:0>2}-{date[3]:0>2}", cell)
    cell = DAYS.sub(lambda days: f"2000-01-{int(days[1]) + 1:0>2} ", cell)
    cell = NAMED.sub(lambda date: f"{date[1]}.{_number(date[2])}.", NAME_FIRST.sub(r"\2-\1-", cell))
    return MILLISECONDS.sub(r"\1.", cell)


def _number(month: str) -> int:
    """Number of the month of a name."""
    return MONTHS.index(month.lower()) + 1


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a time of day, minutes and seconds, or a time behind a date."""
    plain = _plain(cell)
    return any(each.fullmatch(plain) for each in (ISO, DATED, *TURNS))


def times_of(cells: Any, day_first: bool = False) -> Any:
    """Series of times, in UTC where a time zone is given; NaT where a cell holds none.

    `day_first`: whether 12/11/2026 is in November.
    """
    import pandas as pd

    words = pd.Series(cells, dtype=str).fillna("").str.strip().str.replace(",", ".", regex=False)
    # A time of day alone is that of any day.
    words = words.mask(words.str.match(r"\d\d:\d\d:[\d.]+$"), DAY + words)
    times = pd.to_datetime(words, format="ISO8601", utc=True, errors="coerce")
    other = times.isna() & (words != "")
    if not other.any():
        return times
    plain = map(_plain, words[other])
    words[other] = [_as_iso(word, day_first) or word for word in plain]
    return pd.to_datetime(words, format="ISO8601", utc=True, errors="coerce")


def _as_iso(word: str, day_first: bool) -> str:
    """Time stamp as ISO 8601 has it: with points the day stands first."""
    parts = PARTS.fullmatch(f"00:{'0' * (word[1] == ':')}{word}" if OF_HOUR.fullmatch(word) else word)
    if parts is None:
        return ""
    first, mark, second, year, date, hour, rest, half = parts.groups()
    if half is not None:
        if not 1 <= int(hour) <= 12:
            return ""
        hour = str(int(hour) % 12 + 12 * (half.strip()[0] in "Pp"))
    if year is not None:
        day, month = (first, second) if mark == "." or day_first else (second, first)
        date = f"{'20' if len(year) == 2 else ''}{year}-{month:0>2}-{day:0>2}"
    return f"{date}T{hour:0>2}{rest}" if date else f"{DAY}{hour:0>2}{rest}"


class Clock(NamedTuple):
    """A column of time stamps."""

    origin: Any  # its first time
    turn: float  # after which it begins anew [s]; infinite behind a date
    day_first: bool  # whether the day stands first in a date with slashes
    guessed: str  # a date that does not tell; empty if it does

    @classmethod
    def of(cls, cell: str) -> "Clock":
        """Clock whose first time stands in a cell."""
        plain = _plain(cell)
        turns = (turn for pattern, turn in TURNS.items() if pattern.fullmatch(plain))
        slashes = SLASHES.match(cell.strip())
        first, second = (int(slashes[1]), int(slashes[3])) if slashes else (0, 13)
        dashes = slashes is not None and slashes[2] == "-"
        guessed = cell.strip() if max(first, second) <= 12 and first != second and not dashes else ""
        # With dashes the day usually stands first.
        day_first = first > 12 or (dashes and second <= 12)
        return cls(times_of([cell], day_first)[0], next(turns, np.inf), day_first, guessed)


class Onward:
    """Times of a clock that go on where it begins anew, block by block."""

    def __init__(self, turn: float) -> None:
        self.turn, self._last, self._added = turn, np.nan, 0.0

    def __call__(self, times: FloatArray) -> tuple[FloatArray, list[int]]:
        """Times that go on [s], and which of them are the first ones of a new turn."""
        known = np.flatnonzero(np.isfinite(times))
        if not known.size or np.isinf(self.turn):
            return times, []
        left = np.diff(times[known], prepend=self._last) + self.turn
        anew = (left >= 0.0) & (left < NEAR * self.turn)
        added = self._added + self.turn * np.cumsum(anew)
        onward = times.copy()
        onward[known] += added
        self._last, self._added = float(times[known[-1]]), float(added[-1])
        return onward, known[anew].tolist()
