"""What an identification found, as numbers, text, dictionary and figure."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting import Fit, Prediction
from piezoest.fitting.flaws import Flaws
from piezoest.fitting.outliers import unsettled
from piezoest.identification.candidate import Candidate
from piezoest.identification.data import judged
from piezoest.identification.finding import Finding
from piezoest.identification.interval import interval
from piezoest.identification.residual import Misfit, Whiteness
from piezoest.identification.told import Kind, Row, figures_of, parameter_rows
from piezoest.models import LearntOn, Model
from piezoest.records import Record
from piezoest.records.source import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from piezoest.identification.drawing import Drawn


class Validation(NamedTuple):
    """Error of a model on another log, from where the start has settled; with and without its mean."""

    source: str  #: File or name of the other log.
    error: Misfit  #: What the model misses there.
    without_mean: Misfit  #: The same without its mean: the zero of a sensor is often another one.

    @classmethod
    def of(cls, fit: Fit, other: Record, flaws: Flaws) -> Validation:
        """Judge a fit on another record with these flaws."""
        expected = fit.elsewhere(flaws.without(other.voltage), sample_rate=other.sample_rate)
        error = np.where(judged(other, flaws), other.displacement, np.nan) - expected
        error[: unsettled(error - np.nanmedian(error))] = np.nan
        return cls(other.source, Misfit.of(error), Misfit.of(error - np.nanmean(error)))

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary."""
        return {
            "source": self.source,
            "error": self.error.to_dict(),
            "without_mean": self.without_mean.to_dict(),
        }


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """A model identified from a record, and its accuracy.

    Parameters
    ----------
    best : Candidate
        The model to use.
    candidates : tuple of Candidate
        All that were fitted, from the simplest to the richest; the straight line is always one of them.
    reason : str
        Why that one, with the figures.
    whiteness : Whiteness
        Of the residual of the fitted part.
    noise_floor : float
        Noise of the displacement [µm rms], from periods that the voltage repeats, else from differences of
        neighbouring samples.
    drift : float
        Slope of the residual in time, over the whole record [µm].
    delay_known : bool
        Whether the delay was given, or the log can tell it from the width of the loop.
    creep_known : bool
        Whether the log can tell creep from a wider loop.
    trained : int
        Number of samples in the fitted part, which comes first.
    record : Record
        What was identified.
    findings : tuple of Finding
        What is odd about the log.
    flaws : Flaws
        Spikes, jumps, dropouts and rests.
    learnt_on : LearntOn
        Ranges that the model was learnt on.
    validations : tuple of Validation
        Other logs, predicted.
    advice : tuple of str
        What to know before using it, in plain sentences.

    Examples
    --------
    >>> import piezoest as pz
    >>> found = pz.identify(pz.records.example_log())
    >>> found.chosen, bool(found.held_out.rms < 0.3), found.delay_known
    ('plays-asymmetric-creep', True, True)
    """

    best: Candidate
    candidates: tuple[Candidate, ...] = field(repr=False)
    reason: str
    whiteness: Whiteness
    noise_floor: float
    drift: float
    delay_known: bool
    creep_known: bool
    trained: int
    record: Record = field(repr=False)
    findings: tuple[Finding, ...]
    flaws: Flaws = field(repr=False)
    learnt_on: LearntOn
    validations: tuple[Validation, ...] = ()
    advice: tuple[str, ...] = ()

    @property
    def fit(self) -> Fit:
        """Fit of the best model."""
        return self.best.fit

    @property
    def model(self) -> Model:
        """The model, with offset."""
        return self.best.model

    @property
    def chosen(self) -> str:
        """Kind of the model, as `piezoest.fit` names it."""
        return self.fit.form

    @property
    def standard_errors(self) -> dict[str, float]:
        """Of parameters, offset and delay; zero if a value was given or is at a bound."""
        return self.fit.standard_errors

    @property
    def initial_state(self) -> Any:
        """Initial state for `model.simulate` on this record."""
        return self.fit.initial_state

    @property
    def delay(self) -> float:
        """Samples by which the displacement lags the voltage."""
        return self.fit.delay

    @property
    def delay_estimated(self) -> bool:
        """Whether the delay was estimated."""
        return self.fit.delay_estimated

    @property
    def left_out(self) -> int:
        """Samples at the start that the fit leaves out, because the stage had not settled."""
        return self.fit.left_out

    @property
    def train(self) -> Misfit:
        """Error of the simulated displacement on the fitted part."""
        return self.best.train

    @property
    def held_out(self) -> Misfit:
        """Error of the simulated displacement on the held-out part."""
        return self.best.held_out

    @property
    def line(self) -> Model:
        """The best straight line on the same samples, with the same delay."""
        return self.candidates[0].model

    @property
    def line_train(self) -> Misfit:
        """Error of the straight line on the fitted part."""
        return self.candidates[0].train

    @property
    def line_held_out(self) -> Misfit:
        """Error of the straight line on the held-out part."""
        return self.candidates[0].held_out

    @property
    def prediction(self) -> FloatArray:
        """Simulated displacement [µm], shape (N,)."""
        return self.best.prediction.x

    @property
    def residual(self) -> FloatArray:
        """Measured displacement less prediction [µm], shape (N,); NaN where a sample is missing or flawed."""
        return self.best.residual

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

    def predict(self, u: FloatArray | None = None) -> Prediction:
        """Displacement that the model expects, and bounds between which 95 of 100 readings are expected.

        Kinds that predict about as well may be right: the interval is wider by how far they differ. Kinds
        that predict worse widen it only where they differ by more than anywhere in the fitted part.

        Parameters
        ----------
        u : array_like, shape (N,), optional
            Voltage [V]; by default this record's. Before another one the stage rests at 0 V, and the sensor
            has the zero of this record: a shift by another history or day is not in the interval.
        """
        return interval(self.best, self.candidates, u)

    def compare(self, *others: Identification) -> str:
        """Return a table of errors [µm rms] of this and other identifications, of the same log or of others.

        Parameters
        ----------
        *others : Identification
            What to compare with.
        """
        heads = ("log", "model", "held out [µm rms]", "choice [µm rms]", "noise [µm rms]")
        rows: list[tuple[str, ...]] = [heads]
        for each in (self, *others):
            figures = (each.held_out.rms, each.best.cross_validated, each.noise_floor)
            rows.append((Path(each.source).name, each.best.label, *(f"{value:.3g}" for value in figures)))
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        return "\n".join(
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
            for row in rows
        )

    def table(self) -> list[Row]:
        """Rows of parameter name, value, standard error and unit."""
        return parameter_rows(self.model, self.delay, self.standard_errors)

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary; the model under ``"model"`` is that of the model's `to_dict`."""
        state = self.initial_state
        return {
            "format": "piezoest-identification-2",
            **figures_of(self),
            "skipped_rows": self.record.skipped,
            "reason": self.reason,
            "candidates": [each.to_dict() for each in self.candidates],
            "standard_errors": dict(self.standard_errors),
            "initial_state": state.tolist() if isinstance(state, np.ndarray) else state,
            "delay_estimated": self.delay_estimated,
            "delay_known": self.delay_known,
            "creep_known": self.creep_known,
            "noise_floor_um": self.noise_floor,
            "interval_um": self.fit.spread.within,
            "whiteness": self.whiteness.to_dict(),
            "drift_um": self.drift,
            "validation": [each.to_dict() for each in self.validations],
            "findings": [dataclasses.asdict(each) for each in self.findings],
            "solver": self.fit.solver,
        }

    def __repr__(self) -> str:
        return (
            f"<Identification of {Path(self.source).name}: {self.best.label}, "
            f"{self.held_out.rms:.3g} µm rms held out (straight line {self.line_held_out.rms:.3g}), "
            f"{counted(len(self.advice), 'remark')}>"
        )

    def __str__(self) -> str:
        return self.report()

    def report(self) -> str:
        """Return parameters, errors and advice as text."""
        parameters = (
            f"{name:>8} {value:12.6g}{f' ± {error:.2g}' if error > 0.0 else ''} {unit}"
            for name, value, error, unit in self.table()
        )
        kinds = (
            f"{each.label:>28}: {each.held_out.rms:.4g} µm held out, {each.cross_validated:.4g} in the choice"
            for each in self.candidates
        )
        return "\n".join([repr(self)[1:-1], *parameters, *kinds, self.reason, *self.advice])

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """All kinds that were fitted, from the simplest to the richest, as tables and figures show them."""
        return tuple(
            Kind(one.label, one is self.best, one.cross_validated, one.parameters, one.train, one.held_out)
            for one in self.candidates
        )

    def drawn(self) -> Drawn:
        """What figures show of it."""
        from piezoest.identification.drawing import Drawn

        expected = self.predict()
        return Drawn(
            source=self.source, label=self.best.label, errors=(self.held_out, self.line_held_out),
            record=self.record, prediction=self.prediction, residual=self.residual, left_out=self.left_out,
            trained=self.trained, expected=(expected.lower - expected.x, expected.upper - expected.x),
            kinds=self.kinds,
        )  # fmt: skip

    def plot(self) -> Figure:
        """Draw displacement and model over time, the loop, the residual and its autocorrelation."""
        from piezoest.identification.drawing import draw

        return draw(self.drawn())
