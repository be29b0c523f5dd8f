"""Scenarios: the same seed the same case, each with what its name says."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from piezoest.bench.cases import RIGHT_GAIN, RIGHT_MODEL, Case
from piezoest.bench.scenarios import DRIFT, GAIN_RAMP, SCENARIOS
from piezoest.signals import check_continuity

EVERY = pytest.mark.parametrize("name", SCENARIOS)
SMALL: dict[str, Any] = {"sample_rate": 4000.0, "before": 3, "after": 4, "rest": 0.5, "drift": 1.0}


def case(name: str, seed: int = 0, **overrides: Any) -> Case:
    return SCENARIOS[name].build(seed, **{**SMALL, **overrides})


def factors(made: Case) -> Any:
    schedule: Any = made.gain_schedule
    return np.interp(made.reference.time, *np.transpose(schedule))


@EVERY
def test_the_same_seed_gives_the_same_case_and_the_same_stage(name: str) -> None:
    first, again, other = case(name, 3), case(name, 3), case(name, 4)
    for field in fields(Case):
        assert field.name == "reference" or getattr(first, field.name) == getattr(again, field.name)
    np.testing.assert_array_equal(first.reference.values, again.reference.values)
    u = 5.0 * np.asarray(first.reference)
    x, same, another = (each.new_stage().run(u) for each in (first, again, other))
    np.testing.assert_array_equal(x, same)
    assert np.any(x != another)
    assert np.any(first.start.theta != other.start.theta)


@EVERY
def test_a_case_is_fit_for_the_loop(name: str) -> None:
    for seed in range(20):
        made = case(name, seed)
        assert made.start.is_admissible
        assert made.linear_start.is_admissible
        assert 0 <= made.change <= len(made.reference) - made.period
        assert made.new_stage().sample_rate == made.sample_rate == 4000.0
        spread = 0.1 if made.change else 0.5
        assert np.max(np.abs(made.start.theta / RIGHT_MODEL.theta - 1.0)) <= spread
        assert abs(made.linear_start.gain / RIGHT_GAIN.gain - 1.0) <= spread
        assert np.max(np.abs(made.reference.values)) <= 1.1 * max(made.amplitude, 7.5)
    check_continuity(made.reference.values, made.sample_rate)


@EVERY
def test_amplitude_frequency_and_sample_rate_scale(name: str) -> None:
    base, slow = case(name), case(name, amplitude=2.0, frequency=2.5, rest=1.0, drift=2.0)
    assert (slow.period, slow.change) == (2.0 * base.period, 2 * base.change)
    assert len(slow.reference) == 2 * len(base.reference)
    ratio = slow.reference.amplitude / base.reference.amplitude
    assert ratio == pytest.approx(slow.amplitude / base.amplitude, rel=1e-3)
    finer = case(name, sample_rate=8000.0)
    assert finer.period == 2.0 * base.period
    np.testing.assert_allclose(finer.reference.values[::2], base.reference.values, atol=0.02)
    np.testing.assert_array_equal(finer.start.theta, base.start.theta)


def test_amplitudes_change_where_the_case_says() -> None:
    for name, before, after in (("amplitude-switch", 2.5, 7.5), ("amplitude-drop", 7.5, 2.5)):
        made = case(name)
        assert made.amplitude == pytest.approx(after)
        r = np.abs(made.reference.values)
        assert np.max(r[: made.change]) == pytest.approx(before, rel=0.05)
        assert np.max(r[made.change :]) == pytest.approx(after, rel=0.05)
        assert r[made.change] < 1e-9


def test_gain_steps_within_a_twentieth_of_a_period() -> None:
    phases = []
    for seed in range(30):
        made = case("gain-step", seed)
        factor = factors(made)
        assert np.all(factor[: made.change] == 1.0)
        np.testing.assert_allclose(factor[made.change + round(GAIN_RAMP * made.period) + 1 :], 0.8)
        phases.append(made.change / made.period - 3.0)
    assert 0.0 <= min(phases) < 0.2 < 0.8 < max(phases) < 1.0


def test_drift_is_one_per_cent_a_second_and_a_dwell_rests() -> None:
    made = case("drift", drift=2.0)
    factor = factors(made)
    assert np.all(factor[: made.change + 1] == 1.0)
    np.testing.assert_allclose(np.diff(factor[made.change :]) * made.sample_rate, DRIFT)
    assert (len(made.reference) - made.change) / made.sample_rate == pytest.approx(2.0)
    assert SCENARIOS["drift"].build(0, sample_rate=1000.0).reference.duration == pytest.approx(5.8)
    made = case("dwell")
    r, first, end = made.reference.values, round(3 * made.period), made.change
    assert np.all(r[first:end] == 0.0)
    assert (end - first) / made.sample_rate == 0.5
    np.testing.assert_array_equal(r[end : end + 800], r[:800])
