"""The play operator, the Prandtl-Ishlinskii operator and its inverse."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from piezoest.equations import play as equations

THRESHOLDS = np.array([0.5, 2.0, 5.0, 11.0])
WEIGHTS = np.array([0.03, -0.01, 0.02, 0.04])
GAIN = 0.1

voltages = st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=12)


def textbook_play(u: Any, r: float) -> Any:
    """Play as a piston in a cylinder, in branches."""
    y, states = 0.0, []
    for value in u:
        if value - y > r:
            y = value - r
        elif value - y < -r:
            y = value + r
        states.append(y)
    return np.array(states)


@given(voltages, st.floats(0.0, 20.0))
def test_play_is_a_piston_in_a_cylinder(u: list[float], r: float) -> None:
    y, states = 0.0, []
    for value in u:
        y = equations.play(y, value, r)
        states.append(float(y))
    np.testing.assert_array_equal(states, textbook_play(u, r))


@given(voltages, st.floats(0.1, 20.0))
def test_play_is_rate_independent(u: list[float], r: float) -> None:
    """Samples put between the turning points change nothing at the turning points."""
    points = np.array([0.0, *u])
    fine = np.interp(np.arange(7 * len(u) + 1) / 7.0, np.arange(points.size), points)
    fine[::7] = points
    np.testing.assert_allclose(textbook_play(fine, r)[::7], textbook_play(points, r), atol=1e-12)
    y = 0.0
    for value in fine:
        y = equations.play(y, value, r)
    assert y == pytest.approx(textbook_play(points, r)[-1], abs=1e-12)


@given(voltages, st.floats(-100.0, 100.0))
def test_wiping_out(u: list[float], start: float) -> None:
    """An excursion beyond all before wipes out the memory of them."""
    y, fresh = np.zeros(4), np.zeros(4)
    for value in (start, *u, 150.0):
        equations.prandtl_ishlinskii_step(y, value, GAIN, THRESHOLDS, WEIGHTS)
    equations.prandtl_ishlinskii_step(fresh, 150.0, GAIN, THRESHOLDS, WEIGHTS)
    np.testing.assert_array_equal(y, fresh)


def test_minor_loop_closes() -> None:
    """Return-point memory: back at the turning point, w is what it was."""
    y = np.zeros(4)
    values = [
        equations.prandtl_ishlinskii_step(y, u, GAIN, THRESHOLDS, WEIGHTS) for u in (30.0, 12.0, 20.0, 12.0)
    ]
    assert values[3] == values[1]


@given(voltages)
def test_inverse_is_kuhnens_operator(u: list[float]) -> None:
    """The walk over the breakpoints agrees with the inverse in closed form.

    Krejci and Kuhnen (2001): the inverse is itself a Prandtl-Ishlinskii operator, of
    thresholds gain r_k + sum_(j<k) w_j (r_k - r_j) and weights from 1/slope.
    """
    slopes = GAIN + np.concatenate(([0.0], np.cumsum(WEIGHTS)))
    thresholds = np.array(
        [GAIN * r + np.sum(WEIGHTS[:k] * (r - THRESHOLDS[:k])) for k, r in enumerate(THRESHOLDS)]
    )
    weights = np.diff(1.0 / slopes)
    y, walk, closed = np.zeros(4), np.zeros(4), np.zeros(4)
    for value in u:
        w = equations.prandtl_ishlinskii_step(y, value, GAIN, THRESHOLDS, WEIGHTS)
        by_walk = equations.prandtl_ishlinskii_inverse_step(walk, w, GAIN, THRESHOLDS, WEIGHTS)
        by_formula = equations.prandtl_ishlinskii_step(closed, w, 1.0 / GAIN, thresholds, weights)
        assert by_walk == pytest.approx(value, abs=1e-10)
        assert by_formula == pytest.approx(value, abs=1e-10)
        np.testing.assert_allclose(walk, y, atol=1e-10)


@pytest.mark.parametrize(
    "function", [equations.prandtl_ishlinskii_step, equations.prandtl_ishlinskii_inverse_step]
)
def test_numpy_numba_and_casadi_agree(function: Any) -> None:
    casadi.GlobalOptions.setNumpyMode(1)
    y, value = casadi.SX.sym("y", 4), casadi.SX.sym("u")
    after = np.array(casadi.vertsplit(y), dtype=object)
    result = function(after, value, GAIN, THRESHOLDS, WEIGHTS)
    symbolic = casadi.Function("f", [y, value], [result, casadi.vertcat(*after)])

    @njit
    def compiled(y: Any, value: float, gain: float, thresholds: Any, weights: Any) -> Any:
        return function(y, value, gain, thresholds, weights)

    plain, jitted, traced = np.zeros(4), np.zeros(4), np.zeros(4)
    for x in (1.0, 4.0, -3.0, 9.0, 8.9, -20.0):
        expected = function(plain, x, GAIN, THRESHOLDS, WEIGHTS)
        assert compiled(jitted, x, GAIN, THRESHOLDS, WEIGHTS) == expected
        by_casadi, state = symbolic(traced, x)
        traced = np.array(state).ravel()
        assert float(by_casadi) == pytest.approx(expected, rel=1e-14)
        np.testing.assert_array_equal(jitted, plain)
        np.testing.assert_allclose(traced, plain, rtol=1e-14)
