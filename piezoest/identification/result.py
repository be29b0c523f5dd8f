"""What an identification found, as numbers, text, dictionary and figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from piezoest._checks import FloatArray
from piezoest.identification.residual import Misfit, Whiteness
from piezoest.models import ColemanHodgdon, LinearGain
from piezoest.records import Record

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def parameter_rows(
    model: ColemanHodgdon, delay: float, errors: Mapping[str, float]
) -> list[tuple[str, float, float, str]]:
    """Rows of parameter name, value, standard error (zero if it was not estimated) and unit."""
    names = (*model.parameter_names, "offset", "delay")
    units = (*model.parameter_units, "µm", "samples")
    values = (*(float(value) for value in model.theta), model.offset, delay)
    return [
        (name, value, errors.get(name, 0.0), unit)
        for name, value, unit in zip(names, values, units, strict=True)
    ]


def misfits_to_dict(found: Any) -> dict[str, Any]:
    """Errors of a model and of the straight line beside it, JSON-safe."""
    return {
        "train": found.train.to_dict(),
        "held_out": found.held_out.to_dict(),
        "straight_line": {
            "model": found.line.to_dict(),
            "train": found.line_train.to_dict(),
            "held_out": found.line_held_out.to_dict(),
        },
    }


@dataclass(frozen=True, slots=True)
class Identification:
    """A model identified from a record, and how far to trust it.

    Parameters
    ----------
    model : ColemanHodgdon
        Admissible, with offset.
    standard_errors : dict of str to float
        Of alpha, beta, gamma, offset and delay, in their units. Zero where a value was given or lies on
        the edge of what is allowed. From the Jacobian of the free-running error, widened for coloured
        residuals by the sum of its gradients over 25 blocks in time.
    initial_state : float
        w_h at the first sample [µm].
    delay : float
        Samples by which the displacement lags the voltage.
    delay_estimated : bool
        Whether the delay was estimated or given.
    train, held_out : Misfit
        Free-running error of the model on the part it was fitted on and on the part held out: it sees
        only the voltage, and its state runs on from the first sample to the last.
    line : LinearGain
        The best straight line on the same samples, with the same delay, for comparison.
    line_train, line_held_out : Misfit
        Its errors.
    whiteness : Whiteness
        Of the residual of the fitted part.
    drift : float
        Slope of the residual in time, over the whole record [µm].
    left_out : int
        Samples at the start that the fit leaves out, because the stage had not settled.
    trained : int
        Number of samples in the fitted part, which comes first.
    prediction : ndarray, shape (N,)
        Free-running displacement [µm].
    record : Record
        What was identified.
    advice : tuple of str
        What to know before using it, in plain sentences.
    """

    model: ColemanHodgdon
    standard_errors: dict[str, float]
    initial_state: float
    delay: float
    delay_estimated: bool
    train: Misfit
    held_out: Misfit
    line: LinearGain
    line_train: Misfit
    line_held_out: Misfit
    whiteness: Whiteness
    drift: float
    left_out: int
    trained: int
    prediction: FloatArray = field(repr=False)
    record: Record = field(repr=False)
    advice: tuple[str, ...] = ()

    @property
    def residual(self) -> FloatArray:
        """Measured displacement less prediction [µm], shape (N,); NaN where a sample is missing."""
        return self.record.displacement - self.prediction

    @property
    def source(self) -> str:
        """Where the record comes from."""
        return self.record.source

    @property
    def samples(self) -> int:
        """Number of samples of the record."""
        return len(self.record)

    @property
    def sample_rate(self) -> float:
        """Of the record [Hz]."""
        return self.record.sample_rate

    @property
    def notes(self) -> tuple[str, ...]:
        """What had to be assumed or converted to read the log, in plain sentences."""
        return self.record.notes

    def table(self) -> list[tuple[str, float, float, str]]:
        """Rows of parameter name, value, standard error and unit."""
        return parameter_rows(self.model, self.delay, self.standard_errors)

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary; the model under ``"model"`` is that of `ColemanHodgdon.to_dict`."""
        return {
            "format": "piezoest-identification-1",
            "source": self.record.source,
            "samples": len(self.record),
            "skipped_rows": self.record.skipped,
            "sample_rate_Hz": self.record.sample_rate,
            "model": self.model.to_dict(),
            "standard_errors": dict(self.standard_errors),
            "units": {name: unit for name, _, _, unit in self.table()},
            "initial_state_um": self.initial_state,
            "delay_samples": self.delay,
            "delay_estimated": self.delay_estimated,
            "trained_samples": self.trained,
            "left_out_samples": self.left_out,
            **misfits_to_dict(self),
            "whiteness": self.whiteness.to_dict(),
            "drift_um": self.drift,
            "notes": list(self.record.notes),
            "advice": list(self.advice),
        }

    def __str__(self) -> str:
        lines = [f"{name:>8} {value:12.6g} ± {error:.2g} {unit}" for name, value, error, unit in self.table()]
        for name, held in (("free-running error", self.held_out), ("straight line", self.line_held_out)):
            lines.append(f"{name}, held out: {held.rms:.4g} µm rms, {held.max:.4g} µm largest")
        return "\n".join([*lines, *self.advice])

    def plot(self) -> Figure:
        """Draw displacement and model over time, the loop, the residual and its autocorrelation.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from piezoest.identification.drawing import draw

        return draw(self)
