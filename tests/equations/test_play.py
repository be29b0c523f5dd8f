"""The play operator, the Prandtl-Ishlinskii operator and its inverse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezoest.equations import play as equations

THRESHOLDS = np.array([0.5, 2.0, 5.0, 11.0])
WEIGHTS = np.array([0.03, -0.01, 0.02, 0.04])
GAIN = 0.1

voltages = st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=12)


@given(voltages, st.floats(0.0, 20.0))
def test_play_is_a_piston_in_a_cylinder(u: list[float], r: float) -> None:
    y = piston = 0.0
    for value in u:
        y = equations.play(y, value, r)
        if value - piston > r:
            piston = value - r
        elif value - piston < -r:
            piston = value + r
        assert y == piston


@given(voltages)
def test_inverse_is_kuhnens_operator(u: list[float]) -> None:
    """Krejci and Kuhnen (2001): of thresholds gain r_k + sum_(j<k) w_j (r_k - r_j), weights from 1/slope."""
    slopes = GAIN + np.concatenate(([0.0], np.cumsum(WEIGHTS)))
    sums = [np.sum(WEIGHTS[:k] * (r - THRESHOLDS[:k])) for k, r in enumerate(THRESHOLDS)]
    thresholds = GAIN * THRESHOLDS + sums
    weights = np.diff(1.0 / slopes)
    y, walk, closed = np.zeros(4), np.zeros(4), np.zeros(4)
    for value in u:
        w = equations.prandtl_ishlinskii_step(y, value, GAIN, THRESHOLDS, WEIGHTS)
        by_walk = equations.prandtl_ishlinskii_inverse(walk, w, GAIN, THRESHOLDS, WEIGHTS)
        equations.prandtl_ishlinskii_step(walk, by_walk, GAIN, THRESHOLDS, WEIGHTS)
        by_formula = equations.prandtl_ishlinskii_step(closed, w, 1.0 / GAIN, thresholds, weights)
        assert by_walk == pytest.approx(value, abs=1e-10)
        assert by_formula == pytest.approx(value, abs=1e-10)
        np.testing.assert_allclose(walk, y, atol=1e-10)
