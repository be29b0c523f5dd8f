"""An identification on a terminal, within 80 columns."""

from __future__ import annotations

from typing import Any

from piezoest._tables import print_cells, say
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
    say(console, f"{found.source}: {log_sentence(found)}")
    rows = [each.cells() for each in compared(found)]
    print_cells(console, "Free-running error [µm]", ("model", "n", *ERRORS), rows)
    print_cells(
        console,
        f"Model: {label_of(found)}",
        ("parameter", "value", "± standard error", "unit"),
        parameter_cells(found),
        texts=(0, 3),
    )
    if isinstance(found, Identification) and found.validations:
        titles = ("log", "rms", "largest", "rms without mean")
        print_cells(console, "Error on other logs [µm]", titles, validation_cells(found))
    say(console, *filter(None, (reason_sentence(found), residual_sentence(found))))
    say(console, *(f"• {remark}" for remark in remarks(found)))
