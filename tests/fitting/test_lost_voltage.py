"""Where the recorded voltage is not what drove the stage, or missing: found, and nothing else."""

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.fitting import fit
from piezoest.fitting.flaws import flawed

N = 6000
T = np.arange(N) / 1000.0
MODEL = pz.ColemanHodgdon.from_loop(0.03, 0.04, 0.1)


def simulated(u: FloatArray) -> FloatArray:
    noise = 2e-3 * np.random.default_rng(0).standard_normal(N)
    return np.asarray(MODEL.simulate(u, allow_jumps=True) + noise)


def swings() -> FloatArray:
    """Voltages about 40 V, of amplitudes that change."""
    return np.asarray(40.0 + (20.0 + 15.0 * np.cos(2.0 * T)) * np.sin(2.0 * np.pi * 3.0 * T))


def telegraph(hold: int) -> FloatArray:
    bits = np.random.default_rng(hold).choice([-30.0, 30.0], N // hold + 1)
    return np.repeat(bits, hold)[:N]


EXCITATIONS: dict[str, Callable[[], FloatArray]] = {
    "swings": swings,
    "square": lambda: np.asarray(30.0 * np.sign(np.sin(2.0 * np.pi * 4.1 * T))),
    "sawtooth": lambda: 60.0 * (7.3 * T % 1.0),
    "short pulses": lambda: np.asarray(30.0 * (np.arange(N) % 400 < 6)),
    "levels": lambda: np.asarray(np.repeat(np.random.default_rng(1).uniform(-30.0, 30.0, N // 100), 100)),
    "one step": lambda: np.asarray(30.0 * (T > 2.0) * np.sin(2.0 * np.pi * 3.0 * T + 1.0)),
    "white": lambda: np.random.default_rng(2).uniform(-30.0, 30.0, N),
    "dying away": lambda: 30.0 * np.sin(2.0 * np.pi * 5.0 * T) * np.exp(-0.5 * T),
    **{f"telegraph {hold}": partial(telegraph, hold) for hold in (1, 2, 5, 50)},
}


def slow(x: FloatArray, samples: float) -> FloatArray:
    keep = float(np.exp(-1.0 / samples))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], x - x[0]) + x[0])


@pytest.mark.parametrize("name", EXCITATIONS)
def test_no_sample_of_a_healthy_voltage_is_wrong_be_it_noisy_or_in_steps(name: str) -> None:
    u = EXCITATIONS[name]()
    x, noise = simulated(u), 0.3 * np.random.default_rng(3).standard_normal(N)
    answers = (x, np.roll(x, 4), slow(x, 3.0), slow(x, 30.0))
    for recorded, answer in product((u, u + noise, np.round(4.0 * u) / 4.0), answers):
        assert not flawed(recorded, answer).voltage.any()


# Places, and what is recorded there of the voltage.
WRONG: dict[str, tuple[list[int], Callable[[FloatArray], Any]]] = {
    "spikes": ([700, 2111, 4321], lambda u: np.add(u, [25.0, -30.0, 8.0])),
    "zeros": ([900, 2500, 2501, *range(4000, 4025)], lambda u: 0.0 * u),
    "rows of zeros": ([900, 2500, 2501, 4100], lambda u: 0.0 * u),
    "overflow": ([1500, 3000], lambda u: [9.9e37, -1e4]),
    "garbage": ([1500, 1501, 1502, 3333, 3334], lambda u: [80.0, 5.0, 90.0, -20.0, 99.0]),
    "stuck": (list(range(2900, 3100)), lambda u: u[0]),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_voltages_are_found_and_left_out(name: str) -> None:
    (places, recorded), u = WRONG[name], swings()
    x, truth = simulated(u), MODEL.simulate(u, allow_jumps=True)
    u[places] = recorded(u[places])
    if name == "rows of zeros":
        x[places] = 0.0
    flaws = flawed(u, x)
    np.testing.assert_array_equal(np.flatnonzero(flaws.voltage), places)
    assert flaws.jumps.size == 0
    found = fit(u, x, sample_rate=1000.0, model="coleman-hodgdon")
    assert not found.counts[places].any()
    assert np.std((found.predict().x - truth)[found.counts]) < 2e-3


def test_spikes_are_told_from_steps_and_from_gaps_beside_them() -> None:
    square, u = EXCITATIONS["square"](), swings()
    x, y = simulated(square), simulated(u)
    square[[1300, 3210]] = 0.0
    np.testing.assert_array_equal(np.flatnonzero(flawed(square, x).voltage), [1300, 3210])
    u[1000:1040], u[3000:3003] = np.nan, np.nan
    assert not flawed(u, y).voltage.any()
    u[[1020, 3003]] = -50.0, 99.0
    np.testing.assert_array_equal(np.flatnonzero(flawed(u, y).voltage), [1020, 3003])
    # A displacement that does not follow tells nothing.
    assert not flawed(u, np.random.default_rng(4).standard_normal(N)).voltage.any()


@pytest.mark.parametrize("place", [0, 1, 150, 299])
def test_an_overflow_is_found_anywhere_in_a_short_log(place: int) -> None:
    u, x = swings()[:300], simulated(swings())[:300]
    u[place] = 1e5
    np.testing.assert_array_equal(np.flatnonzero(flawed(u, x).voltage), [place])


def test_a_turn_that_was_lost_does_not_spoil_a_fit() -> None:
    """Samples behind it are left out until larger swings were passed, not those behind other gaps."""
    sizes = [4.0, 10.0, 6.0, 9.0, 3.0, 10.0, 5.0, 8.0, 10.0, 2.0]
    u = np.outer(sizes, np.sin(np.pi * np.arange(200) / 100.0)).ravel()
    model = pz.PrandtlIshlinskii(gain=0.1, thresholds=[1.0, 3.0], weights=[0.03, 0.05])
    x = model.simulate(u) + 1e-3 * np.random.default_rng(0).standard_normal(u.size)
    u[400:500], x[400:500] = np.nan, np.nan
    u[1300:1303], u[1490:1520] = np.nan, np.nan
    found = fit(u, x, sample_rate=1000.0, model="plays")
    assert not found.counts[500:600].any()
    assert found.counts[1200:1300].all()
    assert found.counts[1303:1490].all()
    assert found.counts[1520:].all()
    missed = (found.predict().x - x)[found.counts]
    assert np.sqrt(np.mean(missed**2)) < 2e-3
