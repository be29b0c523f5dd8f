"""Simulated recordings: functions of their seed, with all that users' logs have, true to what they say."""

from functools import cache

import numpy as np
import pytest

from piezoest.bench.zoo import logs
from piezoest.bench.zoo.families import FAMILIES
from piezoest.bench.zoo.logs import ADDED, SAMPLE_RATES, SAMPLES, Log
from piezoest.bench.zoo.voltages import SHAPES, draw_voltage

SEEDS = range(60)


@cache
def draw(seed: int) -> Log:
    return logs.draw(seed)


def test_a_log_is_a_function_of_its_seed() -> None:
    again, other = logs.draw(3), draw(4)
    for name in ("u", "x", "truth", "jumps", "spikes"):
        np.testing.assert_array_equal(getattr(draw(3), name), getattr(again, name))
    assert draw(3).added == again.added
    assert draw(3).u.size != other.u.size


@pytest.mark.slow
def test_everything_is_drawn() -> None:
    drawn = [draw(seed) for seed in SEEDS]
    assert {log.family for log in drawn} == set(FAMILIES)
    assert {log.voltage for log in drawn} == set(SHAPES)
    assert {log.sample_rate for log in drawn} == set(SAMPLE_RATES)
    assert {name for log in drawn for name in log.added} == set(ADDED)
    assert {np.unique(log.jumps).size - 1 for log in drawn} == {0, 1, 2}
    sizes = [log.u.size for log in drawn]
    assert SAMPLES[0] <= min(sizes) < 5_000
    assert 30_000 < max(sizes) <= SAMPLES[1]
    assert min(np.nanmin(log.u) for log in drawn) < -50.0
    assert sum(np.nanmin(log.u) >= 0.0 for log in drawn) > 10


@pytest.mark.parametrize("seed", SEEDS)
def test_a_reading_is_truth_jumps_noise_and_spikes(seed: int) -> None:
    log = draw(seed)
    assert log.u.shape == log.x.shape == log.truth.shape == log.jumps.shape == log.spikes.shape
    assert np.isfinite(log.truth).all()
    rest = log.x - log.truth - log.jumps
    assert np.nanstd(rest[~log.spikes]) == pytest.approx(log.noise, rel=0.05)
    assert log.stroke == pytest.approx(np.ptp(log.truth))
    missing = np.isnan(log.x)
    assert missing.mean() == pytest.approx(log.added.get("dropouts", 0.0))
    assert np.array_equal(np.isnan(log.u), missing) if "rows" in log.added else np.isfinite(log.u).all()
    far = np.abs(rest[log.spikes & ~missing])
    assert far.size == 0 or np.median(far) > 0.05 * log.stroke
    jumped = np.flatnonzero(np.diff(log.jumps))
    assert ("jumps" in log.added) == (jumped.size > 0)


def test_the_delay_is_what_the_log_says() -> None:
    """A clean stage that was not moved before does what its own model does with a voltage as late."""
    drawn = [logs.draw(seed, clean=True) for seed in range(24)]
    found = [log for log in drawn if not {"cycled", "rows"} & set(log.added)]
    assert len({log.added.get("delay", 0.0) for log in found}) > 3
    for log in found:
        index = np.arange(log.u.size)
        errors = []
        delays = np.arange(0.0, 5.1, 0.125)
        for delay in delays:
            late = np.interp(index - delay, index, log.u)
            x = log.model.simulate(np.concatenate((np.linspace(0.0, log.u[0], 500), late)))[500:]
            errors.append(np.std((log.truth - x)[10:]))
        assert delays[np.argmin(errors)] == pytest.approx(log.added.get("delay", 0.0), abs=0.26)
        assert min(errors) < 2e-3 * log.stroke


@pytest.mark.parametrize("kind", SHAPES)
def test_voltages_move_steadily_over_their_whole_range(kind: str) -> None:
    for seed in range(10):
        shape = draw_voltage(kind, 40_000, 20.0, np.random.default_rng(seed))
        assert shape.shape == (40_000,)
        assert (shape.min(), shape.max()) == pytest.approx((-1.0, 1.0))
        # The fastest are the ramps of a staircase, in a 20th of a step.
        assert np.abs(np.diff(shape)).max() < 0.05
        # They turn in either half.
        for half in np.split(shape, 2):
            moves = np.sign(np.diff(half))
            assert np.sum(np.abs(np.diff(moves[moves != 0.0])) > 0.0) >= 2


def test_a_clean_log_of_a_family() -> None:
    for seed in range(10):
        log = logs.draw(seed, family="duhem", clean=True)
        assert log.family == "duhem"
        assert not {"creep", "drift", "jumps", "spikes"} & set(log.added)
        assert not log.spikes.any()
    with pytest.raises(ValueError, match="family must be one of"):
        logs.draw(0, family="unheard-of")
