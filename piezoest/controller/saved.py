"""A controller as a JSON-safe dictionary, and what one must be before it is believed."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, array_1d, dictionary, fields, finite, instance
from piezoest.compensators.limits import VoltageLimits
from piezoest.controller import slots, start, team
from piezoest.controller.shown import Event
from piezoest.estimators import saved_state
from piezoest.estimators.compiled import CompiledEstimator
from piezoest.layout import FIXED, NUMBER, Kind, Numbers, Record, by_name

FORMAT = 1
_FIELDS = (
    "controller", "format", "sample_rate", "limits", "corridor", "gain", "feedback", "resonance",
    "learnt_on", "estimators", "state", "models", "planned", "events",
)  # fmt: skip


def check_head(name: str, data: Any) -> None:
    """Refuse what is no dictionary of a controller of this version."""
    instance("data", data, dict, "a dictionary that to_dict() gave")
    if "controller" not in data:
        raise ValueError('data has no "controller": pass what to_dict() of a controller gave')
    if data["controller"] != name:
        raise ValueError(f"data is of a {data['controller']!r}, not of a {name}")
    if data.get("format") != FORMAT:
        raise ValueError(f"data has format {data.get('format')!r}, this version reads {FORMAT}")
    fields("data", data, _FIELDS)


def limits(given: VoltageLimits) -> dict[str, Any]:
    """Limits as a dictionary."""
    return dataclasses.asdict(given)


def read_limits(data: Any) -> VoltageLimits:
    """Limits from a dictionary."""
    return VoltageLimits(**fields("limits", data, ("minimum", "maximum", "slew_rate", "sample_rate")))


def read_estimators(data: Any, state: Any) -> tuple[CompiledEstimator, ...]:
    """Estimators as they were made; what the state says of each is checked."""
    data = instance("estimators", data, list, "a list")
    if len(data) > len(slots.NAMES):
        raise ValueError(f"estimators must be at most {len(slots.NAMES)}, got {len(data)}")
    saved = dictionary(dictionary(state).get("candidates"))
    return tuple(
        team.revived(each, dictionary(saved.get(name)).get("estimator"))
        for name, each in zip(slots.NAMES, data, strict=False)
    )


def read_state(data: Any, layout: Record, begun: Any) -> Any:
    """State of a controller from its numbers by name."""
    return saved_state.check(data, layout, begun, _rules)


def _rules(state: Any) -> Iterator[tuple[str, Any]]:
    seeking = state["start"]
    rests = seeking["stage"] == start.REST
    yield "the readings at rest have a place each", not rests or seeking["samples"] < start.FIRST


def models(layout: Record, settings: Any) -> dict[str, Any]:
    """Numbers of the models in use, by name, which change though settings do not."""
    return {
        name: by_name(_inverse(layout, name), settings["candidates"][name]["inverse"])
        for name in _used(layout)
    }


def read_models(data: Any, layout: Record, settings: Any) -> Any:
    """Settings of a controller with the models that were saved."""
    settings = settings.copy()
    fields("models", data, _used(layout))
    for name in _used(layout):
        inverse = settings["candidates"][name]["inverse"]
        kept = changeable(_inverse(layout, name))
        settings["candidates"][name]["inverse"] = saved_state.check(
            data[name], kept, inverse, lambda state: ()
        )
    return settings


def _used(layout: Record) -> list[str]:
    """Names of the candidates that there are."""
    candidates: Any = layout.by_name["candidates"]
    return [name for name, field in candidates.fields if isinstance(field, Record)]


def _inverse(layout: Record, name: str) -> Any:
    """Layout of the numbers of a candidate's model."""
    candidates: Any = layout.by_name["candidates"]
    return candidates.by_name[name].by_name["inverse"]


def changeable(layout: Record) -> Record:
    """The layout with numbers that may be others than at the start, but for its lengths."""
    every = ((name, field if name in layout.lengths else _changed(field)) for name, field in layout.fields)
    return Record(tuple(every), layout.functions)


def _changed(field: Any) -> Any:
    if isinstance(field, Numbers):
        return Numbers(field.shape, NUMBER)
    return NUMBER if isinstance(field, Kind) and field == FIXED else field


def block(r: FloatArray | None) -> Any:
    """Reference of a block that was planned and not learnt from; JSON has no NaN."""
    return None if r is None else [value if np.isfinite(value) else None for value in r.tolist()]


def read_block(data: Any) -> FloatArray | None:
    """Reference of a block from a list."""
    return None if data is None else array_1d("planned", data, allow_nan=True).copy()


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
