"""What to know before using an identified model, in plain sentences."""

import dataclasses
from pathlib import Path

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.search import LONGEST_DELAY
from piezoest.identification.data import Data, turning_voltages
from piezoest.identification.residual import Oscillation
from piezoest.identification.result import Identification
from piezoest.models import LearntOn
from piezoest.records.source import counted

DRIFT_WORTH_A_WORD = 0.5
WORSE_ON_HELD_OUT = 1.5
# An oscillation makes this part of the residual and is so many times as fast as the swings: a loop that
# is missed has harmonics of these.
OSCILLATES, FASTER = 0.75, 15.0
# An error above so many times the noise floor is not noise; on another log, above so many times the one here.
ABOVE_NOISE, MISSED = 1.3, 3.0
# Errors below this part of the stroke are what good models leave.
SMALL = 5e-3
# So much of the fitted part may be left out at the start without a word.
SHORT = 0.01


def advice_of(found: Identification, data: Data) -> tuple[str, ...]:
    """All there is to say, the log's own doubts first."""
    held_out = found.record.voltage[found.trained :]
    beyond = beyond_sentences("The held-out part", found.learnt_on, held_out, found.sample_rate)
    return (
        *(each.sentence for each in found.findings),
        *_left_out(found),
        *delay_sentences(found.delay, found.sample_rate, found.delay_known, found.delay_estimated),
        *_creep(found),
        *_centre(data),
        *_remainder(found),
        *_drift(found),
        *(beyond or _worse_later(found)),
    )


def unsettled_sentence(seconds: float) -> str:
    """That the start was left out, which lasts so long [s]."""
    why = "the stage had not settled, or came from voltages outside the log"
    return f"The first {seconds:.3g} s do not fit the rest ({why}): left out."


def beyond_sentences(name: str, learnt_on: LearntOn, u: FloatArray, sample_rate: float) -> list[str]:
    """In what a voltage [V] leaves the ranges of the part that was fitted; `name` is what it belongs to."""
    used = LearntOn.of(u, u, sample_rate)
    # The level of the displacement may change between two days.
    left = learnt_on.left_by(dataclasses.replace(used, displacement=learnt_on.displacement))
    if not left:
        return []
    return [
        f"{name} goes beyond what was fitted: {', and '.join(left)}. There the model is a guess: let the "
        "fitted part contain such swings."
    ]


def other_log_sentences(found: Identification) -> list[str]:
    """Which other logs the model misses, or all but their offset."""
    said, usual = [], max(found.held_out.rms, found.noise_floor)
    for each in found.validations:
        name, error, about_mean = Path(each.source).name, each.error.rms, each.without_mean.rms
        if about_mean > MISSED * usual:
            said.append(
                f"Other log {name}: the model misses it by {about_mean / usual:.2g} times the held-out error "
                f"({about_mean:.2g} µm rms without the mean): its gain, delay or loop is another."
            )
        elif error > MISSED * usual:
            offset = float(np.sqrt(error**2 - about_mean**2))
            said.append(f"Other log {name}: only its offset differs, by {offset:.2g} µm.")
    return said


def _left_out(found: Identification) -> list[str]:
    fit, flaws, said = found.fit, found.flaws, []
    if fit.left_out > SHORT * found.trained:
        said.append(unsettled_sentence(fit.left_out / found.sample_rate))
    spikes = int(np.count_nonzero(flaws.spikes[: found.trained])) + fit.spikes
    if spikes:
        said.append(
            f"{spikes} of the fitted samples {'is a spike' if spikes == 1 else 'are spikes'} of the sensor: "
            "left out."
        )
    if fit.jumps.size:
        said.append(
            f"Beside the motion the displacement jumps {counted(fit.jumps.size)}, first at "
            f"{float(found.record.time[fit.jumps[0]]):.6g} s: fitted with an offset of its own after it."
        )
    return said


def delay_sentences(delay: float, sample_rate: float, known: bool, estimated: bool) -> list[str]:
    """What to know of the samples by which the displacement lags the voltage."""
    if not known:
        used = f" The fit has {delay:.2g} samples of it." if delay > 0.0 else ""
        return [
            "The lag of the displacement is not known: the swings of the voltage differ too little, so it "
            f"looks like a wider loop.{used} Record swings of several sizes or frequencies, or pass delay= "
            "in samples."
        ]
    if not estimated:
        return []
    if delay > 0.99 * LONGEST_DELAY:
        return [
            f"The displacement lags the voltage by {LONGEST_DELAY:g} samples or more, the most that can be "
            "found: shift one of the columns, or resample the log."
        ]
    if delay > 0.1:
        return [
            f"The displacement lags the voltage by about {delay:.2g} samples "
            f"({1e3 * delay / sample_rate:.2g} ms), or its loop widens with speed: estimators take "
            f"delay={delay:.2g}."
        ]
    return []


def _creep(found: Identification) -> list[str]:
    if found.creep_known or max(each.creep for each in found.candidates) == 0.0:
        return []
    creep = found.best.creep
    percent = f"{100.0 * creep:.2g}" if creep < 1.0 else "over 100"
    has = f"creeps by {percent} %" if creep else "has none"
    return [
        "Creep is not known: the swings of the voltage differ too little and no rest follows, so it looks "
        f"like a wider loop. The model {has}: where the voltage rests it may be off. Record a rest, too."
    ]


def _centre(data: Data) -> list[str]:
    said = []
    x = data.x[data.counts]
    centre = float(np.mean(x))
    if abs(data.middle) > 0.1 * data.extent or abs(centre) > 0.1 * float(np.ptp(x)):
        said.append(
            f"The loop is not centred at zero (voltage {data.middle:.3g} V, displacement {centre:.4g} µm): "
            "set offset=True for estimators; HysteresisRLS does so by default."
        )
    turns = turning_voltages(data)
    tops = np.abs(turns - data.middle)
    if turns.size > 2 and np.ptp(tops[1:]) < 0.1 * data.extent:
        said.append("The voltage turns at one amplitude only: the parameters belong to that amplitude.")
    return said


def _is_small(found: Identification, error: float) -> bool:
    """Whether an error [µm] is one that good models leave."""
    return abs(error) <= SMALL * float(np.ptp(found.learnt_on.displacement))


def _remainder(found: Identification) -> list[str]:
    said = []
    floor, error = found.noise_floor, min(found.best.cross_validated, found.held_out.rms)
    small = _is_small(found, error)
    if error > ABOVE_NOISE * floor and not small:
        said.append(
            f"The error ({error:.2g} µm rms) is larger than the noise ({floor:.2g} µm): no model here "
            "explains the rest."
        )
    if not found.whiteness.is_white and not small:
        said.append(
            "The residual is not white: what is left is not noise but what the model cannot do "
            "(creep, drift, rate, minor loops); the standard errors are widened for it."
        )
    said += _oscillation(found)
    odd = _drift(found) or any(each.severity == "doubt" or each.name == "drift" for each in found.findings)
    if found.fit.form == "line" or found.held_out.rms <= 0.9 * found.line_held_out.rms:
        return said
    better = found.line_held_out.rms < 0.9 * found.held_out.rms
    if found.train.rms < 0.9 * found.line_train.rms:
        said.append(
            f"A straight line predicts the held-out part {'better' if better else 'about as well'} "
            f"({found.line_held_out.rms:.2g} µm rms, the model {found.held_out.rms:.2g}), though not the "
            "fitted part: do not use this model before another log confirms it. The stage or the signal has "
            "changed, rings or drifts, or a clock is off."
        )
    elif not odd:
        said.append("A straight line does about as well: the record shows little hysteresis.")
    return said


def _oscillation(found: Identification) -> list[str]:
    residual = found.residual[found.left_out : found.trained]
    strongest = Oscillation.of(residual, found.sample_rate)
    swings = found.learnt_on.frequency
    if strongest.share < OSCILLATES or swings is None or strongest.frequency < FASTER * swings[1]:
        return []
    return [
        f"{100.0 * strongest.share:.0f} % of the residual oscillates at {strongest.frequency:.3g} Hz: a "
        "resonance of the stage, or hum. No model here has it: move the voltage more smoothly, or find the "
        "source."
    ]


def _drift(found: Identification) -> list[str]:
    least = DRIFT_WORTH_A_WORD * found.train.rms
    if abs(found.fit.drift) > least and not _is_small(found, found.fit.drift):
        return [
            f"The displacement drifts by about {found.fit.drift:+.2g} µm over the fitted part. It is fitted "
            "beside the model, as creep that slows down: a steady drift goes on faster after the fitted part."
        ]
    if abs(found.drift) > least and not _is_small(found, found.drift):
        return [
            f"The error changes by about {found.drift:+.2g} µm along the record: the displacement drifts, or "
            "the model goes off in the held-out part."
        ]
    return []


def _worse_later(found: Identification) -> list[str]:
    if found.held_out.rms <= WORSE_ON_HELD_OUT * found.train.rms or _is_small(found, found.held_out.rms):
        return []
    return [
        f"The held-out error is {found.held_out.rms / found.train.rms:.1f} times the fitted one: the stage "
        "or the signal changes along the record."
    ]
