"""What the paper prints or leaves open, and what it has to mean."""

from typing import Any

import numpy as np
import pytest

from piezoest import ColemanHodgdon, HysteresisRLS, signals
from piezoest.equations import coleman_hodgdon as ch
from piezoest.equations import least_squares as ls
from piezoest.layout import Named, new, numbers, record
from tests.reference import TABLE_I


def test_slip_in_b1() -> None:
    """(B1) of the paper subtracts its second term; with u' < 0 it must be added to equal (1)."""
    alpha, beta, gamma = TABLE_I[2]
    w, u, u_dot = 1.3, 20.0, -7.0
    plus, minus = max(u_dot, 0.0), min(u_dot, 0.0)
    added = (beta - alpha * w + gamma * u) * plus + (beta + alpha * w - gamma * u) * minus
    printed = (beta - alpha * w + gamma * u) * plus - (beta + alpha * w - gamma * u) * minus
    assert ch.rate(w, u, u_dot, alpha, beta, gamma) == pytest.approx(added)
    assert ch.rate(w, u, u_dot, alpha, beta, gamma) != pytest.approx(printed)


@pytest.mark.parametrize("theta", TABLE_I)
def test_units_of_table_i(theta: tuple[float, float, float]) -> None:
    """Printed without units: as 1/V, µm/V, µm/V² they are admissible, and scale as a change to mV demands."""
    model = ColemanHodgdon(*theta)
    assert model.is_admissible
    u = 35.0 * np.sin(np.linspace(0.0, 12.0, 400))
    in_millivolts = ColemanHodgdon(*np.array(theta) / [1e3, 1e3, 1e6])
    np.testing.assert_allclose(in_millivolts.simulate(1e3 * u), model.simulate(u), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("theta", TABLE_I)
@pytest.mark.parametrize("s", [1.0, -1.0])
def test_switching_by_the_reference_needs_the_admissible_set(theta: Any, s: float) -> None:
    """(C3) switches on the voltage, (17) on the reference: the same only for c >= 2 b."""
    a, b, c = ch.loop_parameters(*theta)

    def slope_of_the_voltage(place: float, c: float) -> float:
        """Derivative of u_h by r at w_h = place·b/a, for r that moves with sign s: (14) and (17)."""
        return (s - float(ch.inverse_rate(place * b / a, s, a, b, c))) / (c * s)

    assert all(slope_of_the_voltage(place, c) > 0.0 for place in np.linspace(-1.0, 1.0, 41))
    assert slope_of_the_voltage(0.99 * s, 1.9 * b) < 0.0


def test_a6_to_the_letter_freezes_for_good() -> None:
    """Once ||P|| > R0, (A6) sets its derivative to zero, and nothing brings it back."""
    bound, h = 2.0, 0.01
    theta, P, letter = np.zeros(2), np.diag([1.0, 0.9]), np.diag([1.0, 0.9])
    layout = record(theta=numbers(2), P=numbers(2, 2))
    rates = Named(new(layout), layout)
    quiet, loud = np.array([1e-3, 0.0]), np.array([1.0, -1.0])
    for phi in [quiet] * 100 + [loud] * 1000:
        if np.trace(letter) <= bound:
            letter = letter + h * (letter - letter @ np.outer(phi, phi) @ letter / (1.0 + phi @ letter @ phi))
        ls.continuous_step(theta, P, phi, 0.0, h, 1.0, 1.0, rates)
        ls.continuous_correction(theta, P, h, bound, rates)
    assert ls.trace(P) <= bound < np.trace(letter)
    assert loud @ P @ loud < loud @ letter @ loud


@pytest.mark.slow
def test_continuous_law_in_seconds_adapts_over_seconds() -> None:
    """The paper's normalised law is bounded per unit of time: in seconds it is the slower one."""
    true, sample_rate = ColemanHodgdon(*TABLE_I[2]), 50_000.0
    u = signals.triangle(33.0, 5.0, 5, sample_rate).values
    errors = []
    for base in ("discrete", "continuous"):
        estimator = HysteresisRLS(sample_rate, memory=0.4, time_base=base)
        estimator.run(u, true.simulate(u))
        errors.append(np.abs(estimator.theta / true.theta - 1.0).max())
    assert errors[0] < 1e-3 < errors[1]


def test_triangle_peak_against_the_ratios_in_the_papers_tables() -> None:
    """Maximum error over relative error is max|r|; each printed figure is known to half its last digit."""
    rows = [(0.016, 0.67, 2.5), (0.055, 1.1, 5.0), (0.045, 0.92, 5.0), (0.053, 0.72, 7.5), (0.67, 9.2, 7.5)]
    digits = [(0.0005, 0.005), (0.0005, 0.05), (0.0005, 0.005), (0.0005, 0.005), (0.005, 0.05)]
    low = max((e - de) / (p + dp) * 100 / a for (e, p, a), (de, dp) in zip(rows, digits, strict=True))
    high = min((e + de) / (p - dp) * 100 / a for (e, p, a), (de, dp) in zip(rows, digits, strict=True))
    assert low < signals.triangle(1.0, 5.0, 1, 50_000.0, continuity=3).amplitude < high
