"""From a recorded log to a model: checks, fit, held-out error, advice."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np

from piezoest._checks import FloatArray, finite, fraction
from piezoest.estimators.coordinates import coordinates, late
from piezoest.estimators.fit import Outcome, Problem, best_start, outcome, single_shooting
from piezoest.identification.data import Data, check_excitation, noise_of, prepare
from piezoest.identification.residual import Misfit, Whiteness
from piezoest.identification.result import Identification
from piezoest.models import ColemanHodgdon
from piezoest.records import Record

FEWEST_SAMPLES = 50
# Samples off the model by this many (robust) standard deviations are spikes.
SPIKE = 20.0
# A model whose loop is not known to this part of itself was not excited by the record.
LARGEST_RELATIVE_ERROR = 0.5
# The start is left out as long as it is off by this many (robust) standard deviations.
UNSETTLED = 4.0
LONGEST_UNSETTLED = 0.1
DRIFT_WORTH_A_WORD = 0.5
WORSE_ON_HELD_OUT = 1.5
LONGEST_DELAY = 10.0
# Most passes of a fit over the record, and the relative change at which it has ended.
MOST_PASSES, TOLERANCE = 60, 1e-8


def identify(
    record: Record,
    *,
    train: float = 0.5,
    delay: float | Literal["auto"] = "auto",
    settle: float | None = None,
) -> Identification:
    """Identify a Coleman-Hodgdon model with offset from a record, and judge it on a part held out.

    Recursive least squares of the derivative form (`HysteresisRLS`) gives the start; the parameters, the
    offset, the state at the first sample and the delay are then refined together until the free-running
    model, which sees only the voltage, misses the measured displacement least. The parameters stay
    admissible.

    Parameters
    ----------
    record : Record
        With NaN where samples are missing.
    train : float
        Part of the record to fit, from its start; the rest is held out. 0.1 to 0.9.
    delay : float or "auto"
        Samples by which the displacement lags the voltage, 0 to 10, fractions too; ``"auto"`` estimates
        it. At a single frequency a delay and a wider loop look alike.
    settle : float, optional
        Seconds to leave out at the start; by default as long as the start is off the model by
        more than four robust standard deviations, at most a tenth of the fitted part.

    Returns
    -------
    Identification

    Raises
    ------
    ValueError
        If the record is no `Record` or too short, its voltage excites too little (with the figure), its
        displacement falls as the voltage rises, or an argument is out of its range.
    """
    if not isinstance(record, Record):
        raise ValueError(
            f"record must be a Record, got {type(record).__name__}: "
            "use read_record(path) or Record.from_arrays(voltage, displacement, sample_rate)"
        )
    train = fraction("train", train, 0.1, 0.9)
    trained = round(train * len(record))
    start_delay, fit_delay = _delay_argument(delay)
    whole, data = _checked(record, trained)
    noise = noise_of(data)
    turns = check_excitation(data, noise)
    rate = record.sample_rate

    left_out = 0 if settle is None else int(fraction("settle", settle, 0.0, 0.5 * trained / rate) * rate)
    fit = _Fit(data, rate, start_delay, fit_delay, noise)
    end = fit.solved(left_out)
    if settle is None and (left_out := _unsettled(end.residual)):
        end = fit.solved(left_out)

    value = end.value
    model = ColemanHodgdon.from_theta(end.theta[:3], value["offset"])
    errors = dict(zip(end.parameter_names, end.standard_errors.tolist(), strict=True))
    _check_known(model, errors, data, turns)
    start, found_delay = value["initial_state"], value["delay"]
    voltage = late(whole.u, found_delay)
    prediction = model.simulate(voltage, initial_state=start, allow_jumps=True)
    error = whole.measured() - prediction
    line = data.line(found_delay, left_out)
    line_error = whole.measured() - line.simulate(voltage)
    known = np.flatnonzero(np.isfinite(error[left_out:])) + left_out
    slope = float(np.polyfit(known / len(record), error[known], 1)[0])
    result = Identification(
        model=model,
        standard_errors={name: errors[name] for name in (*model.parameter_names, "offset", "delay")},
        initial_state=start,
        delay=found_delay,
        delay_estimated=fit_delay,
        train=Misfit.of(error[left_out:trained]),
        held_out=Misfit.of(error[trained:]),
        line=line,
        line_train=Misfit.of(line_error[left_out:trained]),
        line_held_out=Misfit.of(line_error[trained:]),
        whiteness=Whiteness.of(error[left_out:trained]),
        drift=slope,
        left_out=left_out,
        trained=trained,
        prediction=prediction,
        record=record,
    )
    return dataclasses.replace(result, advice=tuple(_advice(result, end, data, turns)))


class _Fit:
    """The output-error fit of a record, with the start state and a delay."""

    def __init__(self, data: Data, sample_rate: float, delay: float, fit_delay: bool, noise: float) -> None:
        self._data, self._sample_rate, self._delay, self._noise = data, sample_rate, delay, noise
        self._coordinates = coordinates(ColemanHodgdon, () if fit_delay else ("delay",), delayed=True)
        self._held = np.empty(0) if fit_delay else np.array([delay])
        self._limits = ColemanHodgdon.record_limits(data.extent) | {"delay": (0.0, LONGEST_DELAY)}
        self._last: FloatArray | None = None

    def solved(self, left_out: int) -> Outcome:
        """Fit all but so many samples at the start, from what was found last, if that is the better start."""
        problem = Problem(
            self._data.u, self._data.measured(left_out), self._coordinates, self._held, limits=self._limits
        )
        start = best_start(
            problem, self._sample_rate, None, self._data.loop_about_line(self._delay),
            {"delay": self._delay}, delay=self._delay, noise=self._noise,
        )  # fmt: skip
        if self._last is not None and problem.cost(self._last) < problem.cost(start):
            start = self._last
        self._last = single_shooting(problem, start, "linear", 1.0, MOST_PASSES, TOLERANCE).q
        return outcome(problem, self._last, coloured=True)


def _delay_argument(delay: float | str) -> tuple[float, bool]:
    if isinstance(delay, str):
        if delay != "auto":
            raise ValueError(f"delay must be 'auto' or a number of samples, got {delay!r}")
        return 1.0, True
    return fraction("delay", finite("delay", delay), 0.0, LONGEST_DELAY), False


def _checked(record: Record, trained: int) -> tuple[Data, Data]:
    """Data of the whole record and of the fitted part, if there is enough in both parts."""
    for name, part in (("fitted", slice(0, trained)), ("held-out", slice(trained, None))):
        usable = int(np.sum(record.usable[part]))
        if usable < FEWEST_SAMPLES:
            raise ValueError(
                f"the {name} part of {record.source} has {usable} usable samples, at least {FEWEST_SAMPLES} "
                "are needed: record longer"
            )
    whole = prepare(record.voltage, record.displacement)
    return whole, prepare(record.voltage[:trained], record.displacement[:trained])


def _unsettled(residual: FloatArray) -> int:
    """Samples at the start that are off by far more than the rest, because the stage had not settled."""
    known = np.isfinite(residual)
    deviation = 1.4826 * float(np.median(np.abs(residual[known])))
    off = np.abs(residual[: int(LONGEST_UNSETTLED * residual.size)]) > UNSETTLED * deviation
    if deviation == 0.0 or not np.any(off[:3]):
        return 0
    # A stage that settles may cross zero: ten quiet samples in a row are the end.
    quiet = np.convolve(off, np.ones(10), mode="valid") == 0.0
    end = int(np.argmax(quiet)) if np.any(quiet) else off.size
    # Twice as long, for what has fallen below the threshold is not yet gone.
    return min(2 * end, off.size)


def _spikes(residual: FloatArray) -> int:
    """Samples so far off that they are no part of the rest."""
    known = residual[np.isfinite(residual)]
    deviation = 1.4826 * float(np.median(np.abs(known)))
    return int(np.sum(np.abs(known) > SPIKE * deviation)) if deviation > 0.0 else 0


def _check_known(model: ColemanHodgdon, errors: dict[str, float], data: Data, turns: FloatArray) -> None:
    """Refuse a model of which the record leaves a parameter open."""
    for name, unit, value in zip(model.parameter_names, model.parameter_units, model.theta, strict=True):
        if (error := errors[name]) > LARGEST_RELATIVE_ERROR * value:
            raise ValueError(
                f"too little excitation: {name} = {value:.3g} {unit} is known only to ±{error:.2g} "
                f"({100 * error / value:.0f} %) from {turns.size} turns of the voltage over "
                f"{data.extent:.4g} V: record longer, with a larger voltage and turns of several sizes"
            )


def _advice(found: Identification, end: Outcome, data: Data, turns: FloatArray) -> list[str]:
    rate, model = found.record.sample_rate, found.model
    said = []
    if found.left_out:
        said.append(
            f"The first {found.left_out / rate:.3g} s do not fit the rest (the stage had not settled): "
            "left out."
        )
    if abs(data.middle) > 0.1 * data.extent or abs(model.offset) > 0.1 * float(np.ptp(data.x[data.counts])):
        said.append(
            f"The loop is not centred at zero (voltage {data.middle:.3g} V, displacement "
            f"{model.offset + model.c * data.middle:.4g} µm): let HysteresisRLS estimate the offset, as it "
            "does by default."
        )
    if found.delay_estimated and found.delay > max(0.1, 2.0 * found.standard_errors["delay"]):
        said.append(
            f"The displacement lags the voltage by {found.delay:.2f} samples "
            f"({1e3 * found.delay / rate:.3g} ms): use "
            f"HysteresisRLS(delay={found.delay:.2g}). At one frequency, lag and loop width look alike."
        )
    if found.delay > 0.99 * LONGEST_DELAY:
        said.append("The delay is at the end of its range: check that the columns belong together.")
    linear = found.held_out.rms > 0.9 * found.line_held_out.rms
    if set(end.at_bound) - {"place", "delay"} and not linear:
        said.append(
            "The fit lies on the edge of the admissible parameters: the best model beyond it has no inverse. "
            "Check signs and columns, or the delay."
        )
    if spikes := _spikes(end.residual):
        said.append(
            f"{spikes} of the fitted samples {'is' if spikes == 1 else 'are'} off the model by more than "
            f"{SPIKE:g} times what is usual: if these are spikes of the sensor, empty them in the log, for "
            "they pull the fit."
        )
    tops = np.abs(turns - data.middle)
    if turns.size > 2 and np.ptp(tops[1:]) < 0.1 * data.extent:
        said.append("The voltage turns at one amplitude only: the parameters belong to that amplitude.")
    if not found.whiteness.is_white:
        said.append(
            "The residual is not white: what is left is not noise but what the model cannot do "
            "(creep, drift, rate, minor loops); the standard errors are widened for it."
        )
    if abs(found.drift) > DRIFT_WORTH_A_WORD * found.train.rms:
        said.append(
            f"The displacement drifts by about {found.drift:+.2g} µm over the record against the model."
        )
    if found.held_out.rms > WORSE_ON_HELD_OUT * found.train.rms:
        said.append(
            f"The held-out error is {found.held_out.rms / found.train.rms:.1f} times the fitted one: "
            "the stage or the signal changes along the record."
        )
    if linear:
        said.append("A straight line does about as well: the record shows little hysteresis.")
    return said
