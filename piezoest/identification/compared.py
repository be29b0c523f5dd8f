"""An identification in tables and sentences, as a terminal and a page show them."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from piezoest._tables import print_cells, say
from piezoest.fitting import FORMS
from piezoest.identification.result import Identification
from piezoest.identification.streamed import StreamedIdentification

Found = Identification | StreamedIdentification
# A value that ended at a bound of zero, as a delay does, is zero.
NEXT_TO_ZERO = 1e-9


class Table(NamedTuple):
    """Cells with a title and a heading; the first column is text."""

    title: str
    heading: Sequence[str]
    rows: Sequence[Sequence[str]]


def tables(found: Found) -> Iterator[Table]:
    """The kinds that were fitted, the parameters of the one to use, and its errors on other logs, if any."""
    errors = ("fitted\nrms", "choice", "held out\nrms", "held out\nlargest")
    kinds = [kind.cells() for kind in found.kinds]
    yield Table("Error of the simulated displacement [µm]", ("model", "n", *errors), kinds)
    parameters = [
        (name, f"{value * (abs(value) > NEXT_TO_ZERO):.6g}", f"{error:.2g}" if error > 0.0 else "–", unit)
        for name, value, error, unit in found.table()
    ]
    heading = ("parameter", "value", "± standard error", "unit")
    yield Table(f"Model: {FORMS[found.chosen].label}", heading, parameters)
    others = []
    for each in found.validations:
        figures = (each.error.rms, each.error.max, each.without_mean.rms)
        others.append((Path(each.source).name, *(f"{figure:.3g}" for figure in figures)))
    if others:
        yield Table("Error on other logs [µm]", ("log", "rms", "largest", "rms without mean"), others)


def log_sentence(found: Found) -> str:
    """How long the log is, and how it was divided."""
    return (
        f"{found.samples} samples at {found.sample_rate:.6g} Hz, {found.trained} fitted, "
        f"{found.samples - found.trained} held out"
    )


def reason_sentence(found: Found) -> str:
    """Why this kind; empty where the table says all there is."""
    return f"{found.reason[:1].upper()}{found.reason[1:]}"


def residual_sentence(found: Found) -> str:
    """Whether the residual is white, with the figures; empty where that was not tested."""
    white = found.whiteness
    if white is None:
        return ""
    p_value = f"= {white.p_value:.2g}" if white.p_value > 1e-9 else "< 1e-9"
    return (
        f"Residual: {'white' if white.is_white else 'not white'} (Ljung-Box over {white.lags} lags: "
        f"p {p_value}; autocorrelation at lag 1: {white.first_autocorrelation:.2f})."
    )


def remarks(found: Found) -> tuple[str, ...]:
    """Notes on the log and advice, as sentences."""
    return (*(f"{note[:1].upper()}{note[1:]}." for note in found.notes), *found.advice)


def print_identification(found: Found, console: Any) -> None:
    """Print the kinds compared, the parameters of the one to use, and how far to trust it."""
    say(console, f"{found.source}: {log_sentence(found)}")
    for table in tables(found):
        print_cells(console, *table)
    say(console, *filter(None, (reason_sentence(found), residual_sentence(found))))
    say(console, *(f"• {remark}" for remark in remarks(found)))
