"""The mass-spring-damper, discretised exactly."""

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete

from piezoest.equations.mechanics import mechanics_coefficients


def continuous(frequency: float, damping: float) -> tuple[Any, Any]:
    omega = 2.0 * np.pi * frequency
    return np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]]), np.array([[0.0], [omega**2]])


@given(st.floats(10.0, 5000.0), st.one_of(st.floats(0.0, 3.0), st.just(1.0)))
def test_coefficients_are_the_held_discretisation(frequency: float, damping: float) -> None:
    dt = 2e-5
    a, b = continuous(frequency, damping)
    a_d, b_d, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), dt)
    a11, a12, a21, a22, b1, b2 = mechanics_coefficients(frequency, damping, dt)
    scale = np.array([1.0, 2.0 * np.pi * frequency])  # velocities in units of omega µm/s
    np.testing.assert_allclose(
        np.array([[a11, a12], [a21, a22]]) * scale / scale[:, None], a_d * scale / scale[:, None], atol=1e-11
    )
    np.testing.assert_allclose(np.array([b1, b2]) / scale, b_d[:, 0] / scale, atol=1e-11)
