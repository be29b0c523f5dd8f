"""What a controller does not do to a stage: jumps, shaking, following what is not true, wrong names."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.bench import zoo
from piezoest.bench.zoo.running import run_controller
from piezoest.controller.faults import FAULTS
from piezoest.stage import Amplifier
from tests.controller.shared import LIMITS, LOOP, drive, in_blocks, last_error

FS = 5000.0


def triangle(periods: int, amplitude: float) -> FloatArray:
    return pz.signals.triangle(amplitude, 10.0, periods, FS).values


def driven(r: FloatArray, stage: Any, *, block: int = 1, **options: Any) -> Any:
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, **options)
    return driver, *in_blocks(driver, stage, r, block)


@pytest.mark.parametrize("block", [1, 7, 60, 300])
def test_the_start_does_not_jump(block: int) -> None:
    _, u, _ = driven(np.zeros(3000), pz.SimulatedStage(FS, LOOP), block=block, estimators=())
    # The ways are 0.6 V and 2.4 V long, and as far back; in a block two follow one another, 2.4 V and 4.8 V.
    assert 1.0 < np.abs(u).max() < (8.0 if block == 300 else 6.0)
    assert np.abs(np.diff(u)).max() < 0.4


@pytest.mark.parametrize("gain", [None, 0.14])
@pytest.mark.parametrize("bias", [0.0, 3.0, -4.0])
def test_blocks_of_two_periods_are_good_from_the_third_on(bias: float, gain: float | None) -> None:
    """Both ways of the start are in the first block, and the second block leads to the reference."""
    rate = 1000.0
    r = pz.signals.triangle(1.0, 5.0, 8, rate).values + bias
    driver = pz.AdaptiveFeedforward(rate, limits=LIMITS, gain=gain)
    _, true = in_blocks(driver, pz.SimulatedStage(rate, LOOP), r, 400)
    assert last_error(r, true, r.size - 800) < 0.9


def test_a_dead_sensor_and_long_blocks_do_not_lead_away() -> None:
    """No way goes on before the one before it was judged, but in the first block."""
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS)
    r = np.zeros(1000)
    for _ in range(20):
        u = driver.run(r)
        assert np.abs(u).max() < 40.0
        driver.learn(u, r)
    assert driver.status.fault == "no response"


def test_a_dead_sensor_with_noise_is_tried_again_in_small_ways_only() -> None:
    """The first try goes half the way to a limit; before, all later ones did so, too."""
    driver, rng = pz.AdaptiveFeedforward(FS, limits=LIMITS), np.random.default_rng(1)
    r, noise = triangle(60, 1.0), rng.normal(0.0, 0.05, 30_000)
    u = drive(driver, pz.SimulatedStage(FS, LOOP), r[:15_000], lambda k, _: noise[k]).u
    assert driver.status.fault == "no response"
    assert np.abs(u).max() > 20.0
    tried = np.flatnonzero(np.abs(u) > 10.0)[-1] + 100
    again = np.abs(u[tried:])
    assert tried < 1000
    # A way of 2 % of the range; in the eighth try another one follows, twice as long.
    assert 2.0 < again[:8000].max() < 2.5
    assert 5.0 < again.max() < 7.5
    assert 2.0 < again[-4000:].max() < 2.5
    # The sensor comes to life.
    _, x, _ = drive(driver, pz.SimulatedStage(FS, LOOP), r[15_000:])
    assert last_error(r[15_000:], x) < 0.02


@pytest.mark.parametrize("amplitude", [0.1, 0.5, 5.0])
def test_small_swings_are_learnt_as_soon_as_large_ones(amplitude: float) -> None:
    r = triangle(6, amplitude)
    driver, _, true = driven(r, pz.SimulatedStage(FS, LOOP))
    assert last_error(r, true) < 0.012 * amplitude
    assert driver.status.driving != "line"


@pytest.mark.parametrize("frequency", [200.0, 400.0])
def test_a_resonance_is_not_fed(frequency: float) -> None:
    """Its peak is fifty times its gain: any loop around it that is fast would run away."""
    stage = pz.SimulatedStage(FS, LOOP, mechanics=pz.MassSpringDamper(frequency, 0.01))
    r = pz.signals.sine(3.0, 10.0, 12.0, FS).values
    line, _, by_line = driven(r, stage, estimators=())
    stage.reset()
    _, _, true = driven(r, stage)
    assert line.status.stage == "running"
    assert last_error(r, true, 3000) < 1.5 * last_error(r, by_line, 3000)


@pytest.mark.parametrize("slew_rate", [60.0, 250.0])
def test_a_slow_amplifier_is_waited_for(slew_rate: float) -> None:
    """What has not happened yet would pass for a small gain, which asks for large voltages."""
    r = triangle(20, 0.5).repeat(4)
    stage = pz.SimulatedStage(FS, LOOP, amplifier=Amplifier(-60.0, 60.0, slew_rate=slew_rate))
    _, u, true = driven(r, stage, block=20)
    assert np.abs(r - true).max() < 2.0
    assert np.abs(u).max() < 15.0
    assert np.abs(r - true)[-4000:].max() < 0.02


@pytest.mark.parametrize("seed", [30230, 30468, 31415])
def test_what_the_first_way_leaves_behind_is_no_small_gain(seed: int) -> None:
    """Relays whose loop is wide: on the way back through the beginning they have hardly moved."""
    rig = zoo.draw(seed)
    traces, _ = run_controller(rig, pz.AdaptiveFeedforward(rig.sample_rate, limits=rig.limits))
    assert np.abs(traces.displacement).max() < 6.0 * rig.plain.amplitude


@pytest.mark.parametrize("wrong", ["reversed", "dead"])
def test_readings_that_say_nothing_move_nothing(wrong: str) -> None:
    """The line would follow them, and the voltage go to a limit."""
    r = triangle(24, 3.0)
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=())
    noise = np.random.default_rng(0).normal(0.0, 1e-3, r.size)

    def read(k: int, x: float) -> float:
        return x if k < 6000 else -x if wrong == "reversed" else 4.0 + noise[k]

    u = drive(driver, pz.SimulatedStage(FS, LOOP), r, read).u
    assert driver.status.fault == {"reversed": "reversed", "dead": "no response"}[wrong]
    # The fault is named within a period; what was learnt meanwhile is forgotten.
    assert np.abs(u[6000:]).max() < 2.0 * np.abs(u[3000:6000]).max()
    assert np.abs(u[7000:]).max() < 1.3 * np.abs(u[3000:6000]).max()


def test_a_zero_that_jumps_does_not_move_the_stage() -> None:
    """A gauge may come back; the reference has not moved."""
    r = triangle(20, 3.0)
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=())
    true = drive(driver, pz.SimulatedStage(FS, LOOP), r, lambda k, x: x + (20.0 if k >= 6000 else 0.0)).x
    before = np.abs(r - true)[5000:6000].max()
    assert driver.status.fault == "zero moved"
    assert np.abs(r - true)[6000:].max() < 1.3 * before


def test_ways_for_nothing_leave_the_stage_where_it_was() -> None:
    """A start that finds no answer goes far; hysteresis would keep a sixth of the farthest way."""
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS)
    rng = np.random.default_rng(0)
    run = drive(driver, pz.SimulatedStage(FS, LOOP), np.ones(20000), lambda *_: rng.normal())
    assert driver.status.fault == "no response"
    assert run.x.max() > 4.0
    assert abs(run.x[run.u == 0.0][-1]) < 0.25


def test_a_sensor_that_never_speaks_is_named() -> None:
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=())
    r, stage = np.ones(5000), pz.SimulatedStage(FS, LOOP)
    drive(driver, stage, r, lambda *_: None)
    assert (driver.status.fault, driver.voltage) == ("no readings", 0.0)
    _, x, _ = drive(driver, stage, r)
    assert driver.status.stage == "running"
    assert abs(x[-1] - 1.0) < 0.1


def named(seed: int, fault: str) -> list[str]:
    rig = zoo.draw(seed, fault=fault)
    row = zoo.play(rig, lambda sample_rate, limits: pz.AdaptiveFeedforward(sample_rate, limits=limits))
    assert row["failure"] is None
    return [name for name in row["named"].split("; ") if name in FAULTS[1:6]]


# Steps, walks and sums of sines with minor loops; a block that was planned before the reference was reached.
@pytest.mark.parametrize("seed", [92035, 92129, 92148, 92176, 92189, 92232, 92235])
def test_a_healthy_stage_gets_no_name(seed: int) -> None:
    assert named(seed, "none") == []


# A thousand times too large; reversed, in few samples; a thousand times too small.
@pytest.mark.parametrize(("seed", "name"), [(92026, "scaled"), (92020, "reversed"), (92022, "scaled")])
def test_a_wrong_factor_has_its_name(seed: int, name: str) -> None:
    assert name in named(seed, "sensor-factor")


def test_a_model_that_the_corridor_holds_back_gives_way_without_a_step() -> None:
    """A stage with backlash and late readings: the models are wrong by half the range of the voltage."""
    rig = zoo.draw(47342)
    driver, stage, r = pz.AdaptiveFeedforward(rig.sample_rate, limits=rig.limits), rig.stage(), rig.reference
    u = drive(driver, stage, r).u
    assert driver.status.switches > 2
    assert np.abs(np.diff(u)).max() < 0.08 * np.ptp(u)
