"""An identification in rows and sentences, as a terminal and a page show them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from piezoest.fitting import FORMS
from piezoest.identification.residual import Misfit
from piezoest.identification.result import Identification
from piezoest.identification.streamed import StreamedIdentification

Found = Identification | StreamedIdentification
# A value that ended at a bound of zero, as a delay does.
NEXT_TO_ZERO = 1e-9


class Compared(NamedTuple):
    """A kind of model beside the others; what is not known of it is None.

    Errors in µm; `left_out` is that on blocks left out of the fit, by which the kind was chosen.
    """

    label: str
    chosen: bool
    parameters: int | None
    train: Misfit | None
    left_out: float
    held_out: Misfit | None

    def cells(self) -> tuple[str, ...]:
        """Label, marked if it was chosen, parameters, and errors: fitted, left out, held out, largest."""
        errors = (
            None if self.train is None else self.train.rms,
            self.left_out,
            None if self.held_out is None else self.held_out.rms,
            None if self.held_out is None else self.held_out.max,
        )
        return (
            f"{'▸' if self.chosen else ' '} {self.label}",
            "" if self.parameters is None else f"{self.parameters}",
            *("" if error is None else f"{error:.3g}" for error in errors),
        )


def compared(found: Found) -> list[Compared]:
    """All kinds that were fitted, from the simplest to the richest."""
    if isinstance(found, Identification):
        return [
            Compared(
                item.label,
                item is found.best,
                item.parameters,
                item.train,
                item.cross_validated,
                item.held_out,
            )
            for item in found.candidates
        ]
    judged = {"line": (found.line_train, found.line_held_out), found.chosen: (found.train, found.held_out)}
    return [
        Compared(FORMS[name].label, name == found.chosen, None, train, left_out, held_out)
        for name, left_out in found.cross_validated.items()
        for train, held_out in (judged.get(name, (None, None)),)
    ]


def parameter_cells(found: Found) -> list[tuple[str, str, str, str]]:
    """Name, value, standard error and unit of each parameter."""
    return [
        (name, f"{_rounded(value):.6g}", f"{error:.2g}" if error > 0.0 else "–", unit)
        for name, value, error, unit in found.table()
    ]


def _rounded(value: float) -> float:
    return value if abs(value) > NEXT_TO_ZERO else 0.0


def validation_cells(found: Identification) -> list[tuple[str, ...]]:
    """Of each other log: name of the file, error rms, largest, and rms without its mean [µm]."""
    rows = []
    for each in found.validations:
        errors = (each.error.rms, each.error.max, each.without_mean.rms)
        rows.append((Path(each.source).name, *(f"{error:.3g}" for error in errors)))
    return rows


def label_of(found: Found) -> str:
    """Kind of the model in words."""
    return FORMS[found.chosen].label


def log_sentence(found: Found) -> str:
    """How long the log is, and how it was divided."""
    return (
        f"{found.samples} samples at {found.sample_rate:.6g} Hz, {found.trained} fitted, "
        f"{found.samples - found.trained} held out"
    )


def reason_sentence(found: Found) -> str:
    """Why this kind; empty where the table says all there is."""
    if isinstance(found, StreamedIdentification):
        return ""
    return f"{found.reason[:1].upper()}{found.reason[1:]}"


def residual_sentence(found: Found) -> str:
    """Whether the residual is white, with the figures; empty where that was not tested."""
    if isinstance(found, StreamedIdentification):
        return ""
    white = found.whiteness
    p_value = f"= {white.p_value:.2g}" if white.p_value > 1e-9 else "< 1e-9"
    return (
        f"Residual: {'white' if white.is_white else 'not white'} (Ljung-Box over {white.lags} lags: "
        f"p {p_value}; autocorrelation at lag 1: {white.first_autocorrelation:.2f})."
    )


def remarks(found: Found) -> tuple[str, ...]:
    """Notes on the log and advice, as sentences."""
    return (*(f"{note[:1].upper()}{note[1:]}." for note in found.notes), *found.advice)
