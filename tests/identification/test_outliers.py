"""Spikes and jumps are found where they are, and nowhere else."""

import numpy as np
import pytest
from scipy.signal import lfilter

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.fitting.flaws import flawed
from tests.identification.zoo_logs import zoo_log

SEEDS = range(40)


def apart(rng: np.random.Generator, size: int, count: int, least: int) -> FloatArray:
    """Places at random, none too near to another."""
    places = np.sort(rng.choice(np.arange(100, size - 100), count, replace=False))
    return places[np.diff(places, prepend=-least) >= least]


def test_spikes_are_found() -> None:
    found = spikes = wrong = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        u, x, _, noise = zoo_log(seed)
        places = apart(rng, x.size, round(x.size * 10.0 ** rng.uniform(-3.0, np.log10(0.02))), 4)
        # What is less than a part in a thousand of the range is left alone.
        least = max(10.0 * noise, 3e-3 * np.ptp(x))
        y = x.copy()
        y[places] += rng.choice([-1.0, 1.0], places.size) * least * 10.0 ** rng.uniform(0.0, 1.5, places.size)
        flaws = flawed(u, y)
        spikes += places.size
        found += int(flaws.spikes[places].sum())
        wrong += int(flaws.spikes.sum() - flaws.spikes[places].sum()) + flaws.jumps.size
    assert found > 0.95 * spikes
    assert wrong < 0.002 * spikes


@pytest.mark.slow
def test_jumps_are_found() -> None:
    found = jumps = wrong = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        u, x, _, noise = zoo_log(seed)
        places = apart(rng, x.size, 5, 50)
        sizes = max(10.0 * noise, 0.01 * float(np.ptp(x))) * 10.0 ** rng.uniform(0.05, 1.0, places.size)
        flaws = flawed(u, x + (np.arange(x.size)[:, None] >= places) @ sizes)
        near = np.abs(flaws.jumps[:, None] - places) <= 1
        jumps += places.size
        found += int(near.any(axis=0).sum())
        wrong += int((~near.any(axis=1)).sum()) + int(flaws.spikes.sum())
        missed = np.abs(flaws.jump_sizes - sizes[near.argmax(axis=1)])
        assert np.all(missed[near.any(axis=1)] < 0.5 * sizes.max())
    assert found > 0.9 * jumps
    assert wrong < 0.02 * jumps


@pytest.mark.slow
def test_bursts_are_found_and_gaps_are_no_jumps_in_logs_of_all_kinds() -> None:
    found = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        u, x, _, noise = zoo_log(seed)
        start, count = int(rng.integers(100, x.size - 500)), int(rng.integers(2, 7))
        y, z, few = x.copy(), x.copy(), x.copy()
        y[start : start + count] += max(0.3 * float(np.ptp(x)), 30.0 * noise)
        found += np.array_equal(np.flatnonzero(flawed(u, y).spikes), start + np.arange(count))
        z[start : start + 200] = np.nan
        assert not np.any(np.abs(flawed(u, z).jumps - start) <= 200), seed
        few[apart(rng, x.size, x.size // 100, 4)] = np.nan
        assert flawed(u, few).jumps.size <= 1, seed
    assert found > 0.85 * len(SEEDS)


def test_noise_of_a_long_log_has_no_spikes() -> None:
    t = np.arange(500_000) / 1e4
    u = 50.0 * np.sin(20.0 * t)
    flaws = flawed(u, 0.1 * u + 2e-3 * np.random.default_rng(0).standard_normal(t.size))
    assert not flaws.unusable.any()
    assert flaws.jumps.size == 0


def test_a_jump_has_its_place_and_its_size() -> None:
    u = 50.0 * np.sin(np.linspace(0.0, 40.0, 4000))
    flaws = flawed(u, 0.1 * u + 0.5 * (np.arange(4000) >= 1500))
    np.testing.assert_array_equal(flaws.jumps, [1500])
    np.testing.assert_allclose(flaws.jump_sizes, 0.5, rtol=0.05)


@pytest.mark.parametrize("turns", [0.0, 0.5, 7.0, 300.0])
def test_a_log_without_noise_is_taken(turns: float) -> None:
    u = np.linspace(0.0, 1.0, 4000) if turns == 0.0 else np.sin(np.linspace(0.0, 6.28 * turns, 4000))
    x = 0.1 * u
    assert not flawed(u, x).unusable.any()
    x[1000] += 0.3
    np.testing.assert_array_equal(np.flatnonzero(flawed(u, x).spikes), [1000])


def test_short_logs_are_taken_and_one_shape_is_asked_for() -> None:
    for size in (0, 1, 5, 31, 32, 33, 60):
        u = np.sin(np.arange(size))
        assert flawed(u, 0.1 * u).spikes.shape == (size,)
    with pytest.raises(ValueError, match=r"x must have shape \(3,\)"):
        flawed(np.zeros(3), np.zeros(4))


def followed(u: FloatArray, seed: int) -> FloatArray:
    """A loop of 10 µm with 3 nm of noise."""
    x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u, allow_jumps=True)
    return x + 3e-3 * np.random.default_rng(seed).standard_normal(u.size)


T = np.arange(4000) / 1000.0
U = 50.0 + 40.0 * np.sin(8.0 * T) * np.linspace(0.5, 1.0, T.size)
X = followed(U, 2)


@pytest.mark.parametrize("value", [None, 0.0, 99999.0, -1e6])
def test_readings_that_are_off_together_are_found(value: float | None) -> None:
    for count in range(1, 7):
        for start in (150, 703, 1120, 1404):
            y = X.copy()
            y[start : start + count] = y[start : start + count] + 3.0 if value is None else value
            flaws = flawed(U, y)
            np.testing.assert_array_equal(np.flatnonzero(flaws.spikes), start + np.arange(count))
            assert flaws.jumps.size == 0


def test_no_error_code_is_seen_in_the_only_swing_of_a_rest() -> None:
    u = np.zeros(8000)
    u[4000:4060] = 50.0 * np.sin(np.linspace(0.0, np.pi, 60))
    assert not flawed(u, 0.1 * u + 1e-3 * np.random.default_rng(0).standard_normal(8000)).spikes.any()


@pytest.mark.parametrize("start", [310, 470, 680, 1120])
def test_where_the_voltage_is_missing_the_displacement_may_turn(start: int) -> None:
    u = 50.0 + 40.0 * np.abs(3.3 * T % 1.0 * 2.0 - 1.0)
    x = followed(u, start)
    u[start : start + 300] = np.nan
    flaws = flawed(u, x)
    assert flaws.jumps.size == 0
    assert not flaws.spikes.any()


@pytest.mark.parametrize("how", ["missing", "spike", "two samples", "slow gauge"])
def test_a_jump_is_found_in_whatever_it_hides(how: str) -> None:
    """In swings of several sizes, of a loop with a noise of 5 nm."""
    u = pz.signals.multi_amplitude([20.0, 40.0, 30.0], 1.0, 1, 1000.0).values
    x = pz.PrandtlIshlinskii(0.08, np.linspace(1.0, 30.0, 30), np.full(30, 0.002)).simulate(u)
    step, keep = (np.arange(x.size) >= 1300).astype(float), np.exp(-1.0 / 4.0)
    x += lfilter([1.0 - keep], [1.0, -keep], step) if how == "slow gauge" else step
    x[1300] += {"missing": np.nan, "spike": 4.0, "two samples": -0.5, "slow gauge": 0.0}[how]
    flaws = flawed(u, x + 5e-3 * np.random.default_rng(0).standard_normal(x.size))
    assert flaws.jumps.size == 1
    assert abs(int(flaws.jumps[0]) - 1300) <= 4
    assert flaws.jump_sizes[0] == pytest.approx(1.0, abs=0.2)
