"""The Coleman-Hodgdon equations: the exact solution, the inverse."""

import itertools
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezoest import ColemanHodgdon
from piezoest.equations import coleman_hodgdon as ch
from piezoest.equations import recent_path
from piezoest.layout import Named, new


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


def branch(u: float, u_0: float, w_0: float, alpha: float, beta: float, gamma: float) -> float:
    """w at voltage u on the branch through (u_0, w_0): (B5)-(B8), the exact solution of (1)."""
    asymptote = np.sign(u - u_0) * (alpha * beta - gamma) / alpha**2
    c = gamma / alpha
    return float(c * u + asymptote + (w_0 - asymptote - c * u_0) * np.exp(-alpha * abs(u - u_0)))


@given(loops(), st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=6))
def test_a_model_follows_the_exact_solution(loop: Any, turning_points: list[float]) -> None:
    theta = ch.rate_parameters(*loop)
    np.testing.assert_allclose(ch.loop_parameters(*theta), loop, rtol=1e-12)
    u, w = ramps(turning_points), 0.0
    for before, now in itertools.pairwise(u):
        w = branch(now, before, w, *theta)
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
    np.testing.assert_allclose(again, x, atol=1e-9 * (1.0 + np.max(np.abs(x))))
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


@given(
    st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=recent_path.MOST - 1),
    st.floats(1e-4, 0.5),
    st.floats(-20.0, 20.0),
)
def test_the_recent_path_of_the_voltage_tells_where_a_model_would_stand(
    turns: list[float], a: float, rest: float
) -> None:
    path = Named(new(recent_path.PATH), recent_path.PATH)
    recent_path.begin(path, rest, 0.02)
    h, last = 0.0, rest
    u = np.interp(np.arange(1, 5 * len(turns) + 1) / 5, np.arange(len(turns) + 1), [0.0, *turns])
    for value in u.tolist():
        recent_path.follow(path, value)
        h, last = ch.hysteresis_step(h, value - last, a, 1.0), value
    recent_path.use_decay(path, a)
    # A way back of a hundredth of a swing is no turn, and what is long gone is left out.
    slack = 2.0 * recent_path.TURN * (np.ptp(u) + abs(rest)) * len(turns)
    assert abs(recent_path.hysteresis(path) - h) <= slack + 3.0 * recent_path.FORGOTTEN / a
