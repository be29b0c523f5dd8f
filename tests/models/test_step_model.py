"""A model that two functions of one sample describe, compiled: simulated, inverted, in a stage, fitted."""

import sys
from dataclasses import dataclass
from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import piezoest as pz
from piezoest.compile import inlined
from piezoest.models import StepModel, model_from_dict
from piezoest.models._base import REGISTERED

RATE = 1000.0
R = pz.signals.triangle(5.0, 5.0, periods=2, sample_rate=RATE).values


@dataclass(frozen=True, slots=True)
class Slack(StepModel):
    """A line through a play, and a line beside it."""

    gain: float
    slack: float
    width: float
    offset: float = 0.0

    parameter_names = ("gain", "slack", "width")
    parameter_units = ("µm/V", "µm/V", "V")
    state_names = ("play",)


@inlined
def displacement(state: Any, u_0: Any, u: Any, constants: Any) -> Any:
    state[0] = np.fmax(u - constants[2], np.fmin(u + constants[2], state[0]))
    return constants[0] * u + constants[1] * state[0]


@inlined
def voltage(state: Any, u_0: Any, x: Any, constants: Any) -> Any:
    inside = (x - constants[1] * state[0]) / constants[0]
    below = (x - constants[1] * constants[2]) / (constants[0] + constants[1])
    above = (x + constants[1] * constants[2]) / (constants[0] + constants[1])
    return min(max(inside, below), above)


MODEL = Slack(0.15, 0.03, 5.0, offset=0.3)
# The same operator.
PLAYS = pz.PrandtlIshlinskii(0.15, [5.0], [0.03], 0.3)


def test_it_is_simulated_and_inverted() -> None:
    np.testing.assert_allclose(MODEL.simulate(8.0 * R), PLAYS.simulate(8.0 * R), atol=1e-12)
    np.testing.assert_allclose(MODEL.invert(R), PLAYS.invert(R), atol=1e-12)
    with pytest.raises(ValueError, match="above zero"):
        Slack(0.15, -0.03, 5.0).invert(R)
    with pytest.raises(ValueError, match="width must be finite"):
        Slack(0.15, 0.03, np.nan)
    assert model_from_dict(MODEL.to_dict()) == MODEL


def test_a_compensator_and_a_stage_are_made_of_it() -> None:
    stage, u = pz.SimulatedStage(RATE, MODEL), pz.InverseCompensator(MODEL).run(R)
    np.testing.assert_allclose(u, MODEL.invert(R), atol=1e-12)
    np.testing.assert_allclose(stage.run(u), R, atol=1e-12)
    # Gain and temperature change it as any other.
    options: dict[str, Any] = {"gain_schedule": [[0.0, 1.0], [0.4, 1.2]], "temperature": 40.0}
    stages = [pz.SimulatedStage(RATE, model, **options) for model in (MODEL, PLAYS)]
    np.testing.assert_allclose(stages[0].run(8.0 * R), stages[1].run(8.0 * R), atol=1e-12)


def test_its_inverse_is_exported() -> None:
    compensator = pz.InverseCompensator(MODEL, pz.VoltageLimits(-60.0, 60.0))
    try:
        exported = pz.export.CompiledController(pz.export.c(None, compensator))
    except ValueError as absent:
        pytest.skip(str(absent))
    np.testing.assert_array_equal(exported.run(R, R), compensator.run(R))


@pytest.mark.parametrize("method", ["single-shooting", "multiple-shooting"])
def test_a_fit_finds_it(method: Any) -> None:
    u = 8.0 * R
    x = MODEL.simulate(u) + 1e-3 * np.random.default_rng(0).standard_normal(u.size)
    fit = pz.BatchFit(RATE, initial_model=Slack(0.12, 0.02, 6.0), offset=True, method=method).fit(u, x)
    assert fit.success
    assert isinstance(fit.model, Slack)
    assert np.all(np.abs(fit.theta[:4] - [*MODEL.theta, MODEL.offset]) < 4.0 * fit.standard_errors[:4])
    with pytest.raises(ValueError, match="Slack has no form"):
        pz.MovingHorizon(RATE, initial_model=MODEL)


def test_a_compensator_goes_over_to_it_without_a_bump() -> None:
    """Its play then stands where the voltage's turning points have left it."""
    both = []
    for model in (MODEL, PLAYS):
        compensator = pz.InverseCompensator(pz.LinearGain(0.17))
        before = compensator.run(R[:333])
        compensator.model = model
        both.append([*before, *compensator.run(R[333:])])
        assert not compensator.status.projected
    np.testing.assert_allclose(both[0], both[1], atol=1e-9)
    assert np.abs(np.diff(both[0])).max() < 2.0 * np.abs(np.diff(R)).max() / 0.15


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"parameter_names": None}, "Mine.parameter_names must be a tuple"),
        ({"fields": ("gain", "state_names")}, "Mine.state_names must be a tuple"),
        ({"parameter_units": ("µm/V", "V")}, "one unit per parameter"),
        ({"fields": ("gian",)}, "must have the fields .'gain'.*"),
        ({"functions": {"displacement": displacement}}, "has no function voltage"),
        ({"functions": {"displacement": lambda *_: 0.0, "voltage": voltage}}, "mark it @inlined"),
    ],
)
def test_says_what_is_wrong(monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any], words: str) -> None:
    given: dict[str, Any] = {
        "fields": ("gain",), "functions": {"displacement": displacement, "voltage": voltage},
        "parameter_names": ("gain",), "parameter_units": ("µm/V",), "state_names": ("last",), **changes,
    }  # fmt: skip
    fields, functions = given.pop("fields"), given.pop("functions")
    module = ModuleType(f"step_model_of_a_test_{words.replace(' ', '_')}")
    vars(module).update(functions)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    annotations = dict.fromkeys((*fields, "offset"), float)
    body = {"__module__": module.__name__, "__annotations__": annotations, "offset": 0.0, **given}
    with patch.dict(REGISTERED):
        mine: Any = dataclass(frozen=True, slots=True)(type("Mine", (StepModel,), body))
        with pytest.raises(TypeError, match=words):
            mine(0.15).simulate(np.zeros(3))
