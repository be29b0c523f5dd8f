"""From a recorded log to a model: checks of the log, the best model, and its accuracy."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from piezoest._checks import FloatArray, fraction, instance
from piezoest.fitting import FORMS, Fitter
from piezoest.fitting.flaws import Flaws, flawed
from piezoest.fitting.runs import BoolArray
from piezoest.fitting.search import checked_delay
from piezoest.identification.advice import advice_of, beyond_sentences, other_log_sentences
from piezoest.identification.candidate import Candidate, best_of, reason_for
from piezoest.identification.data import Data, check_enough, check_excitation, judged, noise_of, prepare
from piezoest.identification.finding import Finding
from piezoest.identification.lag import tells_lag
from piezoest.identification.repeats import noise_floor
from piezoest.identification.residual import Misfit, Whiteness
from piezoest.identification.result import Identification, Validation
from piezoest.identification.sense import findings
from piezoest.identification.steps_of_converter import levels
from piezoest.models import LearntOn
from piezoest.records import Record, as_record
from piezoest.records.as_record import one_log

# A parameter that is not known to this fraction of itself was not excited by the record.
LARGEST_RELATIVE_ERROR = 0.5

Say = Callable[[str], None]


def identify(
    data: Any,
    displacement: Any = None,
    *,
    sample_rate: float | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    model: str = "auto",
    train: float = 0.5,
    delay: float | Literal["auto"] = "auto",
    settle: float | None = None,
    validate: Sequence[Any] = (),
    strict: bool = False,
    say: Say | None = None,
) -> Identification:
    """Find the model of a stage that fits a recorded log best, and how accurate it is.

    First the log is checked: units, columns, direction of the loop, clipping, spikes, jumps. Then models of
    all kinds, or of one kind, are fitted to its first part, see `piezoest.fit`. The kind is chosen by
    cross-validation on blocks of that part. The model is tested on the rest of the log, which no fit has
    seen.

    Parameters
    ----------
    data : array_like of shape (N,), Record, str, Path or DataFrame
        Voltage [V], with `displacement` and `sample_rate`; or a record, a file, or a table of pandas or
        Polars.
    displacement : array_like, shape (N,), optional
        [µm]; NaN where a sample is missing.
    sample_rate : float, optional
        [Hz].
    columns, units : mapping of str to str, optional
        Of a file or a table, as for `read_record`.
    model : str
        ``"auto"``, or the kind to fit, as for `piezoest.fit`: ``"line"``, ``"coleman-hodgdon"``, ``"plays"``,
        ``"plays-creep"``, ``"plays-asymmetric"``, ``"plays-asymmetric-creep"``.
    train : float
        The fraction of the log to fit, from its start, 0.1 to 0.9; the rest is held out.
    delay : float or "auto"
        Samples by which the displacement lags the voltage, 0 to 10, fractions too. ``"auto"`` estimates it.
        Only swings of several sizes or frequencies, or steps, show the difference between a delay and a wider
        loop: see ``delay_known`` of the result.
    settle : float, optional
        Time to leave out at the start [s]. Default: twice the time for which the error exceeds four robust
        standard deviations, at most a tenth of the fitted part.
    validate : sequence
        Other logs of the stage, each a record, a file or a table, which the model predicts. They are checked
        as `data` is.
    strict : bool
        Raise an error if one of the logs is doubtful.
    say : callable, optional
        Called with a few words before each step.

    Raises
    ------
    ValueError
        If the log is too short, its voltage moves too little (with the number), its displacement falls when
        the voltage rises or does not follow it, an argument is out of its range, or `strict` and a log is
        doubtful.
    OSError
        If a file cannot be read.

    Examples
    --------
    >>> import numpy as np, piezoest as pz
    >>> u = 50.0 + 40.0 * np.sin(np.linspace(0.0, 60.0, 6000)) * np.linspace(0.3, 1.0, 6000)
    >>> x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u, allow_jumps=True)
    >>> found = pz.identify(u, x, sample_rate=1000.0, model="coleman-hodgdon")
    >>> print(np.round(found.model.alpha, 3))
    0.02
    """
    say = say or (lambda words: None)
    if model != "auto" and model not in FORMS:
        raise ValueError(f"model must be auto or one of {', '.join(FORMS)}, got {model!r}")
    train = fraction("train", train, 0.1, 0.9)
    record = as_record(data, displacement, sample_rate=sample_rate, columns=columns, units=units)
    logs = instance("validate", validate, (list, tuple), "a list of logs: validate=[log]")
    others = [one_log(f"validate[{i}]", each) for i, each in enumerate(logs)]
    validated = [(each, flawed(each.voltage, each.displacement)) for each in others]
    for each, its in validated:
        check_enough("part to validate", each.source, int(np.count_nonzero(judged(each, its))))
    say("looking at the log")
    for name in ("voltage", "displacement"):
        if not np.any(np.isfinite(getattr(record, name))):
            raise ValueError(f"{record.source}: {name} has no finite sample: check the column")
    trained = round(train * len(record))
    flaws = flawed(record.voltage, record.displacement)
    counts = judged(record, flaws, trained)
    check_enough("fitted part", record.source, int(np.count_nonzero(counts[:trained])))
    check_enough("held-out part", record.source, int(np.count_nonzero(counts[trained:])))
    usable = np.where(flaws.unusable, np.nan, record.displacement)[:trained]
    first = prepare(flaws.without(record.voltage)[:trained], usable)
    noise = noise_of(first)
    # A value that is rounded is off by the standard deviation of an even distribution.
    rounding = levels(usable[np.isfinite(usable)])[0] / np.sqrt(12.0)
    found = findings(record)
    check_excitation(first, noise, found)
    of_others = [
        f"Other log {Path(each.source).name}: {said}" for each in others for said in _doubts(findings(each))
    ]
    if strict and (doubts := [*_doubts(found), *of_others]):
        raise ValueError(" ".join(doubts))
    record = dataclasses.replace(record, voltage=flaws.without(record.voltage))
    wanted = checked_delay(delay)
    told = wanted != "auto" or tells_lag(first.u)
    fitter = Fitter(
        record.voltage[:trained],
        record.displacement[:trained],
        sample_rate=record.sample_rate,
        delay=wanted,
        flaws=flaws.before(trained),
        settle=settle,
        tells_lag=told,
    )
    candidates = []
    for name in FORMS if model == "auto" else dict.fromkeys(("line", model)):
        say(f"fitting {FORMS[name].label}")
        candidates.append(_candidate(fitter, name, record, flaws, counts))
    unknown = {each.name: said for each in candidates if (said := _unknown(each, first))}
    if model in unknown:
        raise ValueError(unknown[model])
    known = [each for each in candidates if each.name not in unknown]
    rested = bool(np.any(flaws.before(trained).rests[:, 0] > 0))
    tells_creep = rested or tells_lag(first.u)
    best = best_of(known, tells_creep=tells_creep) if model == "auto" else candidates[-1]
    result = Identification(
        best=best,
        candidates=tuple(candidates),
        reason=reason_for(known, best),
        whiteness=Whiteness.of(best.residual[best.fit.left_out : trained]),
        # What a model misses by less than the noise, where that was held out, is none.
        noise_floor=min(
            noise_floor(record, fallback=max(noise, rounding)), best.train.rms, best.held_out.rms
        ),
        drift=_slope(best.residual, best.fit.left_out),
        delay_known=told,
        creep_known=tells_creep,
        trained=trained,
        record=record,
        findings=found,
        flaws=flaws,
        learnt_on=LearntOn.of(record.voltage[:trained], usable, record.sample_rate),
        validations=tuple(Validation.of(best.fit, *each) for each in validated),
    )
    of_others += [
        said
        for each, its in validated
        for said in beyond_sentences(
            f"Other log {Path(each.source).name}",
            result.learnt_on,
            its.without(each.voltage),
            each.sample_rate,
        )
    ]
    of_others += other_log_sentences(result)
    return dataclasses.replace(result, advice=(*advice_of(result, first), *of_others))


def _doubts(found: Sequence[Finding]) -> list[str]:
    return [each.sentence for each in found if each.severity == "doubt"]


def _candidate(fitter: Fitter, name: str, record: Record, flaws: Flaws, counts: BoolArray) -> Candidate:
    """One kind fitted, and what it misses: jumps behind the fitted part are the sensor's, not the model's."""
    fit = fitter.form(name)
    prediction = fit.continued(record.voltage)
    counts, trained = counts.copy(), fit.counts.size
    counts[fit.left_out : trained] = fit.counts[fit.left_out :]
    error = np.where(counts, record.displacement, np.nan) - prediction.x
    later = flaws.jumps >= trained
    for place, size in zip(flaws.jumps[later], flaws.jump_sizes[later], strict=True):
        error[place:] -= size
    misfits = Misfit.of(error[fit.left_out : trained]), Misfit.of(error[trained:])
    return Candidate(fit, *misfits, prediction, error)


def _slope(residual: FloatArray, left_out: int) -> float:
    """What a straight line through a residual rises by over the record [µm]."""
    known = np.flatnonzero(np.isfinite(residual[left_out:])) + left_out
    return float(np.polyfit(known / residual.size, residual[known], 1)[0])


def _unknown(item: Candidate, data: Data) -> str:
    """What a log leaves open of a Coleman-Hodgdon model; nothing of other kinds."""
    if item.name != "coleman-hodgdon":
        return ""
    model = item.model
    for name, unit, value in zip(model.parameter_names, model.parameter_units, model.theta, strict=True):
        if (error := item.fit.standard_errors[name]) > LARGEST_RELATIVE_ERROR * value:
            return (
                f"too little excitation: {name} = {value:.3g} {unit} is known only to ±{error:.2g} "
                f"({100 * error / value:.0f} %) over {data.extent:.4g} V: record longer, with a larger "
                "voltage and turns of several sizes"
            )
    return ""
