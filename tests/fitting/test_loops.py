"""Loops that a voltage goes through, and how far they are from those of a record."""

import numpy as np
import pytest

from piezoest._checks import FloatArray
from piezoest.fitting.loops import ALIKE, loops_of, newness, running_mean, seen_loops

RANGE = (-10.0, 10.0)


def way(*turns: float) -> FloatArray:
    """Voltages from turn to turn, 100 samples each."""
    return np.interp(np.arange(100 * (len(turns) - 1) + 1) / 100.0, np.arange(len(turns)), turns)


def test_inner_turns_are_remembered_until_a_swing_goes_beyond_them() -> None:
    u = way(0.0, 10.0, -10.0, 10.0, -5.0, 5.0, -10.0)
    loops = loops_of(u, RANGE)
    expected = {
        50: (10.0, 0.0),  # of one turn, the other one is the end ahead
        140: (0.0, 10.0),
        180: (-10.0, 10.0),
        250: (10.0, -10.0),
        370: (-10.0, 10.0),
        450: (10.0, -5.0),
        540: (-5.0, 5.0),
        580: (-10.0, 10.0),
    }
    for k, pair in expected.items():
        assert tuple(loops[k]) == pair


def test_small_swings_and_what_is_beyond_the_range_make_no_loops() -> None:
    u = way(0.0, 10.0, -10.0, 10.0, -10.0)
    noisy = u + 0.2 * np.sin(np.arange(u.size))
    assert len(seen_loops(noisy, RANGE)) <= 2 * len(seen_loops(u, RANGE))
    np.testing.assert_array_equal(newness(1.5 * u, RANGE, seen_loops(u, RANGE)), 0.0)


def test_a_smaller_loop_is_new_and_is_remembered_for_some_way() -> None:
    whole = way(0.0, 10.0, -10.0, 10.0, -10.0)
    u = np.concatenate([whole, way(-10.0, 4.0, -4.0, 4.0), way(4.0, 10.0, -10.0, 10.0, -10.0, 10.0)])
    new = newness(u, RANGE, seen_loops(whole, RANGE))
    np.testing.assert_array_equal(new[: whole.size + 90], 0.0)
    small = 6.0 - 20.0 * ALIKE
    assert new[whole.size + 120] == pytest.approx(small)
    assert new[whole.size + 270] == pytest.approx(small)
    assert 0.0 < new[-1] < 0.1 * small


def test_a_loop_that_was_seen_is_not_new() -> None:
    u = way(0.0, 10.0, -10.0, 10.0, -4.0, 4.0, -10.0, 10.0)
    new = newness(np.concatenate([u, way(10.0, -3.8, 4.1, -3.9, 4.0)]), RANGE, seen_loops(u, RANGE))
    np.testing.assert_array_equal(new, 0.0)


def test_a_running_mean_begins_at_the_first_voltage_and_forgets() -> None:
    u = np.append(np.full(5, 3.0), np.zeros(20))
    expected = np.append(np.full(5, 3.0), 3.0 * np.exp(-np.arange(1.0, 21.0) / 10.0))
    np.testing.assert_allclose(running_mean(u, 10.0), expected)
