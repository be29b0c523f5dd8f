"""From a recorded log to a model: checks, fit, held-out error, advice."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np

from piezoest._checks import FloatArray, finite, fraction
from piezoest._jit import compiled
from piezoest.identification import fit as fitting
from piezoest.identification.result import Identification, Misfit, Whiteness
from piezoest.models import LinearGain
from piezoest.records import Record

FEWEST_SAMPLES = 50
# A turn counts when the voltage then runs back by this part of its range.
TURN = 0.05
FEWEST_TURNS = 2
SMALLEST_SIGNAL_TO_NOISE = 10.0
# Samples off the model by this many (robust) standard deviations are spikes.
SPIKE = 20.0
# A model whose loop is not known to this part of itself was not excited by the record.
LARGEST_RELATIVE_ERROR = 0.5
# The start is left out as long as it is off by this many (robust) standard deviations.
UNSETTLED = 4.0
LONGEST_UNSETTLED = 0.1
DRIFT_WORTH_A_WORD = 0.5
WORSE_ON_HELD_OUT = 1.5


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

    begins = fitting.starts(data, rate, start_delay, noise)
    left_out = 0 if settle is None else int(fraction("settle", settle, 0.0, 0.5 * trained / rate) * rate)
    fit = fitting.output_error(data, begins, fit_delay, left_out)
    if settle is None and (left_out := _unsettled(fit.residual)):
        fit = fitting.output_error(data, [fit.p, *begins], fit_delay, left_out)

    errors = fitting.standard_errors(fit, data)
    _check_known(fit, errors, data, turns)
    model = fitting.model_of(fit.p, data)
    prediction = fitting.simulate(fit.p, data, whole.u)
    error = np.where(whole.counts, record.displacement - prediction, np.nan)
    found_delay = float(fit.p[fitting.DELAY])
    gain, offset = fitting.straight_line(data, found_delay, left_out)
    line = LinearGain(gain, offset)
    line_error = np.where(
        whole.counts, record.displacement - line.simulate(fitting.delayed(whole.u, found_delay)), np.nan
    )
    known = np.flatnonzero(np.isfinite(error[left_out:])) + left_out
    slope = float(np.polyfit(known / len(record), error[known], 1)[0])
    result = Identification(
        model=model,
        standard_errors=dict(
            zip(("alpha", "beta", "gamma", "offset", "delay"), (float(e) for e in errors), strict=True)
        ),
        initial_state=fitting.initial_state_of(fit.p, model),
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
    return _with_advice(result, fit, data, turns)


def _delay_argument(delay: float | str) -> tuple[float, bool]:
    if isinstance(delay, str):
        if delay != "auto":
            raise ValueError(f"delay must be 'auto' or a number of samples, got {delay!r}")
        return 1.0, True
    return fraction("delay", finite("delay", delay), 0.0, fitting.LONGEST_DELAY), False


def _checked(record: Record, trained: int) -> tuple[fitting.Data, fitting.Data]:
    """Data of the whole record and of the fitted part, if there is enough in both parts."""
    for name, part in (("fitted", slice(0, trained)), ("held-out", slice(trained, None))):
        usable = int(np.sum(record.usable[part]))
        if usable < FEWEST_SAMPLES:
            raise ValueError(
                f"the {name} part of {record.source} has {usable} usable samples, at least {FEWEST_SAMPLES} "
                "are needed: record longer"
            )
    whole = fitting.prepare(record.voltage, record.displacement)
    return whole, fitting.prepare(record.voltage[:trained], record.displacement[:trained])


def noise_of(data: fitting.Data) -> float:
    """Standard deviation of the displacement's noise [µm], from its third differences, robustly."""
    x = data.x[data.counts]
    third = np.diff(x, 3)
    return max(float(1.4826 * np.median(np.abs(third)) / np.sqrt(20.0)), 1e-9 * float(np.ptp(x)), 1e-12)


def check_excitation(data: fitting.Data, noise: float) -> FloatArray:
    """Refuse a voltage that cannot show a hysteresis; return the voltages at its turns."""
    if data.extent == 0.0:
        raise ValueError(
            f"too little excitation: the voltage stays at {data.middle:.6g} V over the fitted part, "
            "it must move the stage up and down"
        )
    turns = turning_voltages(data)
    if turns.size < FEWEST_TURNS:
        raise ValueError(
            f"too little excitation: over the fitted part the voltage moves by {data.extent:.4g} V but "
            f"turns {turns.size} times, at least {FEWEST_TURNS} are needed: hysteresis shows only at turns"
        )
    extent = float(np.ptp(data.x[data.counts]))
    if extent < SMALLEST_SIGNAL_TO_NOISE * noise:
        raise ValueError(
            f"too little excitation: the displacement moves by {extent:.3g} µm in noise of {noise:.3g} µm "
            f"rms, {extent / noise:.1f} times that, at least {SMALLEST_SIGNAL_TO_NOISE:g} are needed: "
            "raise the voltage"
        )
    gain, _ = fitting.straight_line(data, 0.0)
    if gain < 0.0:
        raise ValueError(
            f"the displacement falls as the voltage rises ({gain:.4g} µm/V): change the sign of one of the "
            "two columns"
        )
    return turns


def turning_voltages(data: fitting.Data) -> FloatArray:
    """Voltages at which it turns and then runs back by more than a twentieth of its range [V]."""
    turns = np.empty(data.u.size)
    return turns[: _turns(data.u, TURN * data.extent, turns)]


@compiled()
def _turns(u: Any, threshold: float, turns: Any) -> int:
    """Voltages at which u turns and then runs back by more than a threshold, into `turns`."""
    count, direction, extreme = 0, 0.0, u[0]
    low = high = u[0]
    for value in u:
        if direction == 0.0:
            low, high = min(low, value), max(high, value)
            if high - low > threshold:
                direction = 1.0 if value == high else -1.0
                extreme = value
        elif direction * (value - extreme) > 0.0:
            extreme = value
        elif direction * (extreme - value) > threshold:
            turns[count] = extreme
            count += 1
            direction, extreme = -direction, value
    return count


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


def _check_known(fit: fitting.Fit, errors: FloatArray, data: fitting.Data, turns: FloatArray) -> None:
    """Refuse a model of which the record leaves a parameter open."""
    model = fitting.model_of(fit.p, data)
    for name, unit, value, error in zip(
        model.parameter_names, model.parameter_units, model.theta, errors[:3], strict=True
    ):
        if error > LARGEST_RELATIVE_ERROR * value:
            raise ValueError(
                f"too little excitation: {name} = {value:.3g} {unit} is known only to ±{error:.2g} "
                f"({100 * error / value:.0f} %) from {turns.size} turns of the voltage over "
                f"{data.extent:.4g} V: record longer, with a larger voltage and turns of several sizes"
            )


def _with_advice(
    found: Identification, fit: fitting.Fit, data: fitting.Data, turns: FloatArray
) -> Identification:
    return dataclasses.replace(found, advice=tuple(_advice(found, fit, data, turns)))


def _advice(found: Identification, fit: fitting.Fit, data: fitting.Data, turns: FloatArray) -> list[str]:
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
            f"{fit.p[fitting.CENTRE]:.4g} µm): let HysteresisRLS estimate the offset, as it does by default."
        )
    if found.delay_estimated and found.delay > max(0.1, 2.0 * found.standard_errors["delay"]):
        said.append(
            f"The displacement lags the voltage by {found.delay:.2f} samples "
            f"({1e3 * found.delay / rate:.3g} ms): use "
            f"HysteresisRLS(delay={found.delay:.2g}). At one frequency, lag and loop width look alike."
        )
    if found.delay > 0.99 * fitting.LONGEST_DELAY:
        said.append("The delay is at the end of its range: check that the columns belong together.")
    linear = found.held_out.rms > 0.9 * found.line_held_out.rms
    if np.any(~fit.free[: fitting.PLACE]) and not linear:
        said.append(
            "The fit lies on the edge of the admissible parameters: the best model beyond it has no inverse. "
            "Check signs and columns, or the delay."
        )
    if spikes := _spikes(fit.residual):
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
