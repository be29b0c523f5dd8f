"""What a controller shows of itself: what happened, who drives, and models in µm."""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from piezoest.controller import candidate, faults, silence, slots
from piezoest.controller.pace import WAVE
from piezoest.equations import loop_inverse, play_inverse
from piezoest.layout import Named
from piezoest.models import ColemanHodgdon, LinearGain, Model, PrandtlIshlinskii
from piezoest.models.learnt_on import ends, figure

STAGES = ("seeking", "approaching", "running", "homing")


@dataclass(frozen=True, slots=True)
class Event:
    """Something that a controller noticed or did.

    Parameters
    ----------
    time : float
        Time since the controller was made or reset [s].
    action : str
        ``"fell back"`` (to the line, for the readings are at fault), ``"resumed"`` or ``"went on"``.
    reason : str
        Why, with the figures.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.Event(0.5, "fell back", "no response: the readings stand still").name
    'no response'
    """

    time: float
    action: str
    reason: str

    @property
    def name(self) -> str:
        """Short name of what was noticed, with which the reason begins; empty when it is over."""
        return self.reason.partition(": ")[0] if ": " in self.reason else ""


@dataclass(frozen=True, slots=True)
class ControllerStatus:
    """What happened to the samples that a controller was given: see `AdaptiveFeedforward.status`."""

    samples: int
    missing: int
    stage: str
    driving: str
    fault: str
    saturated: int
    slewed: int
    switches: int


@dataclass(frozen=True, slots=True)
class Candidate:
    """A model that can drive: see `AdaptiveFeedforward.candidates`."""

    name: str
    missed: float | None
    drives: bool
    model: Model | None


def fault(state: Any, settings: Any) -> str:
    """Return the name of the readings' fault; empty if there is none."""
    return faults.FAULTS[int(silence.fault(Named(state), Named(settings)))]


def event(state: Any, sample_rate: float, learnt_on: Any) -> Event:
    """Return what was noticed last."""
    number, seen = state["notice"], state["seen"]
    time = float(seen["samples"]) / sample_rate
    name = faults.FAULTS[int(number)]
    if not name:
        return Event(time, "resumed", "the readings follow the voltage again")
    action = "fell back" if number == state["readings"]["fault"] else "went on"
    figures = _figures(state, sample_rate, learnt_on)
    return Event(time, action, f"{name}: {faults.MEANINGS[name].format_map(figures)}")


def _figures(state: Any, sample_rate: float, learnt_on: Any) -> dict[str, Any]:
    """Figures for the texts in `faults.MEANINGS`: times in s, the lag in ms, the loop that it makes in %."""
    start, seen = state["start"], state["seen"]
    period, lag = max(float(state["pace"]["period"]), 1.0), float(start["lag"])
    figures = {
        "gain": float(start["gain"]) + 0.0,
        "gain_before": float(start["gain_before"]) + 0.0,
        "wanted": seen["r"],
        "there": seen["x"],
        "limit": seen["u"],
        "silence": float(state["silent"]) / sample_rate,
        "frequency": sample_rate / period,
        "lag": 1e3 * lag / sample_rate,
        "width": 100.0 * WAVE * lag / period,
    }
    if learnt_on is None:
        return figures
    units = {"displacement": "µm", "voltage": "V"}
    ranges = {name: ends(learnt_on[name], unit) for name, unit in units.items()}
    return figures | ranges | {name: figure(float(seen[name])) for name in ("r", "u")}


def misses(state: Any) -> list[float | None]:
    """Return the recent error of the line and of each candidate [µm]; None if it is unknown."""
    unit, found = abs(float(state["unit"])), list[float | None]()
    for score in (state["score"], *(each["score"] for each in slots.every(state["candidates"]))):
        missed = unit * float(candidate.missed(Named(score)))
        found.append(missed if score["weight"] > 0.0 and math.isfinite(missed) else None)
    return found


def line(state: Any) -> LinearGain | None:
    """Return the straight line; None until its gain is known."""
    gain, centre = float(state["line"]["gain"]), float(state["line"]["centre"])
    known = gain != 0.0 and math.isfinite(gain) and math.isfinite(centre)
    return LinearGain(gain, centre) if known else None


def model(start: Model, state: Any, settings: Any, place: int) -> Model | None:
    """Return the model in use of a candidate, in µm and V; None until there is one."""
    own, fixed = (list(slots.every(each["candidates"]))[place] for each in (state, settings))
    if own["usable"] == 0.0:
        return None
    units = Units(
        *(float(each) for each in (own["centre"], own["scale"], own["shift"], state["zero"], state["unit"]))
    )
    return _KINDS[start.inverse](start, fixed["inverse"], units)


class Units(NamedTuple):
    """What a model's numbers are relative to: u = centre + scale v, x = zero + unit (shift + scale f(v))."""

    centre: float
    scale: float
    shift: float
    zero: float
    unit: float

    def offset(self, own: Any, slope: float) -> float:
        """Displacement at 0 V from a model's own offset and its slope, both in its units [µm]."""
        return self.zero + self.unit * (self.shift + self.scale * float(own) - slope * self.centre)


def _loop(start: Any, numbers: Any, units: Units) -> Model:
    a, b, c = float(numbers["a"]), float(numbers["b"]), float(numbers["c"])
    unit, offset = units.unit, units.offset(numbers["offset"], c)
    if b == 0.0:
        return LinearGain(unit * c, offset)
    return ColemanHodgdon.from_loop(a / units.scale, unit * b, unit * c, offset)


def _plays(start: Any, numbers: Any, units: Units) -> Model:
    thresholds, bends, gains = numbers["thresholds"], numbers["bends"], numbers["creep_gains"]
    changes = numbers["bend_weights"].reshape(bends.size, -1 if bends.size else 1)
    unit, slope = units.unit, float(numbers["gain"] + numbers["weights"].sum())
    return PrandtlIshlinskii(
        unit * float(numbers["gain"]),
        units.scale * thresholds,
        unit * numbers["weights"],
        units.offset(numbers["offset"], slope),
        creep=dataclasses.replace(start.creep, gains=gains) if gains.size else None,
        bends=units.centre + units.scale * bends,
        bend_weights=unit * changes,
        sample_rate=start.sample_rate,
    )


_KINDS: dict[Any, Callable[..., Model]] = {loop_inverse: _loop, play_inverse: _plays}
