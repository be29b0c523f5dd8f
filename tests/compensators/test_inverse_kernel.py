"""A model handed over within compiled code, as the controller does it."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.compensators import inverse_kernel as kernel
from piezoest.compile import Record, Vector, compiled

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
