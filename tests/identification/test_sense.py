"""Doubts about logs: none about healthy ones of any family, and the right one where columns are swapped."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.zoo.families import FAMILIES, Reach, draw_family
from piezoest.identification.feedback_in_log import answer
from piezoest.identification.loop_direction import loop_of
from piezoest.identification.sense import findings
from piezoest.records import Record
from tests.identification.zoo_logs import zoo_log


@pytest.mark.slow
def test_healthy_logs_of_all_families_are_not_doubted() -> None:
    doubted = []
    for seed in range(100):
        u, x, rate, _ = zoo_log(seed)
        found = findings(Record.from_arrays(u, x, rate))
        doubted += [(seed, each.sentence) for each in found if each.severity == "doubt"]
    assert doubted == []


def test_noise_of_the_voltage_is_no_feedback() -> None:
    rng = np.random.default_rng(0)
    for seed in range(60):
        u, x, _, _ = zoo_log(seed)
        noisy = u + 10.0 ** rng.uniform(-5.0, -3.0) * np.ptp(u) * rng.standard_normal(u.size)
        assert not answer(noisy, x, float(np.polyfit(u, x, 1)[0])).closed, seed


@pytest.mark.parametrize("gain", [50.0, 200.0])
def test_integral_feedback_is_seen_in_the_log(gain: float) -> None:
    fs = 10_000.0
    r = pz.signals.sine(5.0, 5.0, 5.0, fs)
    feedback = pz.IntegralFeedback(pz.LinearCompensator(pz.LinearGain(0.1)), gain=gain, sample_rate=fs)
    record = pz.track(r, stage=pz.PaperStage(fs, quantisation=False), compensator=feedback)
    found = findings(Record.from_arrays(record.voltage, record.measured, fs))
    assert [each.name for each in found if each.severity == "doubt"] == ["closed loop"]


@pytest.mark.parametrize("family", FAMILIES)
def test_swapped_columns_turn_the_loop_round(family: str) -> None:
    reach = Reach(-100.0, 100.0)
    model: Any = draw_family(family, np.random.default_rng(5), reach, width=0.12, gain=0.1)
    t = np.linspace(0.0, 1.0, 6000)
    u = 95.0 * np.sin(2.0 * np.pi * 6.0 * t)
    x = model.simulate(u) + 5e-3 * np.random.default_rng(6).standard_normal(t.size) + 2.0 * t + 30.0
    assert findings(Record.from_arrays(u, x, 1000.0))[:1] != ()  # the drift
    assert [each.severity for each in findings(Record.from_arrays(u, x, 1000.0))] == ["note"]
    assert "clockwise" in [each.name for each in findings(Record.from_arrays(x, u, 1000.0))]


def test_the_opening_of_a_loop_is_its_width_whatever_drifts() -> None:
    t = np.linspace(0.0, 1.0, 20_000)
    u = 50.0 * np.sin(2.0 * np.pi * 10.0 * t)
    play = pz.PrandtlIshlinskii(0.1, [5.0], [0.02]).simulate(u)
    known = np.ones(t.size, dtype=np.bool_)
    still = loop_of(u, play, known, 0.12)
    drifting = loop_of(u, play + 3.0 * t, known, 0.12)
    # A play of threshold 5 V is 10 V wide, but for where it turns.
    assert 0.7 * 0.2 < float(np.median(still.openings)) < 0.2
    np.testing.assert_allclose(drifting.openings, still.openings, atol=0.01)
    assert still.clockwise == 0.0
    assert still.opening > 0.0
    assert loop_of(t, t, known, 1.0).opening == 0.0  # which does not turn


@pytest.mark.parametrize("delay", range(8))
def test_a_staircase_answered_late_is_not_doubted(delay: int) -> None:
    for seed in range(8):
        rng = np.random.default_rng(seed)
        steps = rng.integers(8, 20)
        level = np.floor(rng.uniform(5.0, 25.0) * steps * np.arange(4000) / 4000)
        u = 50.0 + np.round(50.0 * np.abs((level / steps) % 2.0 - 1.0))
        x = pz.PrandtlIshlinskii(0.1, [5.0, 15.0], [0.02, 0.02]).simulate(u)
        x = np.append(np.full(delay, x[0]), x[: 4000 - delay])
        x += 10.0 ** rng.uniform(-4.0, -2.3) * np.ptp(x) * rng.standard_normal(4000)
        found = findings(Record.from_arrays(u, x, 1000.0))
        assert [each.name for each in found if each.severity == "doubt"] == []


def test_an_ellipse_is_no_straight_line() -> None:
    phase = 0.0126 * np.arange(6000)
    x = 5.0 + 4.0 * np.sin(phase - 0.03) + 1e-3 * np.random.default_rng(0).standard_normal(6000)
    found = findings(Record.from_arrays(50.0 + 40.0 * np.sin(phase), x, 1000.0))
    assert "straight" not in [each.name for each in found]


@pytest.mark.parametrize("part", [0.8, 0.9, 0.96])
@pytest.mark.parametrize("shape", [np.sin, lambda p: np.abs((p / 6.28) % 1.0 * 4.0 - 2.0) - 1.0])
def test_a_sensor_that_ends_at_a_limit_is_clipped(shape: Any, part: float) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        u = 50.0 + 45.0 * shape(6.28e-3 * rng.uniform(2.0, 6.0) * np.arange(4000))
        x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u, allow_jumps=True)
        x += 3e-3 * rng.standard_normal(4000)
        found = findings(Record.from_arrays(u, np.minimum(x, np.quantile(x, part)), 1000.0))
        assert "clipped displacement" in [each.name for each in found]
