"""The Coleman-Hodgdon equations: identities of the paper, exact steps, the inverse."""

from __future__ import annotations

import itertools
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from piezoest import ColemanHodgdon, signals
from piezoest.equations import coleman_hodgdon as ch
from piezoest.equations.integrators import bogacki_shampine

TABLE_I = [
    (3.26e-2, 0.136, 5.96e-3),
    (1.91e-2, 0.149, 4.05e-3),
    (2.1e-2, 0.147, 4.29e-3),
    (1.59e-2, 0.155, 3.55e-3),
]


@st.composite
def loops(draw: st.DrawFn) -> tuple[float, float, float]:
    """Admissible (a, b, c), up to the face c = 2b."""
    a = 10.0 ** draw(st.floats(-3.5, 0.0))
    c = draw(st.floats(0.02, 20.0))
    return a, c * draw(st.floats(0.01, 0.5)), c


def ramps(turning_points: list[float]) -> Any:
    """Record that moves in a few steps from each turning point to the next, starting at 0."""
    points = np.array([0.0, *turning_points])
    return np.interp(np.arange(8 * len(points) - 7) / 8.0, np.arange(len(points)), points)


@given(loops())
def test_parameters_both_ways(loop: tuple[float, float, float]) -> None:
    alpha, beta, gamma = ch.rate_parameters(*loop)
    np.testing.assert_allclose(ch.loop_parameters(alpha, beta, gamma), loop, rtol=1e-12)


@pytest.mark.parametrize("theta", TABLE_I)
def test_exact_step_solves_the_differential_equation(theta: tuple[float, float, float]) -> None:
    amplitude, omega = 40.0, 2.0 * np.pi * 5.0

    def rate(t: float, w: Any) -> Any:
        return ch.rate(w, amplitude * np.sin(omega * t), amplitude * omega * np.cos(omega * t), *theta)

    # The turning points are steps of the record, so that u is monotone between samples.
    times = np.linspace(0.0, 0.5, 2001)
    w = [0.0]
    for start, stop in itertools.pairwise(times):
        solution = solve_ivp(rate, (start, stop), [w[-1]], method="DOP853", rtol=1e-13, atol=1e-15)
        w.append(solution.y[0, -1])
    simulated = ColemanHodgdon(*theta).simulate(amplitude * np.sin(omega * times))
    np.testing.assert_allclose(simulated, w, atol=1e-9)


@given(loops(), st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=6))
def test_two_forms_agree(loop: tuple[float, float, float], turning_points: list[float]) -> None:
    theta = ch.rate_parameters(*loop)
    u = ramps(turning_points)
    w = 0.0
    for k in range(1, u.size):
        w = ch.branch(u[k], u[k - 1], w, *theta)
    expected = ColemanHodgdon(*theta).simulate(u, allow_jumps=True)[-1]
    assert w == pytest.approx(expected, abs=1e-9 * (1.0 + abs(expected)))


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
def test_hysteresis_rate_is_the_derivative_of_the_step(theta: tuple[float, float, float]) -> None:
    a, b, _ = ch.loop_parameters(*theta)
    for u_dot in (3.0, -3.0):
        h = 1e-5
        slope = (ch.hysteresis_step(0.4, u_dot * h, a, b) - 0.4) / h
        assert slope == pytest.approx(ch.hysteresis_rate(0.4, u_dot, a, b), rel=1e-5)


def test_small_alpha_needs_no_special_case() -> None:
    assert ch.hysteresis_step(0.2, 3.0, 0.0, 0.05) == pytest.approx(0.2 - 0.05 * 3.0)
    assert ch.relative_decay(0.0) == 1.0


@given(
    loops(),
    st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=8),
    st.floats(-1.0, 1.0),
)
def test_invert_and_simulate_are_inverse(
    loop: tuple[float, float, float], turning_points: list[float], place: float
) -> None:
    model = ColemanHodgdon.from_loop(*loop, offset=0.7).nearest_admissible()
    state = place * model.b / model.a * 0.999
    u = ramps(turning_points)
    x = model.simulate(u, initial_state=state, allow_jumps=True)
    back = model.invert(x, initial_state=state, allow_jumps=True)
    # On the face c = 2b the slope dx/du vanishes at a turning point: u is then as well
    # determined as x allows, and x is what counts.
    again = model.simulate(back, initial_state=state, allow_jumps=True)
    scale = 1.0 + np.max(np.abs(x))
    np.testing.assert_allclose(again, x, atol=1e-9 * scale)
    if model.c > 2.2 * model.b:
        np.testing.assert_allclose(back, u, atol=1e-9 * 100.0)


@given(loops(), st.floats(-1.0, 1.0), st.floats(-300.0, 300.0))
def test_increment_is_lambert_w(loop: tuple[float, float, float], place: float, dr: float) -> None:
    """(C7) and (C10), evaluated with fifty digits, where the literal formula overflows too."""
    a, b, c = loop
    w_h = place * b / a
    du = ch.inverse_increment(w_h, dr, a, b, c)
    with mpmath.workdps(50):
        s = 1 if dr >= 0 else -1
        e = (mpmath.mpf(b) + s * a * mpmath.mpf(w_h)) / c
        d = mpmath.mpf(a) * abs(mpmath.mpf(dr)) / c
        z = d + e + mpmath.lambertw(-e * mpmath.exp(-(d + e)))
        expected = float(s * z.real / a)
    assert du == pytest.approx(expected, rel=1e-6, abs=1e-9 / a)


def test_no_branch_error_at_extreme_arguments() -> None:
    for dr in (1e-300, 1e-12, 1e3, 1e6, 1e9):
        for sign in (-1.0, 1.0):
            du = ch.inverse_increment(0.1, sign * dr, 0.02, 0.06, 0.2)
            assert np.isfinite(du)
            assert np.sign(du) == sign
    assert ch.inverse_increment(0.1, 0.0, 0.02, 0.06, 0.2) == 0.0
    assert ch.inverse_increment(3.0, 0.0, 0.02, 0.06, 0.12) == 0.0


def test_runge_kutta_has_order_three() -> None:
    a, b, c = ch.loop_parameters(*TABLE_I[2])
    r = np.array([0.0, 4.0, -4.0, 3.0])
    errors = []
    for steps in (8, 16, 32, 64):
        exact = approximate = 0.0
        for k in range(1, r.size):
            exact += (r[k] - r[k - 1]) - c * ch.inverse_increment(exact, r[k] - r[k - 1], a, b, c)
            for _ in range(steps):
                dr = (r[k] - r[k - 1]) / steps
                approximate = bogacki_shampine(ch.inverse_rate, approximate, 1.0, (dr, a, b, c))
        errors.append(abs(approximate - exact))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders[-1] >= 2.9
    assert errors[-1] < 1e-6


def test_jumps_are_answered_with_what_to_do() -> None:
    square = np.repeat([0.0, 10.0, 0.0, 10.0], 100)
    model = ColemanHodgdon(*TABLE_I[2])
    with pytest.raises(ValueError, match=r"u jumps by .*signals\.filtered_steps"):
        model.simulate(square)
    with pytest.raises(ValueError, match=r"r jumps by .*signals\.filtered_steps"):
        model.invert(square)
    model.simulate(signals.filtered_steps([0.0, 10.0], [0.1, 0.1], 1e4).values)
