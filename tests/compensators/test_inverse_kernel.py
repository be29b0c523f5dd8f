"""One kernel for all inverses: a model handed over within compiled code, and a model that brings its own."""

import sys
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from numba.extending import register_jitable

import piezoest as pz
from piezoest.compensators import inverse_kernel as kernel
from piezoest.compile import Record, Vector, compiled
from piezoest.layout import FIXED, NUMBER, record
from piezoest.models import Model

R = 4.0 * np.sin(np.arange(600) / 40.0)
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)


@compiled
def set_model(state: Record, settings: Record, model: Vector, hysteretic: int) -> bool:
    found: bool = kernel.set_model(state, settings, model, hysteretic != 0)
    return found


@pytest.mark.parametrize(
    "model",
    [
        pz.ColemanHodgdon(0.03, 0.15, 0.006, 0.2),
        pz.ColemanHodgdon(0.03, 0.15, 0.012, 0.2),  # not admissible
        pz.LinearGain(0.2, -0.1),
    ],
)
def test_a_model_handed_over_in_compiled_code_is_as_one_that_is_set(model: Any) -> None:
    compensator, other = pz.InverseCompensator(START), pz.InverseCompensator(START)
    for each in (compensator, other):
        each.run(R[:200])
    assert compensator.hand_over_due
    compensator.model = model
    hysteretic = isinstance(model, pz.ColemanHodgdon)
    numbers = np.array([*model.theta, *[0.0] * (3 - model.theta.size), model.offset])
    assert set_model.of(*other.layouts)(other.state, other.settings, numbers, hysteretic)
    np.testing.assert_array_equal(compensator.run(R[200:]), other.run(R[200:]))
    np.testing.assert_array_equal(numbers[: model.theta.size], compensator.model.theta)


# A model with its inverse, in one file: x = gain (u + drift of the voltage's last change).


def layouts(settings: dict[str, Any]) -> Any:
    return record(__name__, moved=NUMBER), record(gain=FIXED, share=FIXED)


@register_jitable
def wanted(state: Any, settings: Any, r: Any) -> Any:
    share = settings.inverse.share
    return (r / settings.inverse.gain + share * state.voltage) / (1.0 + share)


@register_jitable
def follow(state: Any, settings: Any, wanted: Any, given: Any) -> None:
    state.inverse.moved = given - state.voltage


@register_jitable
def expected(state: Any, settings: Any) -> Any:
    return settings.inverse.gain * (state.voltage + settings.inverse.share * state.inverse.moved)


@register_jitable
def place(state: Any, settings: Any) -> None:
    state.inverse.moved = 0.0


@dataclass(frozen=True, slots=True)
class Leading(Model):
    gain: float
    share: float
    offset: float = 0.0

    parameter_names: ClassVar[tuple[str, ...]] = ("gain", "share")
    inverse: ClassVar[Any] = sys.modules[__name__]

    @property
    def is_admissible(self) -> bool:
        return self.gain > 0.0

    def inverse_settings(self, sample_rate: float | None) -> dict[str, Any]:
        return {"gain": self.gain, "share": self.share}

    def simulate(self, u: Any) -> Any:
        return self.gain * (u + self.share * np.diff(u, prepend=0.0))


def test_a_model_brings_its_inverse_along() -> None:
    model = Leading(0.2, 0.3)
    compensator = pz.InverseCompensator(model, transfer_samples=0)
    u = compensator.run(R)
    np.testing.assert_allclose(model.simulate(u), R, atol=1e-12)
    compensator.model = Leading(0.25, 0.1)
    x = Leading(0.25, 0.1).simulate(np.append(u, compensator.run(R)))
    np.testing.assert_allclose(x[R.size + 1 :], R[1:], atol=1e-12)
    compensator.reset()
    np.testing.assert_array_equal([compensator.step(r) for r in R.tolist()], u)


def test_a_model_s_own_inverse_is_exported() -> None:
    compensator = pz.InverseCompensator(Leading(0.2, 0.3), pz.VoltageLimits(-60.0, 60.0))
    try:
        exported = pz.export.CompiledController(pz.export.c(None, compensator))
    except ValueError as absent:
        pytest.skip(str(absent))
    np.testing.assert_array_equal(exported.run(R, R), compensator.run(R))
