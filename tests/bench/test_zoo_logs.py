"""Simulated recordings: functions of their seed, with all that users' logs have, true to what they say."""

from functools import cache

import numpy as np
import pytest

from piezoest.bench.zoo import logs
from piezoest.bench.zoo.logs import Log

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
