"""An identification on a terminal, within 80 columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from piezoest.identification.compared import (
    Found,
    compared,
    label_of,
    log_sentence,
    parameter_cells,
    reason_sentence,
    remarks,
    residual_sentence,
    validation_cells,
)
from piezoest.identification.result import Identification

ERRORS = ("fitted\nrms", "blocks\nleft out", "held out\nrms", "held out\nlargest")


def print_identification(found: Found, console: Any) -> None:
    """Print the kinds compared, the parameters of the one to use, and how far to trust it."""
    _say(console, f"{found.source}: {log_sentence(found)}")
    rows = [each.cells() for each in compared(found)]
    _print_table(console, "Free-running error [µm]", ("model", "n", *ERRORS), rows)
    _print_table(
        console,
        f"Model: {label_of(found)}",
        ("parameter", "value", "± standard error", "unit"),
        parameter_cells(found),
        texts=(0, 3),
    )
    if isinstance(found, Identification) and found.validations:
        titles = ("log", "rms", "largest", "rms without mean")
        _print_table(console, "Error on other logs [µm]", titles, validation_cells(found))
    for sentence in (reason_sentence(found), residual_sentence(found)):
        if sentence:
            _say(console, sentence)
    for remark in remarks(found):
        _say(console, f"• {remark}")


def _say(console: Any, sentence: str) -> None:
    console.print(sentence, highlight=False, markup=False, soft_wrap=True)


def _print_table(
    console: Any,
    title: str,
    titles: Sequence[str],
    rows: Iterable[Sequence[str]],
    texts: Sequence[int] = (0,),
) -> None:
    """A table of figures; columns of text are flush left."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title)
    for i, each in enumerate(titles):
        left = i in texts
        # Names of files may be long: they are folded, figures are not.
        table.add_column(each, justify="left" if left else "right", no_wrap=not left, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    console.print(table)
