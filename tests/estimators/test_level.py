"""The loop's centre from levels."""

import numpy as np
import pytest

import piezoest as pz
from piezoest.estimators import level
from piezoest.layout import Named, new


def test_the_centre_of_whole_periods_is_exact_whatever_the_shape_that_is_missed() -> None:
    a, b, c, centre = 0.02, 0.05, 0.2, 0.7
    u = 30.0 * np.sin(2.0 * np.pi * np.arange(8001) / 2000.0)
    missed = 0.05 * np.sin(6.0 * np.pi * np.arange(8001) / 2000.0)
    x = pz.ColemanHodgdon.from_loop(a, b, c, centre).simulate(u) + missed
    state = Named(new(level.LEVEL), level.LEVEL)
    for k in range(1, u.size):
        level.move(state, u[k] - u[k - 1], a)
        level.measure(state, u[k], x[k])
        if (k - 500) % 1000 == 0:
            level.turn(state)
    assert level.is_known(state)
    assert level.offset(state, b, c) == pytest.approx(centre, abs=1e-3)


def test_nothing_is_known_before_a_whole_period() -> None:
    state = Named(new(level.LEVEL), level.LEVEL)
    assert not level.is_known(state)
    level.measure(state, 1.0, 1.0)
    level.turn(state)
    level.turn(state)
    assert not level.is_known(state)
