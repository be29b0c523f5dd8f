"""A log larger than memory to a model: recursive least squares in one pass, judged in another."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from piezoest._checks import FloatArray, fraction
from piezoest.compile import Vector, compiled
from piezoest.equations.coleman_hodgdon import hysteresis_step
from piezoest.estimators.rls import HysteresisRLS
from piezoest.identification.data import check_excitation, noise_of, prepare
from piezoest.identification.procedure import FEWEST_SAMPLES, LONGEST_DELAY, identify
from piezoest.identification.residual import Misfit
from piezoest.identification.result import misfits_to_dict, parameter_rows
from piezoest.models import ColemanHodgdon, LinearGain, Model
from piezoest.records import Record, RecordStream

# Samples at the start that are looked at as a whole: for the delay, the noise and the first guess.
HEAD = 50_000
# Points kept for figures.
MOST_POINTS = 20_000


@dataclass(frozen=True, slots=True)
class StreamedIdentification:
    """A model identified block by block from a log of any length.

    Parameters
    ----------
    model : ColemanHodgdon
        Admissible, with offset.
    standard_errors : dict of str to float
        Of alpha, beta and gamma, in their units, for white noise in the displacement: what the model
        cannot do is not in them.
    delay : float
        Samples by which the displacement lags the voltage.
    train, held_out : Misfit
        Free-running error of the model on the part it was fitted on and on the part held out.
    line : LinearGain
        A straight line of the same offset and of the gain that suits the fitted part's start, for comparison.
    line_train, line_held_out : Misfit
        Its errors.
    samples, trained, skipped : int
        Samples of the log, of the fitted part, and those without usable numbers.
    sample_rate : float
        [Hz].
    source : str
        The file.
    thinned : Record
        Every k-th sample, for figures.
    prediction : ndarray
        Free-running displacement [µm] at the samples of `thinned`.
    notes, advice : tuple of str
        What was assumed to read the log, and what to know before using the model, in plain sentences.
    """

    model: ColemanHodgdon
    standard_errors: dict[str, float]
    delay: float
    train: Misfit
    held_out: Misfit
    line: LinearGain
    line_train: Misfit
    line_held_out: Misfit
    samples: int
    trained: int
    skipped: int
    sample_rate: float
    source: str
    thinned: Record = field(repr=False)
    prediction: FloatArray = field(repr=False)
    notes: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()

    def table(self) -> list[tuple[str, float, float, str]]:
        """Rows of parameter name, value, standard error and unit."""
        return parameter_rows(self.model, self.delay, self.standard_errors)

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary; the model under ``"model"`` is that of `ColemanHodgdon.to_dict`."""
        return {
            "format": "piezoest-streamed-1",
            "source": self.source,
            "samples": self.samples,
            "skipped_rows": self.skipped,
            "sample_rate_Hz": self.sample_rate,
            "model": self.model.to_dict(),
            "standard_errors": dict(self.standard_errors),
            "units": {name: unit for name, _, _, unit in self.table()},
            "delay_samples": self.delay,
            "trained_samples": self.trained,
            **misfits_to_dict(self),
            "notes": list(self.notes),
            "advice": list(self.advice),
        }


def identify_stream(
    log: RecordStream, *, train: float = 0.5, delay: float | Literal["auto"] = "auto"
) -> StreamedIdentification:
    """Identify a Coleman-Hodgdon model from a log that need not fit in memory.

    `HysteresisRLS` without forgetting takes the first part block by block; a second pass lets the
    model it ends with run free over the whole log. Unlike `identify` there is no refinement of the
    free-running error, which would need the whole log at once.

    Parameters
    ----------
    log : RecordStream
        From `stream_record`.
    train : float
        Part of the log to fit, from its start; the rest is held out. 0.1 to 0.9.
    delay : float or "auto"
        Samples by which the displacement lags the voltage, 0 to 10; ``"auto"`` takes what `identify`
        finds in the first 50 000 samples, and 0 with a word in `advice` where it finds nothing.

    Returns
    -------
    StreamedIdentification

    Raises
    ------
    ValueError
        As `identify`; the excitation is that of the first 50 000 samples.
    """
    if not isinstance(log, RecordStream):
        raise ValueError(f"log must be a RecordStream, got {type(log).__name__}: use stream_record(path)")
    train = fraction("train", train, 0.1, 0.9)
    samples = log.count()
    trained = round(train * samples)
    head = _head(log, min(HEAD, trained))
    if int(np.sum(head.usable)) < FEWEST_SAMPLES:
        raise ValueError(
            f"the first {len(head)} samples of {log.path} have {int(np.sum(head.usable))} usable ones, "
            f"at least {FEWEST_SAMPLES} are needed"
        )
    advice: list[str] = []
    lag = _delay(head, delay, advice)
    data = prepare(head.voltage, head.displacement)
    noise = noise_of(data)
    check_excitation(data, noise)
    estimator = HysteresisRLS(
        log.sample_rate, initial_model=data.loop_about_line(lag), memory=None, offset=True, delay=lag,
        uncertainty=1.0, noise=noise,
    )  # fmt: skip
    first = 0
    for block in log:
        part = slice(0, max(0, min(block.voltage.size, trained - first)))
        if part.stop:
            estimator.run(block.voltage[part], block.displacement[part], every=part.stop)
        first += block.voltage.size
    line = data.line(lag)
    model = _hysteresis(estimator.model, line)
    judge = _Judge(model, line, lag, samples, trained)
    for block in log:
        judge.add(block.time, block.voltage, block.displacement)
    held_out, line_held_out = (judge.misfit(held_out=True, of_line=of_line) for of_line in (False, True))
    known = dict(zip(estimator.parameter_names, estimator.standard_errors, strict=True))
    errors = {name: float(known[name]) for name in model.parameter_names}
    if held_out.rms > line_held_out.rms:
        advice.append("A straight line does better: check signs, columns and the delay.")
    if estimator.status.projected:
        advice.append(
            "The estimate lies outside the admissible parameters: the model is the nearest one within."
        )
    return StreamedIdentification(
        model=model,
        standard_errors=errors,
        delay=lag,
        train=judge.misfit(held_out=False),
        held_out=held_out,
        line=line,
        line_train=judge.misfit(held_out=False, of_line=True),
        line_held_out=line_held_out,
        samples=samples,
        trained=trained,
        skipped=judge.skipped,
        sample_rate=log.sample_rate,
        source=str(log.path),
        thinned=judge.thinned(log),
        prediction=judge.prediction,
        notes=log.notes,
        advice=tuple(advice),
    )


def _head(log: RecordStream, length: int) -> Record:
    voltage, displacement = np.empty(0), np.empty(0)
    for block in log:
        voltage = np.concatenate([voltage, block.voltage])
        displacement = np.concatenate([displacement, block.displacement])
        if voltage.size >= length:
            break
    return Record.from_arrays(voltage[:length], displacement[:length], log.sample_rate, str(log.path))


def _delay(head: Record, delay: float | str, advice: list[str]) -> float:
    if delay != "auto":
        return fraction("delay", delay, 0.0, LONGEST_DELAY)
    try:
        return identify(head).delay
    except ValueError as error:
        advice.append(f"The delay was taken as 0, for the log's start does not show it: {error}.")
        return 0.0


def _hysteresis(model: Model, line: LinearGain) -> ColemanHodgdon:
    if isinstance(model, ColemanHodgdon):
        return model
    raise ValueError(
        f"no Coleman-Hodgdon model fits: the recursion ended with {model}, where a straight line has the "
        f"gain {line.gain:.4g} µm/V: check the columns, their units and signs"
    )


class _Judge:
    """Free-running errors of a model and of a line, block by block in order, and points for figures."""

    def __init__(
        self, model: ColemanHodgdon, line: LinearGain, lag: float, samples: int, trained: int
    ) -> None:
        self._model, self._line, self._lag = model, line, lag
        # The last voltages, and w_h at the last of them delayed.
        self._before: FloatArray | None = None
        self._w_h = 0.0
        # Of model and line, in the fitted part and the held-out one: sum of squares, largest, count.
        self._sums = np.zeros((2, 2, 3))
        self._trained, self._seen = trained, 0
        self._every = max(1, -(-samples // MOST_POINTS))
        self._points: list[FloatArray] = []
        self.skipped = 0

    def add(self, time: FloatArray, u: FloatArray, x: FloatArray) -> None:
        """Judge a block."""
        predicted, by_line = self._predicted(u)
        usable = np.isfinite(u) & np.isfinite(x)
        fitted = self._seen + np.arange(u.size) < self._trained
        for held_out, counts in enumerate((usable & fitted, usable & ~fitted)):
            for of_line, output in enumerate((predicted, by_line)):
                error = np.abs(x[counts] - output[counts])
                squares, largest, count = self._sums[held_out, of_line]
                largest = np.max(error, initial=largest)
                # One by one, for the sum not to depend on where the blocks end.
                squares = np.add.accumulate(np.append(squares, error**2))[-1]
                self._sums[held_out, of_line] = squares, largest, count + error.size
        kept = slice(-self._seen % self._every, None, self._every)
        self._points.append(np.array([time[kept], u[kept], x[kept], predicted[kept]]))
        self.skipped += int(np.sum(~usable))
        self._seen += u.size

    def _predicted(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Free-running displacement of model and line; NaN before the first known voltage."""
        known = np.isfinite(u)
        if self._before is None:
            if not known.any():
                return np.full(u.size, np.nan), np.full(u.size, np.nan)
            self._before = np.full(int(np.ceil(self._lag)) + 2, u[np.argmax(known)])
            blind = int(np.argmax(known))
        else:
            blind = 0
        # A missing voltage is taken as the last one.
        path = np.concatenate([self._before, u])
        path = path[np.maximum.accumulate(np.where(np.isfinite(path), np.arange(path.size), 0))]
        whole, rest = divmod(self._lag, 1.0)
        now = np.arange(self._before.size - 1, path.size) - int(whole)
        voltage = (1.0 - rest) * path[now] + rest * path[now - 1]
        w_h = np.full(voltage.size, self._w_h)
        _follow(voltage, w_h, self._model.a, self._model.b)
        self._w_h, self._before = float(w_h[-1]), path[-self._before.size :]
        predicted = (self._model.c * voltage + w_h + self._model.offset)[1:]
        predicted[:blind] = np.nan
        return predicted, self._line.simulate(voltage[1:])

    def misfit(self, *, held_out: bool, of_line: bool = False) -> Misfit:
        """Return the error so far, of the model or of the line, in the fitted part or behind it."""
        squares, largest, count = self._sums[int(held_out), int(of_line)]
        return Misfit(float(np.sqrt(squares / max(count, 1.0))), float(largest))

    def thinned(self, log: RecordStream) -> Record:
        """Every k-th sample."""
        time, voltage, displacement, _ = np.concatenate(self._points, axis=1)
        return Record(time, voltage, displacement, log.sample_rate / self._every, str(log.path))

    @property
    def prediction(self) -> FloatArray:
        """Of the model at the samples of `thinned`."""
        return np.asarray(np.concatenate(self._points, axis=1)[3])


@compiled
def _follow(u: Vector, w_h: Vector, a: float, b: float) -> None:
    """w_h behind the first one, along the voltage."""
    for k in range(1, u.size):
        w_h[k] = hysteresis_step(w_h[k - 1], u[k] - u[k - 1], a, b)
