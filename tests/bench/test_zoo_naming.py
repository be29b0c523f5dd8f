"""What a controller said about a fault is compared with what it was, and how soon all was as before."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from piezoest._checks import FloatArray
from piezoest.bench.zoo.faults import ANY, FAULTS
from piezoest.bench.zoo.judging import named, recovery
from piezoest.bench.zoo.rig import Rig
from piezoest.controller.faults import MEANINGS
from piezoest.controller.shown import Event
from tests.bench.shared import rig_with


def after(rig: Rig, *said: tuple[float, str]) -> dict[str, Any]:
    """What is found where faults are named some periods after the beginning of the fault."""
    start = rig.fault.start / rig.sample_rate
    events = [Event(start + periods / 10.0, "fell back", f"{name}: so it is") for periods, name in said]
    return named(rig, SimpleNamespace(events=events, status=SimpleNamespace(driving="line")))


def test_the_right_name_counts_and_how_soon() -> None:
    rig = rig_with("sensor-factor", "permanent")
    found = after(rig, (-2.0, "scaled"), (0.5, "saturated"), (1.5, "reversed"), (2.5, "scaled"))
    assert found["named_right"] is True
    assert found["named_periods"] == pytest.approx(1.5)
    assert found["named"] == "scaled; saturated; reversed"
    assert found["driver"] == "line"
    wrong = after(rig, (-2.0, "scaled"), (1.0, "no response"))
    assert wrong["named_right"] is False
    assert wrong["named_periods"] is None
    assert after(rig_with("hum", "permanent"), (1.0, "scaled"))["named_right"] is None


def test_of_what_was_there_from_the_start_silence_alone_is_named() -> None:
    begins = {kind for kind, each in FAULTS.items() if "from-start" in each.modes}
    asked = {kind for kind in begins if rig_with(kind, "from-start").fault.names}
    assert asked == {"amplifier-frozen", "stage-stuck", "sensor-constant", "sensor-noise"}
    assert {name for kind in FAULTS.values() for name in kind.names} == set(ANY) <= set(MEANINGS)


def errors(rig: Rig, *cycles: float) -> FloatArray:
    """0.1 µm, and others in the cycles after the fault."""
    error = np.full(rig.plain.values.size, 0.1)
    for k, value in enumerate(cycles):
        begin = rig.fault.stop + k * rig.plain.cycle
        error[begin + 5 : begin + 8] = value
    return error


def test_the_first_cycle_that_is_as_good_as_before_counts() -> None:
    rig = rig_with("gap", "transient")
    assert recovery(rig, errors(rig), 0.01) == {"recovery": True, "recovered": 1}
    assert recovery(rig, errors(rig, 0.5, 0.13, 0.119), 0.01)["recovered"] == 3
    assert recovery(rig, errors(rig, 0.5, 0.13), 0.2)["recovered"] == 2
    assert recovery(rig, errors(rig, *[0.5] * 20), 0.01) == {"recovery": True, "recovered": None}
    for other in (rig_with("gap", "permanent"), rig_with("gap", "transient", reference="chirp")):
        assert recovery(other, errors(other), 0.01) == {"recovery": False, "recovered": None}
    early = rig_with("glitch", "transient")
    assert recovery(early, errors(early, 0.5), 0.01)["recovered"] == 2
