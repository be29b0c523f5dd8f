"""What commands print: tables of figures, and sentences as they are."""

import math
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from typing import Any

# What a table shows of a row under each heading: its value of that name, or what a function makes of it.
Columns = Mapping[str, str | Callable[[Any], Any]]


def say(console: Any, *sentences: str, style: str | None = None) -> None:
    """Print sentences on lines of their own, whatever signs are in them."""
    for sentence in sentences:
        console.print(sentence, style=style, highlight=False, markup=False, soft_wrap=True)


def print_cells(
    console: Any,
    title: str,
    heading: Sequence[str],
    body: Iterable[Sequence[Any]],
    *,
    texts: Container[int] = (0,),
    group: int = 0,
    style: Callable[[str], str] = lambda cell: "",
) -> None:
    """Print a table of figures; columns of text are flush left, a line is below each group of rows."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, show_edge=False)
    for k, name in enumerate(heading):
        # Names of files may be long: they are folded, figures are not.
        left = k in texts
        table.add_column(Text(name), justify="left" if left else "right", no_wrap=not left, overflow="fold")
    for k, cells in enumerate(body, 1):
        shown = (Text(str(cell), style(str(cell))) for cell in cells)
        table.add_row(*shown, end_section=group > 0 and k % group == 0)
    console.print(table)


def cells_of(rows: Iterable[Any], columns: Columns | None = None) -> tuple[list[str], list[list[Any]]]:
    """Heading and body of rows that are dictionaries; without columns, their names are the headings."""
    rows = list(rows)
    if columns is None:
        columns = {name: name for name in rows[0]} if rows else {}
    body = [[row[what] if isinstance(what, str) else what(row) for what in columns.values()] for row in rows]
    return list(columns), body


def print_rows(console: Any, title: str, rows: Iterable[Any], columns: Columns | None = None) -> None:
    """Print rows that are dictionaries; columns whose cells are all words are flush left."""
    heading, body = cells_of(rows, columns)
    texts = [k for k in range(len(heading)) if all(isinstance(row[k], str) for row in body)]
    print_cells(console, title, heading, [list(map(shown, row)) for row in body], texts=(0, *texts))


def number(value: float | None, digits: int = 3) -> str:
    """Significant digits as a plain number; a dash for what is not known or infinite."""
    if value is None or not math.isfinite(value):
        return "—"
    if value == 0.0:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def shown(value: Any) -> str:
    """A number with three digits; a dash for none, yes and no."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(value) if value is None or isinstance(value, float) else str(value)
