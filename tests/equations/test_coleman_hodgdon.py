"""The Coleman-Hodgdon equations: identities of the paper, exact steps, the inverse."""

import itertools
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from piezoest import ColemanHodgdon
from piezoest.equations import coleman_hodgdon as ch
from tests.reference import TABLE_I


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


def branch(u: float, u_0: float, w_0: float, alpha: float, beta: float, gamma: float) -> float:
    """w at voltage u on the branch through (u_0, w_0): (B5)-(B8), the exact solution of (1)."""
    asymptote = np.sign(u - u_0) * (alpha * beta - gamma) / alpha**2
    c = gamma / alpha
    return float(c * u + asymptote + (w_0 - asymptote - c * u_0) * np.exp(-alpha * abs(u - u_0)))


@given(loops(), st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=6))
def test_two_forms_agree(loop: tuple[float, float, float], turning_points: list[float]) -> None:
    theta = ch.rate_parameters(*loop)
    u = ramps(turning_points)
    w = 0.0
    for k in range(1, u.size):
        w = branch(u[k], u[k - 1], w, *theta)
    expected = ColemanHodgdon(*theta).simulate(u, allow_jumps=True)[-1]
    assert w == pytest.approx(expected, abs=1e-9 * (1.0 + abs(expected)))


@given(loops(), st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=8), st.floats(-1.0, 1.0))
def test_invert_undoes_simulate(loop: tuple[float, float, float], turning_points: Any, place: float) -> None:
    model = ColemanHodgdon.from_loop(*loop, offset=0.7).nearest_admissible()
    state = place * model.b / model.a * 0.999
    u = ramps(turning_points)
    x = model.simulate(u, initial_state=state, allow_jumps=True)
    back = model.invert(x, initial_state=state, allow_jumps=True)
    # On the face c = 2b the slope dx/du vanishes at a turning point: what counts is x.
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
    for dr in (0.0, 1e-300, -1e-12, 1e3, -1e6, 1e9):
        du = ch.inverse_increment(0.1, dr, 0.02, 0.06, 0.2)
        assert np.isfinite(du)
        assert np.sign(du) == np.sign(dr)
    assert ch.inverse_increment(3.0, 0.0, 0.02, 0.06, 0.12) == 0.0
