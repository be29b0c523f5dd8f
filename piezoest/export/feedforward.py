"""An `AdaptiveFeedforward` in C99: its kernel, translated, with the models in use among its state."""

from collections.abc import Iterable
from textwrap import wrap
from typing import Any

import numpy as np

from piezoest.controller import kernel, saved
from piezoest.controller.adaptive_feedforward import AdaptiveFeedforward
from piezoest.controller.faults import FAULTS, OTHER_GAIN
from piezoest.controller.shown import STAGES
from piezoest.export.c_translator import call
from piezoest.export.c_values import Number, Root, Struct, literal
from piezoest.export.generated import CCode, estimator_lines, file_of, rendered
from piezoest.layout import ABSENT, FIXED, Field, Numbers, Record

# Faults of the readings before the first event that is none.
FIRST_EVENT = int(OTHER_GAIN) - 1
# Where that is not what was exported.
_BEGUN = """
/* Before anything was known. */
static const {name}_state begun_state = {start};
"""


def code(controller: AdaptiveFeedforward, name: str, precision: Any) -> CCode:
    """Generate the code of a controller in its present state."""
    data = controller.to_dict()
    estimators = saved.read_estimators(data["estimators"], data["state"])
    file = file_of(name, precision, tuple(each for known in estimators for each in known.unneeded))
    fresh = controller.copy()
    fresh.reset()
    now, anew = _state(controller), _state(fresh)
    file.struct(now.layout, "state")

    def call_of(function: Any, *numbers: str) -> str:
        given = [Number(each, "real") for each in numbers]
        return call(file, function, [now, now.field("settings"), *given])

    step, learn = call_of(kernel.step, "r"), call_of(kernel.learn, "u", "x")
    begin = call_of(kernel.begin, "voltage")
    resume = call_of(kernel.resume, "voltage", "displacement")
    turn = f"frequency * {literal(1.0 / controller.sample_rate, file.single)}"
    home, fault = call_of(kernel.home, "amplitude", turn, "cycles"), call_of(kernel.fault)
    begun = ""
    if anew.values.tobytes() != now.values.tobytes():
        begun = _BEGUN.format(name=name, start=file.start(anew.layout, anew.values))
    limits, named = controller.limits, [f"{number} {each}" for number, each in enumerate(FAULTS) if each]
    return rendered(
        file,
        "feedforward",
        [
            f"AdaptiveFeedforward at {controller.sample_rate:g} Hz, corridor {data['corridor']:g}.",
            *([f"Gain: about {data['gain']:g} um/V."] if data["gain"] else []),
            *([f"Feedback: {data['feedback']:g} 1/s."] if data["feedback"] else []),
            *([f"Resonance: {data['resonance']:g} Hz."] if data["resonance"] else []),
            f"Limits: {limits}.",
            *(line for each in data["estimators"] for line in estimator_lines(each)),
        ],
        {
            "limits": f"{limits.minimum:g} V to {limits.maximum:g} V",
            "stages": _numbered(STAGES),
            "models": _numbered(each.name for each in controller.candidates),
            "faults": ", ".join(("0 none", *named[:FIRST_EVENT], named[-1])),
            "events": "\n * ".join(wrap(", ".join(named[FIRST_EVENT:-1]), 100)),
        },
        {
            "start": file.start(now.layout, now.values),
            "begun": begun,
            "anew": "begun" if begun else "start",
            "functions": file.text(f"{step} {learn} {begin} {resume} {home} {fault}"),
            "minimum": literal(limits.minimum, file.single),
            "maximum": literal(limits.maximum, file.single),
            "step": step,
            "learn": learn,
            "begin": begin,
            "resume": resume,
            "home": home,
            "fault": fault,
        },
        learns=bool(estimators),
    )


def _numbered(names: Iterable[str]) -> str:
    return ", ".join(f"{number} {name}" for number, name in enumerate(names))


def _state(controller: AdaptiveFeedforward) -> Struct:
    """All that changes: the state, and beside it the settings, of which the models in use change."""
    state, settings = controller.layouts
    layout = Record((*state.fields, ("settings", _settled(settings))), state.functions)
    values = np.zeros((), layout.dtype)
    for name, _ in state.fields:
        values[name] = controller.state[name]
    values["settings"] = controller.settings
    return Struct("state->", layout, values, Root("state"), "state")


def _settled(field: Field, name: str = "") -> Field:
    """Layout of settings that stay as they are, but for the models."""
    if isinstance(field, Record):
        if name == "inverse":
            return saved.changeable(field)
        return Record(tuple((name, _settled(inner, name)) for name, inner in field.fields), field.functions)
    if isinstance(field, Numbers):
        return Numbers(field.shape, FIXED) if field != ABSENT else field
    return FIXED
