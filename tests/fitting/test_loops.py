"""Loops that a voltage goes through, and how far they are from those of a record."""

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.loops import ALIKE, loops_of, newness, seen_loops

RANGE = (-10.0, 10.0)


def way(*turns: float) -> FloatArray:
    """Voltages from turn to turn, 100 samples each."""
    return np.interp(np.arange(100 * (len(turns) - 1) + 1) / 100.0, np.arange(len(turns)), turns)


def test_inner_turns_are_remembered_until_a_swing_goes_beyond_them() -> None:
    loops = loops_of(way(0.0, 10.0, -10.0, 10.0, -5.0, 5.0, -10.0), RANGE)
    # Of one turn, the other one is the end ahead.
    expected = [(10, 0), (0, 10), (-10, 10), (10, -10), (-10, 10), (10, -5), (-5, 5), (-10, 10)]
    np.testing.assert_array_equal(loops[[50, 140, 180, 250, 370, 450, 540, 580]], expected)


def test_only_loops_that_were_not_seen_are_new_and_are_remembered_for_some_way() -> None:
    whole = way(0.0, 10.0, -10.0, 10.0, -10.0)
    seen, small = seen_loops(whole, RANGE), 6.0 - 20.0 * ALIKE
    u = np.concatenate([whole, way(-10.0, 4.0, -4.0, 4.0), way(4.0, 10.0, -10.0, 10.0, -10.0, 10.0)])
    new = newness(u, RANGE, seen)
    np.testing.assert_array_equal(new[: whole.size + 90], 0.0)
    np.testing.assert_allclose(new[whole.size + np.array([120, 270])], small)
    assert 0.0 < new[-1] < 0.1 * small
    u = way(0.0, 10.0, -10.0, 10.0, -4.0, 4.0, -10.0, 10.0)
    again = np.concatenate([u, way(10.0, -3.8, 4.1, -3.9, 4.0)])
    np.testing.assert_array_equal(newness(again, RANGE, seen_loops(u, RANGE)), 0.0)
    # Nor what goes beyond the range; small swings make no loops.
    np.testing.assert_array_equal(newness(1.5 * whole, RANGE, seen), 0.0)
    assert len(seen_loops(whole + 0.2 * np.sin(np.arange(whole.size)), RANGE)) <= 2 * len(seen)
