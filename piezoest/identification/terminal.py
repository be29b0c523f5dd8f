"""An identification on a terminal, within 80 columns."""

from __future__ import annotations

from typing import Any

from piezoest._tables import print_cells, say
from piezoest.identification import compared


def print_identification(found: compared.Found, console: Any) -> None:
    """Print the kinds compared, the parameters of the one to use, and how far to trust it."""
    say(console, f"{found.source}: {compared.log_sentence(found)}")
    for table in compared.tables(found):
        print_cells(console, *table)
    say(console, *filter(None, (compared.reason_sentence(found), compared.residual_sentence(found))))
    say(console, *(f"• {remark}" for remark in compared.remarks(found)))
