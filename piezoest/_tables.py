"""What commands print: tables of figures, and sentences as they are."""

from collections.abc import Callable, Container, Iterable, Sequence
from typing import Any


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
