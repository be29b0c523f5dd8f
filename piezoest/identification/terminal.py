"""What an identification found, for the terminal."""

from __future__ import annotations

from typing import Any

from piezoest.identification.choice import ModelChoice
from piezoest.identification.result import Identification
from piezoest.identification.streamed import StreamedIdentification


def print_choice(found: ModelChoice, console: Any) -> None:
    """Print a row for each kind of model, and the reason for the choice.

    Parameters
    ----------
    found : ModelChoice
        What to print.
    console : rich.console.Console
        To print on.
    """
    from rich.table import Table

    console.print(found.base.record.source, highlight=False, markup=False, soft_wrap=True)
    table = Table(title="Free-running error [µm]")
    for title in ("", "model", "n", "fitted rms", "held out rms", "largest", "BIC"):
        left = title in ("", "model")
        table.add_column(title, justify="left" if left else "right", no_wrap=left)
    for item in found.candidates:
        errors = (item.train.rms, item.held_out.rms, item.held_out.max)
        cells = (f"{item.parameters}", *(f"{value:.4g}" for value in errors), f"{item.bic:.0f}")
        table.add_row("▸" if item is found.best else "", item.name, *cells)
    console.print(table)
    console.print(found.reason, highlight=False, markup=False, soft_wrap=True)


def print_identification(found: Identification | StreamedIdentification, console: Any) -> None:
    """Print parameters with errors, the free-running error beside a straight line's, and the advice.

    Parameters
    ----------
    found : Identification or StreamedIdentification
        What to print.
    console : rich.console.Console
        To print on.
    """
    from rich.table import Table

    console.print(
        f"{found.source}: {found.samples} samples at {found.sample_rate:.6g} Hz, {found.trained} fitted, "
        f"{found.samples - found.trained} held out",
        highlight=False, markup=False, soft_wrap=True,
    )  # fmt: skip
    parameters = Table(title="Coleman-Hodgdon model")
    for title in ("parameter", "value", "± standard error", "unit"):
        parameters.add_column(title, justify="right" if title in ("value", "± standard error") else "left")
    for name, value, error, unit in found.table():
        parameters.add_row(name, f"{value:.6g}", f"{error:.2g}" if error > 0.0 else "not estimated", unit)
    console.print(parameters)
    errors = Table(title="Free-running error [µm]")
    for title in ("", "fitted rms", "held out rms", "held out largest"):
        errors.add_column(title, justify="right" if title else "left")
    for name, fitted, held in (
        ("model", found.train, found.held_out),
        ("straight line, same lag", found.line_train, found.line_held_out),
    ):
        errors.add_row(name, *(f"{value:.4g}" for value in (fitted.rms, held.rms, held.max)))
    console.print(errors)
    for sentence in (residual_sentence(found), *(f"• {said}" for said in remarks(found))):
        if sentence:
            console.print(sentence, highlight=False, markup=False, soft_wrap=True)


def residual_sentence(found: Identification | StreamedIdentification) -> str:
    """Whether the residual is white, with the figures; empty where that was not tested."""
    if isinstance(found, StreamedIdentification):
        return ""
    white = found.whiteness
    p_value = f"= {white.p_value:.2g}" if white.p_value > 1e-9 else "< 1e-9"
    return (
        f"Residual: {'white' if white.is_white else 'not white'} (Ljung-Box over {white.lags} lags: "
        f"p {p_value}; autocorrelation at lag 1: {white.first_autocorrelation:.2f})"
    )


def remarks(found: Identification | StreamedIdentification) -> tuple[str, ...]:
    """Notes on the log and advice, as sentences."""
    return (*(f"{note[:1].upper()}{note[1:]}." for note in found.notes), *found.advice)
