"""Making a controller: its checked arguments, layouts, and first numbers."""

import math
from typing import Any

from piezoest._checks import finite, fraction, instance, integer, moderate, non_negative, positive
from piezoest.compensators.limits import VoltageLimits, check_rate
from piezoest.controller import (
    candidate,
    duhem,
    duhem_rls,
    homing,
    kernel,
    pace,
    recorded_loop,
    recorder,
    slots,
)
from piezoest.controller.feedback import FASTEST
from piezoest.estimators.compiled import CompiledEstimator
from piezoest.layout import Record, new
from piezoest.models import LearntModel, LearntOn
from piezoest.models.learnt_on import allowed

# Least range and largest size of the voltage [V].
LEAST_RANGE, LARGEST_VOLTAGE = 1e-6, 1e6


def checked_limits(limits: Any, sample_rate: float) -> Any:
    """Refuse limits that keep no stage whole."""
    expected = "VoltageLimits(minimum, maximum): give the voltages that the stage bears"
    limits = instance("limits", limits, VoltageLimits, expected)
    low, high = limits.minimum, limits.maximum
    if not (math.isfinite(low) and math.isfinite(high)):
        raise ValueError(
            f"limits must be finite, got {low:g} V to {high:g} V: they are what keeps a stage whole while "
            "nothing is known of it; give the voltages that stage and amplifier bear"
        )
    if max(-low, high) > LARGEST_VOLTAGE or high - low < LEAST_RANGE:
        raise ValueError(
            f"limits must lie within ±{LARGEST_VOLTAGE:g} V and {LEAST_RANGE:g} V apart, got {low:g} V to "
            f"{high:g} V: check the unit"
        )
    check_rate(limits, sample_rate)
    return limits


def known_gain(gain: Any, stroke: Any, model: LearntModel | None, limits: VoltageLimits) -> float:
    """Return the gain that a user knows [µm/V]; zero if none is given."""
    given = {"gain": gain, "stroke": stroke, "model": model}
    names = [name for name, value in given.items() if value is not None]
    if len(names) > 1:
        both = "both" if len(names) == 2 else "all"
        raise ValueError(f"{' and '.join(names)} {both} give the gain: pass one of them")
    if gain is not None:
        return _gain("gain", gain)
    if stroke is not None:
        return _gain("stroke", stroke) / (limits.maximum - limits.minimum)
    if model is not None:
        return _gain("slope of model", model.model.line[0])
    return 0.0


def _gain(name: str, value: Any) -> float:
    """A number other than zero, in the units of this library."""
    number = finite(name, value)
    if number == 0.0:
        raise ValueError(f"{name} must not be zero: leave it out if it is not known")
    moderate(f"size of {name}", abs(number))
    return number


def options(
    sample_rate: float, corridor: Any, gain: Any, feedback: Any, resonance: Any, learnt_on: Any
) -> dict[str, Any]:
    """Return what users choose beside limits and estimators, checked."""
    feedback = 0.0 if feedback is None else non_negative("feedback", feedback)
    if feedback > FASTEST * sample_rate:
        raise ValueError(
            f"feedback must be at most {FASTEST * sample_rate:g} 1/s, {FASTEST:g} of sample_rate, got "
            f"{feedback:g}: it is to be far slower than the stage"
        )
    return {
        "corridor": fraction("corridor", corridor),
        "gain": finite("gain", gain) and _gain("gain", gain),
        "feedback": feedback,
        "resonance": None if resonance is None else moderate("resonance", resonance),
        "learnt_on": None if learnt_on is None else LearntOn.from_dict(learnt_on).to_dict(),
    }


def sweep(
    limits: VoltageLimits, sample_rate: float, amplitude: Any, frequency: Any, cycles: Any
) -> tuple[float, float, float]:
    """Return amplitude [V], cycles of a sample and cycles of a sweep that erases hysteresis."""
    most = 0.5 * (limits.maximum - limits.minimum)
    amplitude = most if amplitude is None else positive("amplitude", amplitude)
    if amplitude > most:
        raise ValueError(f"amplitude must be at most {most:g} V, half the range, got {amplitude:g} V")
    frequency = moderate("frequency", frequency)
    if frequency > homing.FASTEST * sample_rate:
        raise ValueError(
            f"frequency must be at most {homing.FASTEST * sample_rate:g} Hz, {homing.FASTEST:g} of "
            f"sample_rate, got {frequency:g} Hz"
        )
    return amplitude, frequency / sample_rate, float(integer("cycles", cycles, 1, int(homing.MOST)))


def _settings_of(sample_rate: float, limits: VoltageLimits, options: dict[str, Any]) -> dict[str, Any]:
    """Settings of the kernel but for the candidates."""
    width, learnt_on = limits.maximum - limits.minimum, options["learnt_on"]
    # Without a user's model all ranges are allowed.
    r = u = (-math.inf, math.inf)
    if learnt_on is not None:
        r, u = allowed(learnt_on["displacement"]), allowed(learnt_on["voltage"])
    return {
        "minimum": limits.minimum,
        "maximum": limits.maximum,
        "largest_step": limits.largest_step,
        "doubling": max(5.0, 4e-3 * sample_rate),
        "corridor": options["corridor"],
        "feedback": options["feedback"] / sample_rate,
        "shortest": sample_rate / (pace.FAST * options["resonance"]) if options["resonance"] else 0.0,
        "allowed": {"lowest_r": r[0], "highest_r": r[1], "lowest_u": u[0], "highest_u": u[1]},
        "start": {
            "gain": options["gain"],
            # If the gain is known, a first way only has to confirm it.
            "way": (0.005 if options["gain"] else 0.02) * width,
            "longest": 0.1 * width,
            "ramp": max(4.0, 7e-3 * sample_rate),
            "window": max(3.0, 2.5e-3 * sample_rate),
        },
    }


def room(
    sample_rate: float,
    limits: VoltageLimits,
    options: dict[str, Any],
    estimators: tuple[CompiledEstimator, ...],
) -> tuple[tuple[Record, Record], tuple[Any, Any]]:
    """Layouts of state and settings, and both as they are before the start."""
    pairs, values, given = list[tuple[Record, Record]](), [], []
    for estimator in estimators:
        inverse = estimator.model.inverse_settings(sample_rate)
        pairs.append(candidate.layouts(estimator.layouts, estimator.model.inverse.layouts(inverse)))
        values.append({"estimator": estimator.state})
        given.append({"estimator": estimator.settings, "inverse": inverse, "by_path": 1.0})
    if estimators:
        pairs.append(candidate.layouts(duhem_rls.LAYOUTS, duhem.LAYOUTS))
        values.append({})
        given.append({"inverse": {"p": duhem.LINE}})
        pairs.append(candidate.layouts(recorder.LAYOUTS, recorded_loop.LAYOUTS))
        values.append({})
        given.append({"estimator": {"fine": recorder.LONG * sample_rate}})
    layouts = kernel.layouts(slots.layout([own[0] for own in pairs]), slots.layout([own[1] for own in pairs]))
    fixed = _settings_of(sample_rate, limits, options)
    fixed |= {"candidates": slots.values(given), "recorded": len(given) or -1.0}
    return layouts, (new(layouts[0], candidates=slots.values(values)), new(layouts[1], **fixed))
