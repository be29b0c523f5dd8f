"""Logs that are written faster than the sensor measures."""

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.fitting.flaws import flawed
from piezoest.fitting.held import repeats

N = 8000
U = 50.0 + 40.0 * np.sin(0.0126 * np.arange(N)) * np.linspace(0.5, 1.0, N)
LOOP = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
TRUTH = LOOP.simulate(U, allow_jumps=True)


def slow(times: int) -> FloatArray:
    """Readings of which each stands so many times."""
    x = TRUTH + 3e-3 * np.random.default_rng(0).standard_normal(N)
    return x[::times].repeat(times)[:N]


@pytest.mark.parametrize("times", [2, 20])
@pytest.mark.slow
def test_a_slow_sensor_is_fitted_as_well_as_a_fast_one(times: int) -> None:
    found = pz.identify(U, slow(times), sample_rate=2000.0)
    assert found.flaws.jumps.size == 0
    assert not found.flaws.spikes.any()
    assert found.held_out.rms < 0.005
    assert np.sqrt(np.mean((found.prediction - TRUTH)[N // 2 :] ** 2)) < 0.005


def test_jumps_spikes_and_loss_of_a_slow_sensor_are_found() -> None:
    x = slow(10)
    x[3000:] += 2.0
    x[1500:1510] += 3.0
    x[5000:5600] = x[4999]
    flaws = flawed(U, x)
    np.testing.assert_array_equal(flaws.jumps, [3000])
    np.testing.assert_array_equal(np.flatnonzero(flaws.spikes), [1500])
    lost = np.flatnonzero(flaws.dropouts)
    assert (lost[0], lost[-1]) == (5000 - 10, 5590)


def test_a_staircase_and_coarse_steps_are_of_no_slow_sensor() -> None:
    u = np.round(U[::99] / 2.0).repeat(99)[:N] * 2.0
    x = LOOP.simulate(u, allow_jumps=True)
    ramps = np.abs(np.arange(N) % 2000 - 1000.0)
    assert repeats(u, slow(10)) == 10
    assert [repeats(u, x), repeats(u, np.roll(x, 3)), repeats(ramps, np.round(0.1 * ramps))] == [1, 1, 1]
