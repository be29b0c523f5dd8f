"""Creep as first-order terms."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from piezoest.equations.creep import creep_step

GAINS = np.array([0.01, 0.02, 0.005])
TIME_CONSTANTS = np.array([0.01, 0.1, 1.0])
SAMPLE_RATE = 1000.0
DECAYS = np.exp(-1.0 / (SAMPLE_RATE * TIME_CONSTANTS))


def record(w: Any) -> Any:
    z = np.zeros(3)
    return np.array([creep_step(z, value, GAINS, DECAYS) for value in w])


def test_solves_the_differential_equation() -> None:
    w = np.array([1.0, 3.0, -2.0, 0.5])
    z = np.zeros(3)
    for value in w:
        solution = solve_ivp(
            lambda t, z, value=value: (GAINS * value - z) / TIME_CONSTANTS,
            (0.0, 1.0 / SAMPLE_RATE), z, rtol=1e-12, atol=1e-15,
        )  # fmt: skip
        z = solution.y[:, -1]
    assert record(w)[-1] == pytest.approx(z.sum(), abs=1e-12)
