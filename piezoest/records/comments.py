"""What comments and other lines above the rows of a text file state: names of columns, the sample rate."""

import itertools
import re

from piezoest.records.cells import OF_SHEETS, ONE_GROUP, Style, number
from piezoest.records.rates import is_decimated, rate_of, stated_rate
from piezoest.records.titles import quantities_called, quantity_of_unit, split_unit, with_u, with_units

COMMENTS = ("#", "%")
# The beginning of a comment, but not of a row whose first cell is an error of a spreadsheet.
COMMENT = rf"(?!(?i:{OF_SHEETS})[^\S\n]*(?:[-+.,;|\d\n]|\Z)|##+[,;|\t])[#%]"
# A line ``sample rate [kHz]: 10`` or ``SAMPLE_TIME = 5e-05``, with the unit beside the name or the number.
ENTRY = re.compile(
    r"\s*([A-Za-z_][\w ]*?)\s*(?:[(\[](\w+)[)\]])?\s*[:=]\s*([-+.,\deE]+)\s*([^\W\d][\w/]*)?\s*"
)
# Words before a list of units, and before a unit.
UNIT, BEFORE = ("unit", "units", "einheit", "einheiten", "unité", "unités"), ("in", "is", "are")
# The unit of a rate or period in a line of its own.
UNIT_APART = re.compile(r"(?:rate|fs|period|interval|dt|ts|time)[ _]*units?\W+(\w+)", re.IGNORECASE)
# A line ``NAME0 = Actual Position of Axis 1``, of which Physik Instrumente's GCS arrays have one a column, or
# ``column 1: time [s]``.
NUMBERED_NAME = re.compile(
    r"\s*(?:name|col\.?|column|spalte|channel)?\s*(\d+)\s*[=:)]\s*(\D.*?)\s*", re.IGNORECASE
)


def is_comment(line: str) -> bool:
    """Whether a line is a comment."""
    return re.match(COMMENT, line.lstrip()) is not None


def bare(comment: str) -> str:
    """Comment without its sign and without quotation marks, which need not be closed there."""
    return comment.lstrip().lstrip("".join(COMMENTS)).replace('"', "")


def entries_in(lines: list[list[str]]) -> list[str]:
    """Entries in the cells of lines: one in a cell, or with the number in the cell behind it or below."""
    # A number that was cut at its comma, as 50,000 is, states nothing.
    found = [
        cell
        for line in lines
        for cell, behind in zip(line, [*line[1:], ""], strict=True)
        if not (cell[-1:].isdigit() and behind[:1].isdigit())
    ]
    for line in lines:
        found.append(" ".join(line))
        # The unit may have a cell of its own.
        unit = line[2] if len(line) > 2 and not re.search(r"[^\W\d]", line[1]) else ""
        if len(line) > 1 and not re.match(r"\d{3}\b", unit):
            found.append(f"{line[0]} = {line[1]} {unit}")
    for upper, lower in itertools.pairwise(lines):
        found += [f"{name} = {value}" for name, value in zip(upper, lower, strict=False)]
    return found


def rate_in(comments: list[str], style: Style) -> float | None:
    """Sample rate that comments state [Hz], in numbers as rows write them; None for none, or several."""
    if any(map(is_decimated, comments)):
        return None
    entries = [entry for comment in comments if (entry := ENTRY.fullmatch(bare(comment)))]
    if any(unit[1].lower() not in ("hz", "s") for unit in map(UNIT_APART.search, comments) if unit):
        entries = [entry for entry in entries if entry[2] or entry[4]]
    found = {_rate_of(entry, style) for entry in entries} - {None}
    return found.pop() if len(found) == 1 else None


def _rate_of(entry: re.Match[str], style: Style) -> float | None:
    """Sample rate that an entry states [Hz], itself or by its period; None if it is another entry."""
    value = _value(entry[3], style)
    if value is None or (entry[2] and entry[4]):
        return None
    return rate_of(entry[1], value, entry[2] or entry[4] or "")


def _value(text: str, style: Style) -> float | None:
    """Number above zero that an entry states; None for 1.000 or 1,000 where that may be a thousand."""
    if ONE_GROUP.fullmatch(text) and not (style.thousands or style.decimal == "." in text):
        return None
    try:
        return stated_rate(number(text, style))
    except ValueError:
        return stated_rate(text)


def units_in(line: str) -> list[str]:
    """Units that a line states: ``units: s, V, nm``, ``x in nm``, ``position nm``, ``s V nm``."""
    plain = with_u(bare(line))
    words = re.findall(r"\d+|[^\W\d_]+", plain)
    pairs = list(itertools.pairwise(words))
    place = next((k for k, word in enumerate(words) if word.lower() in UNIT), None)
    if place is not None:
        return [word for word in words[place + 1 :] if quantity_of_unit(word)]
    if behind := [word for before, word in pairs if before.lower() in BEFORE and quantity_of_unit(word)]:
        return behind
    if len(words) > 1 and all(map(quantity_of_unit, words)):
        return words
    if alone := [word for word in re.findall(r"[\[(]\s*(\w+)\s*[\])]", plain) if quantity_of_unit(word)]:
        return alone
    return [unit for name, unit in pairs if quantity_of_unit(unit) in quantities_called(name.lower())]


def states_units(line: str) -> bool:
    """Whether a comment states units, also behind names as in ``t_s,x_um``."""
    return bool(units_in(line)) or any(split_unit(word)[1] for word in re.split(r"[\s,;]+", bare(line)))


def with_stated_units(names: list[str], lines: list[str]) -> tuple[list[str], dict[str, str]]:
    """Names without units with those of a line that has one for each; else units of lines, and the lines."""
    found: dict[str, str] = {}
    own = [split_unit(name)[1] for name in names]
    if own and all(own):
        return names, found
    for line in lines:
        units = units_in(line)
        if len(units) == len(names) and (titles := with_units(names, units)):
            return [name if unit else title for name, unit, title in zip(names, own, titles, strict=True)], {}
        found |= dict.fromkeys((unit.lower() for unit in units), line)
    return names, found


def numbered_names(comments: list[str]) -> list[str]:
    """Names of columns that have a line each, in the order of their numbers."""
    found = [entry for comment in comments if (entry := NUMBERED_NAME.fullmatch(bare(comment)))]
    return [entry[2] for entry in sorted(found, key=lambda entry: int(entry[1]))]
