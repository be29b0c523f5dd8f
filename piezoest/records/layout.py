"""How a text file is written: its marks, its header, and where its rows begin."""

import csv
import itertools
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from piezoest.records import scopes
from piezoest.records.cells import Marks, Style, is_missing, is_number, split_cell, style_of
from piezoest.records.comments import bare, entries_in, is_comment, numbered_names, rate_in, with_stated_units
from piezoest.records.lines import LONGEST_FOOTER, check_table, chunks, encoding_of, end_of_rows
from piezoest.records.source import LogError
from piezoest.records.stamps import Clock, is_stamp
from piezoest.records.titles import (
    LITTLE_WORDS,
    counted_names,
    names_columns,
    names_other_order,
    quantities_called,
    quantity_of_unit,
    titled,
    with_units,
)

# Blank lines among the others: more are the way the file is written, fewer are samples that were lost.
MOST_BLANK = 0.1
# Lines by which the layout is recognised, and rows in which a time stamp is looked for.
HEAD_LINES, STAMP_ROWS = 10_000, 100
# Lines that instruments write above the header, at most.
LONGEST_PREAMBLE = 200
# Lines of a header: names, units, comments, types.
LONGEST_HEADER = 8
# A name with a unit in brackets, among other words.
WITH_UNIT = re.compile(r"[^\s,;|]+\s*[\[(][^\s\])]+[\])]")
# What a line with a time stamp has.
MAYBE_STAMP = re.compile(r"[:T]|(?<!\d)(?:19|20)\d{6}_?\d{6}")
# What may stand around names in a comment, and how long a name is at most.
LIST = re.compile(
    r"\s*(?:(?:columns?|fields?|header|names|spalten)\s*[:=])?\s*(?:[\[(](.*)[\])]|(.*?))\s*", re.IGNORECASE
)
LONGEST_NAME = 30
# A byte order mark that is not the first, and a blank without width.
UNSEEN = "\N{ZERO WIDTH NO-BREAK SPACE}\N{ZERO WIDTH SPACE}"
# Lines that are looked at together.
PART = 500


Numbered = tuple[int, str]  # a line and its number in the file


class Layout(NamedTuple):
    """How a text file is written."""

    path: Path  # the file
    encoding: str
    delimiter: str  # a blank stands for any number of them
    header: list[str]  # names of columns; empty if there are none
    width: int  # number of columns
    begins: int  # number of the first line with a sample
    skip_blank: bool  # whether blank lines are the way it is written, and not samples that were lost
    style: Style  # how numbers are written
    stamps: dict[int, Clock]  # of the columns that hold time stamps
    sample_rate: float | None = None  # that lines above the rows state [Hz]
    units: Mapping[str, str] = MappingProxyType({})  # that such lines state, and the lines
    lines: Sequence[str] = ()  # above the rows
    cell_units: Mapping[int, str] = MappingProxyType({})  # of columns whose cells hold one behind the number


def layout_of(path: Path) -> Layout:
    """Recognise the layout; ValueError if the file is no log, or its numbers can be read in two ways."""
    encoding = encoding_of(path)
    lines = itertools.chain.from_iterable(
        enumerate(text.split("\n"), first) for first, text, _ in chunks(path, encoding, 1000)
    )
    head: list[Numbered] = []
    comments: list[Numbered] = []
    for place, line in itertools.islice(lines, HEAD_LINES):
        (comments if is_comment(line) else head).append((place, line))
    filled = [(place, line) for place, line in head if line.strip()]
    if not filled:
        raise LogError(f"{path}: the file is empty")
    check_table(path, filled[0][1].strip())
    between = sum(filled[0][0] < place < filled[-1][0] for place, line in head if not line.strip())
    delimiter, header, rows = _table(path, filled)
    if not rows:
        raise LogError(f"{path}: no rows below the header")
    above = [line for place, line in comments if place < rows[0][0]]
    preamble = _lines_of_cells(path, filled[: len(filled) - len(rows)][:LONGEST_PREAMBLE])
    if not header:
        header = _named_in_comments(path, above, rows[0][1], delimiter)
    elif below := [line for place, line in comments if filled[-len(rows) - 1][0] < place < rows[0][0]]:
        header = with_units(header, _titles(path, bare(below[-1]), delimiter, len(header))) or header
    cell_units = {i: unit for i, cell in enumerate(_cells(path, rows[0][1])) if (unit := split_cell(cell)[1])}
    header = [titled(name, cell_units.get(i, "")) for i, name in enumerate(header)]
    header = scopes.with_stated_units(header, preamble)
    said = [*above, *map(" ".join, preamble)]
    header, units = with_stated_units(header, said)
    texts = [line for _, line in rows]
    stamps: dict[int, Clock] = {}
    if any(map(MAYBE_STAMP.search, texts[:STAMP_ROWS])):
        for row in split(path, texts[:STAMP_ROWS], delimiter):
            for i, cell in enumerate(row):
                if i not in stamps and is_stamp(cell):
                    stamps[i] = Clock.of(cell)
    width, skip_blank = len(header or _cells(path, texts[0])), between > MOST_BLANK * len(filled)
    style = _style(path, _without_footer(texts, delimiter), delimiter)
    begins = rows[0][0]
    rate = rate_in([*above, *entries_in(preamble), *scopes.entries(preamble)], style)
    return Layout(
        path, encoding, delimiter, header, width, begins, skip_blank, style, stamps, rate, units, said,
        cell_units,
    )  # fmt: skip


def _delimiter(line: str) -> str:
    return next((mark for mark in ";\t,|" if mark in line), " ")


def _cells(path: Path, line: str) -> list[str]:
    return [cell.strip().strip(UNSEEN) for cell in split(path, [line], _delimiter(line))[0]]


def _lines_of_cells(path: Path, lines: list[Numbered]) -> list[list[str]]:
    return [_cells(path, line) for _, line in lines if line.count('"') % 2 == 0]


def _table(path: Path, filled: list[Numbered]) -> tuple[str, list[str], list[Numbered]]:
    """Delimiter, header and rows; instruments may have written other lines above, units below the header."""
    first, mark = _cells(path, filled[0][1]), _delimiter(filled[0][1])
    head = _lines_of_cells(path, filled[:LONGEST_PREAMBLE])
    if (known := scopes.heading(head)) is not None:
        return mark, known[0], filled[known[1] :]
    pairs = enumerate(itertools.pairwise(head))
    begins = next((k for k, rows in pairs if len(rows[0]) == len(rows[1]) > 1 and _numeric(*rows)), 0)
    like_first = len(head[begins]) == len(first) and _delimiter(filled[begins][1]) == mark
    like_first &= begins < 2 or names_columns(first) or not names_columns(head[begins - 1])
    if begins < 2 or like_first or len(head) < min(len(filled), LONGEST_PREAMBLE):
        return _headed_by_first(path, filled, head)
    upper, lower = head[begins - 2 : begins]
    header = _of_several([upper, lower]) or lower
    if len(header) != len(head[begins]):
        # Nothing says what is what: columns go by their numbers.
        header = [str(k + 1) for k in range(len(head[begins]))]
    return _delimiter(filled[begins][1]), header, filled[begins:]


def _headed_by_first(
    path: Path, filled: list[Numbered], head: list[list[str]]
) -> tuple[str, list[str], list[Numbered]]:
    """Delimiter, header and rows where nothing stands above the header, or rows begin at once."""
    first, mark = head[0], _delimiter(filled[0][1])
    header, begins = ([], 0) if _is_row_of_numbers(first) else (first, 1)
    if (counted := counted_names(first, head[1:2])) is not None:
        header, begins = counted, 1
    if header and len(head) > 1:
        # Numbers with decimal commas may be parted by blanks, and rows otherwise than names.
        mark = mark if len(header) != len(head[1]) else _delimiter(filled[1][1])
        second = split(path, [filled[1][1]], mark)[0] if mark == " " else head[1]
        if len(header) != len(second):
            header = _titles(path, filled[0][1], mark, len(second))
    if header and _counts(row[0] for row in head[1:3]) and len(head[1]) == len(first) + 1:
        # R and pandas write no name above their column of numbers.
        header = ["", *first]
    rows = (k for k, row in enumerate(head) if k > 0 and any(map(_is_value, row)))
    above = head[: next(rows, 1)] if header else []
    several = _of_several(above) if 1 < len(above) <= LONGEST_HEADER else []
    if several:
        header, begins = several, len(above)
    return mark, header, filled[begins:]


def _counts(cells: Iterable[str]) -> bool:
    """Whether cells number their rows, from 0 or 1."""
    return list(cells) in (["0", "1"], ["1", "2"])


def _is_value(cell: str) -> bool:
    """Whether a cell is a number, and not missing."""
    return is_number(cell) and not is_missing(cell)


def _of_several(lines: list[list[str]]) -> list[str]:
    """Header of several lines: names, units, and others that say something else; none if it is not clear."""
    # Whole numbers may be those of channels.
    values = (cell for cell in itertools.chain(*lines) if _is_value(cell) and not cell.isdigit())
    if len(set(map(len, lines))) > 1 or any(values):
        return []
    units = next((line for line in lines if with_units([""] * len(line), line)), None)
    rest = [line for line in lines if line is not units]
    if not rest or any(map(quantity_of_unit, itertools.chain(*rest))):
        return []
    names = next(filter(names_columns, rest), rest[0])
    # The names of a group stand above them.
    others = [line for line in rest if line is not names]
    plain = [name or next(filter(None, above), "") for name, *above in zip(names, *others, strict=True)]
    return with_units(plain, units) if units else plain


def _named_in_comments(path: Path, comments: list[str], row: str, delimiter: str) -> list[str]:
    """Names of columns: one a comment, or all in the last one that has names, perhaps with units below."""
    width = len(split(path, [row], delimiter)[0])
    if len(numbered := numbered_names(comments)) == width:
        return numbered
    below: list[str] = []
    for line in reversed(comments):
        for text in (bare(line), _list_in(bare(line))):
            names = _titles(path, text, delimiter, width)
            for found in (with_units(names, below), names):
                if len(found) == width and (names_columns(found) or names_other_order(found)):
                    return found
        below = names
    return _unknown_names(path, comments, width)


def _list_in(comment: str) -> str:
    """Names in a comment, without what a program wrote around them: ``columns: ['time', 'x']``."""
    found = LIST.fullmatch(comment)
    return re.sub("['\"]", "", found[1] or found[2]) if found else comment


def _unknown_names(path: Path, comments: list[str], width: int) -> list[str]:
    """Cells of the last comment that may be names, as no numbers and no sentence: better ask than guess."""
    said = _list_in(bare(comments[-1])) if comments else ""
    if not said.strip() or (_delimiter(said) == " " and not _has_names(said)):
        return []
    cells = _cells(path, said)
    words = {word.lower() for cell in cells for word in cell.split()}
    short = all(0 < len(cell) <= LONGEST_NAME and not is_number(cell) for cell in cells)
    return cells if len(cells) == width and short and LITTLE_WORDS.isdisjoint(words) else []


def _has_names(text: str) -> bool:
    """Whether a word is a name of a quantity or of a channel, and not all are single letters."""
    words = text.lower().split()
    known = any(quantities_called(word) or re.fullmatch(r"ch\d+", word) for word in words)
    return known and max(map(len, words)) > 1


def _titles(path: Path, line: str, delimiter: str, width: int) -> list[str]:
    """Names of columns in a line, parted as the rows are or in another way that gives as many, known ones."""
    text = line.strip()
    ways = [split(path, [text], mark)[0] for mark in (delimiter, _delimiter(text))]
    # Names may hold single blanks, as in ``time (s)``.
    ways += [re.split(r"\s+(?![(\[])", text), re.split(r"\s{2,}|\t", text), re.findall(WITH_UNIT, text)]
    fit = [[cell.strip() for cell in way] for way in ways if len(way) == width]
    return next(filter(names_columns, fit), fit[0] if fit else ways[0])


def is_row(line: str, delimiter: str) -> bool:
    """Whether a line begins with a number, as rows do."""
    return is_number(first_cell(line, delimiter))


def first_cell(line: str, delimiter: str) -> str:
    """First cell of a line."""
    return line.strip(" ").split(None if delimiter == " " else delimiter, 1)[0].strip(' "')


def _without_footer(lines: list[str], delimiter: str) -> list[str]:
    """Lines but the last ones that are no rows; all of them if they are many."""
    before, last = lines[:-LONGEST_FOOTER], lines[-LONGEST_FOOTER:]
    return before + last[: end_of_rows(last, lambda line: is_row(line, delimiter)) or len(last)]


def _is_row_of_numbers(cells: list[str]) -> bool:
    """Whether all cells are numbers, or most beside a text behind them."""
    known = [is_number(cell) for cell in cells]
    return all(known) or (known[0] and cells[0] != "" and 2 * sum(known) > len(cells))


def _numeric(*rows: list[str]) -> bool:
    return all(all(map(is_number, row)) and any(map(_is_value, row)) for row in rows)


def _style(path: Path, lines: list[str], delimiter: str) -> Style:
    # Where commas stand between numbers, one with a comma has quotation marks.
    points, commas = (any(mark in line for line in lines) for mark in (".", '"' if delimiter == "," else ","))
    if not points and not commas:
        # Without any mark in the beginning, either may come later.
        return Style("." if delimiter == "," else ".,")
    try:
        style = Style(".")
        if commas:
            style = style_of(cell for row in split(path, lines, delimiter) for cell in row)
        if not style.thousands:
            check_columns(path, lines, delimiter, defaultdict(Marks))
        return style
    except LogError:
        raise
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None


def check_columns(path: Path, lines: list[str], delimiter: str, columns: defaultdict[int, Marks]) -> None:
    """Refuse columns whose numbers can be read in two ways; in parts, which need less memory."""
    for start in range(0, len(lines), PART):
        for row in split(path, lines[start : start + PART], delimiter):
            for i, cell in enumerate(row):
                columns[i].see(cell)
    try:
        for column in columns.values():
            column.check()
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None


def split(path: Path, lines: list[str], delimiter: str) -> list[list[str]]:
    """Cells of lines; ValueError if they are no table."""
    if delimiter == " ":
        return [line.split() for line in lines]
    try:
        rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=False))
    except csv.Error as error:
        raise LogError(f"{path}: cannot be read as a table: {error}") from None
    if len(rows) != len(lines) or (len(lines) == 1 and lines[0].count('"') % 2):
        raise LogError(f"{path}: a quotation mark is left open")
    return rows
