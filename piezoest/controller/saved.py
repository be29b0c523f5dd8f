"""A controller as a JSON-safe dictionary, and the checks of a dictionary before it is used."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, dictionary, fields, finite, instance
from piezoest.compensators.limits import VoltageLimits
from piezoest.controller import slots, start, team
from piezoest.controller.shown import Event
from piezoest.estimators import saved_state
from piezoest.estimators.compiled import CompiledEstimator
from piezoest.layout import FIXED, NUMBER, Numbers, Record, by_name

FORMAT = 22
_FIELDS = (
    "sample_rate", "limits", "corridor", "gain", "feedback", "resonance", "learnt_on", "estimators", "state",
    "models", "planned", "events",
)  # fmt: skip


def check_head(name: str, data: Any) -> None:
    """Refuse what is no dictionary of a controller of this version."""
    saved_state.check_head("controller", name, FORMAT, data, _FIELDS)


def read_limits(data: Any) -> VoltageLimits:
    """Limits from a dictionary."""
    return VoltageLimits(**fields("limits", data, ("minimum", "maximum", "slew_rate", "sample_rate")))


def read_estimators(data: Any, state: Any) -> tuple[CompiledEstimator, ...]:
    """Estimators as they were made; what the state says of each is checked."""
    data = instance("estimators", data, list, "a list")
    if len(data) > slots.MOST:
        raise ValueError(f"estimators must be at most {slots.MOST}, got {len(data)}")
    found, chain = [], dictionary(dictionary(state).get("candidates"))
    for each in data:
        found.append(team.revived(each, dictionary(chain.get("model")).get("estimator")))
        chain = dictionary(chain.get("others"))
    return tuple(found)


def read_state(data: Any, layout: Record, begun: Any) -> Any:
    """State of a controller from its numbers by name."""
    return saved_state.check(data, layout, begun, _rules)


def _rules(state: Any) -> Iterator[tuple[str, Any]]:
    seeking = state["start"]
    rests = seeking["stage"] == start.REST
    yield "the readings at rest have a place each", not rests or seeking["samples"] < start.FIRST
    candidates = sum(1 for _ in slots.every(state["candidates"]))
    yield "what drives must be the line or a candidate", state["driving"] <= candidates


def models(layout: Record, settings: Any) -> list[dict[str, Any]]:
    """Numbers of the models in use, by name, which change though settings do not."""
    return [by_name(*each) for each in _inverses(layout, settings)]


def read_models(data: Any, layout: Record, settings: Any) -> Any:
    """Settings of a controller with the models that were saved."""
    settings = settings.copy()
    inverses = list(_inverses(layout, settings))
    if len(instance("models", data, list, "a list")) != len(inverses):
        raise ValueError(f"models must be {len(inverses)}, one for each candidate, got {len(data)}")
    for each, (kept, numbers) in zip(data, inverses, strict=True):
        numbers[...] = saved_state.check(each, changeable(kept), numbers, lambda state: ())
    return settings


def _inverses(layout: Record, settings: Any) -> Iterator[tuple[Any, Any]]:
    """Layout and numbers of each candidate's model."""
    numbers = slots.every(settings["candidates"])
    for each, own in zip(slots.layouts_in(layout.by_name["candidates"]), numbers, strict=True):
        yield each.by_name["inverse"], own["inverse"]


def changeable(layout: Record) -> Record:
    """The layout with numbers that may be others than at the start, but for its lengths."""
    changed = dict(layout.fields)
    for name, field in layout.fields:
        if isinstance(field, Numbers):
            changed[name] = Numbers(field.shape, NUMBER)
        elif field == FIXED and name not in layout.lengths:
            changed[name] = NUMBER
    return Record(tuple(changed.items()), layout.functions)


def block(r: FloatArray | None) -> Any:
    """Reference of a block that was planned and not learnt from; JSON has no NaN."""
    return None if r is None else [value if np.isfinite(value) else None for value in r.tolist()]


def read_events(data: Any) -> list[Event]:
    """Events from a list."""
    events = []
    for each in instance("events", data, list, "a list"):
        if (
            not isinstance(each, list | tuple)
            or len(each) != 3
            or not all(isinstance(t, str) for t in each[1:])
        ):
            raise ValueError(f"events must be [time, action, reason] each, got {each!r}")
        events.append(Event(finite("events", each[0]), each[1], each[2]))
    return events
