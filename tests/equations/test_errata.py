"""What the paper prints or leaves open, and what it has to mean; for (B1) see test_coleman_hodgdon."""

from __future__ import annotations

import numpy as np
import pytest

from piezoest.equations import coleman_hodgdon as ch

TABLE_I = [
    (3.26e-2, 0.136, 5.96e-3),
    (1.91e-2, 0.149, 4.05e-3),
    (2.1e-2, 0.147, 4.29e-3),
    (1.59e-2, 0.155, 3.55e-3),
    (3.32e-2, 0.136, 6.15e-3),
]


def slope_of_the_voltage(place: float, s: float, a: float, b: float, c: float) -> float:
    """Derivative of u_h by r at w_h = place·b/a, for r that moves with sign s: (14) and (17)."""
    return (s - float(ch.inverse_rate(place * b / a, s, a, b, c))) / (c * s)


@pytest.mark.parametrize("theta", TABLE_I)
@pytest.mark.parametrize("s", [1.0, -1.0])
def test_switching_by_the_reference_needs_the_admissible_set(
    theta: tuple[float, float, float], s: float
) -> None:
    """(C3) switches on the voltage, (17) on the reference: the same only for c >= 2 b."""
    a, b, c = ch.loop_parameters(*theta)
    places = np.linspace(-1.0, 1.0, 41)
    assert all(slope_of_the_voltage(place, s, a, b, c) > 0.0 for place in places)
    assert slope_of_the_voltage(0.99 * s, s, a, b, 1.9 * b) < 0.0
