"""Doubts about logs: none about healthy ones of any family, and the right one where columns are swapped."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.bench.zoo.families import FAMILIES, Reach, draw_family
from piezoest.fitting.flaws import flawed
from piezoest.identification.feedback_in_log import answer
from piezoest.identification.sense import findings
from piezoest.records import Record
from tests.identification.zoo_logs import zoo_log


def doubts(u: FloatArray, x: FloatArray, rate: float = 1000.0) -> list[str]:
    return [each.name for each in findings(Record.from_arrays(u, x, rate)) if each.severity == "doubt"]


@pytest.mark.slow
def test_healthy_logs_of_all_families_are_without_flaw_and_not_doubted() -> None:
    for seed in range(100):
        u, x, rate, _ = zoo_log(seed)
        flaws = flawed(u, x)
        assert not flaws.unusable.any(), seed
        assert flaws.jumps.size == 0, seed
        assert doubts(u, x, rate) == [], seed


def test_noise_of_the_voltage_is_no_feedback() -> None:
    rng = np.random.default_rng(0)
    for seed in range(56):
        u, x, _, _ = zoo_log(seed)
        noisy = u + 10.0 ** rng.uniform(-5.0, -3.0) * np.ptp(u) * rng.standard_normal(u.size)
        assert not answer(noisy, x, float(np.polyfit(u, x, 1)[0])).closed, seed


@pytest.mark.parametrize("family", FAMILIES)
def test_swapped_columns_turn_the_loop_round(family: str) -> None:
    model: Any = draw_family(family, np.random.default_rng(5), Reach(-100.0, 100.0), width=0.12, gain=0.1)
    t = np.linspace(0.0, 1.0, 6000)
    u = 95.0 * np.sin(2.0 * np.pi * 6.0 * t)
    x = model.simulate(u) + 5e-3 * np.random.default_rng(6).standard_normal(t.size) + 2.0 * t + 30.0
    assert [each.severity for each in findings(Record.from_arrays(u, x, 1000.0))] == ["note"]  # the drift
    assert "clockwise" in doubts(x, u)


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
        assert doubts(u, x) == []


def test_an_ellipse_is_no_straight_line() -> None:
    phase = 0.0126 * np.arange(6000)
    x = 5.0 + 4.0 * np.sin(phase - 0.03) + 1e-3 * np.random.default_rng(0).standard_normal(6000)
    assert "straight" not in doubts(50.0 + 40.0 * np.sin(phase), x)


@pytest.mark.parametrize("part", [0.8, 0.9, 0.96])
def test_a_sensor_that_ends_at_a_limit_is_clipped(part: float) -> None:
    for seed in range(8):
        rng = np.random.default_rng(seed // 2)
        turns = rng.uniform(2.0, 6.0) * np.arange(4000) / 1000.0
        wave = np.sin(6.28 * turns) if seed % 2 else np.abs(turns % 1.0 * 4.0 - 2.0) - 1.0
        x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(50.0 + 45.0 * wave, allow_jumps=True)
        x += 3e-3 * rng.standard_normal(4000)
        assert "clipped displacement" in doubts(50.0 + 45.0 * wave, np.minimum(x, np.quantile(x, part)))


def test_a_loop_that_is_too_wide_for_most_stages_is_named() -> None:
    u = 50.0 - 50.0 * np.cos(2.0 * np.pi * np.arange(8000) / 1000.0)
    x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u, allow_jumps=True)
    x += 3e-3 * np.random.default_rng(0).standard_normal(x.size)
    assert findings(Record.from_arrays(u, x, 1000.0)) == ()
    late = findings(Record.from_arrays(u[100:], x[:-100], 1000.0))
    assert [each.name for each in late] == ["wide loop"]


@pytest.mark.parametrize(("drift", "expected"), [(2.0, []), (20.0, ["drift"])])
def test_a_drift_of_more_than_half_the_stroke_is_doubted(drift: float, expected: list[str]) -> None:
    t = np.arange(8000) / 1000.0
    u = 50.0 - 50.0 * np.cos(2.0 * np.pi * t)
    x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u, allow_jumps=True) + drift * t / t[-1]
    assert doubts(u, x) == expected


def test_what_the_voltage_does_not_move_is_unrelated() -> None:
    t = np.arange(8000) / 1000.0
    assert doubts(50.0 - 50.0 * np.cos(2.0 * np.pi * t), t) == ["unrelated"]


def test_noise_of_a_small_swing_is_no_clipped_voltage() -> None:
    rng = np.random.default_rng(0)
    u = 0.1 * np.sin(2.0 * np.pi * np.arange(8000) / 1000.0)
    assert "clipped voltage" not in doubts(np.round(u, 3), 0.08 * u + 1e-3 * rng.standard_normal(u.size))


def test_many_jumps_of_one_size_are_those_of_a_reading_that_wraps() -> None:
    u = 50.0 - 50.0 * np.cos(2.0 * np.pi * np.arange(8000) / 1000.0)
    x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u, allow_jumps=True)
    said = {each.name: each.sentence for each in findings(Record.from_arrays(u, np.mod(x, 1.0), 1000.0))}
    assert "wrap" in said["jumps"]
