"""What a controller does not do to a stage: jumps, shaking, following what is not true."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
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
    r = pz.signals.triangle(1.0, 5.0, 8, 1000.0).values + bias
    driver = pz.AdaptiveFeedforward(1000.0, limits=LIMITS, gain=gain)
    _, true = in_blocks(driver, pz.SimulatedStage(1000.0, LOOP), r, 400)
    assert last_error(r, true, r.size - 800) < 0.9


def test_a_dead_sensor_and_long_blocks_do_not_lead_away() -> None:
    driver, r = pz.AdaptiveFeedforward(FS, limits=LIMITS), np.zeros(1000)
    for _ in range(20):
        u = driver.run(r)
        assert np.abs(u).max() < 40.0
        driver.learn(u, r)
    assert driver.status.fault == "no response"


def test_a_dead_sensor_with_noise_is_tried_again_in_small_ways_only() -> None:
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
    assert last_error(r[15_000:], drive(driver, pz.SimulatedStage(FS, LOOP), r[15_000:]).x) < 0.02


@pytest.mark.parametrize("amplitude", [0.1, 0.5, 5.0])
def test_small_swings_are_learnt_as_soon_as_large_ones(amplitude: float) -> None:
    r = triangle(6, amplitude)
    driver, _, true = driven(r, pz.SimulatedStage(FS, LOOP))
    assert last_error(r, true) < 0.012 * amplitude
    assert driver.status.driving != "line"


@pytest.mark.parametrize("frequency", [200.0, 400.0])
def test_a_resonance_is_not_fed(frequency: float) -> None:
    stage = pz.SimulatedStage(FS, LOOP, mechanics=pz.MassSpringDamper(frequency, 0.01))
    r = pz.signals.sine(3.0, 10.0, 12.0, FS).values
    line, _, by_line = driven(r, stage, estimators=())
    stage.reset()
    _, _, true = driven(r, stage)
    assert line.status.stage == "running"
    assert last_error(r, true, 3000) < 1.5 * last_error(r, by_line, 3000)


@pytest.mark.parametrize("slew_rate", [60.0, 250.0])
def test_a_slow_amplifier_is_waited_for(slew_rate: float) -> None:
    r = triangle(20, 0.5).repeat(4)
    stage = pz.SimulatedStage(FS, LOOP, amplifier=Amplifier(-60.0, 60.0, slew_rate=slew_rate))
    _, u, true = driven(r, stage, block=20)
    assert np.abs(r - true).max() < 2.0
    assert np.abs(u).max() < 15.0
    assert np.abs(r - true)[-4000:].max() < 0.02


@pytest.mark.parametrize("wrong", ["reversed", "no response"])
def test_readings_that_say_nothing_move_nothing(wrong: str) -> None:
    r = triangle(24, 3.0)
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=())
    noise = np.random.default_rng(0).normal(0.0, 1e-3, r.size)

    def read(k: int, x: float) -> float:
        if k < 6000:
            return x
        return -x if wrong == "reversed" else 4.0 + noise[k]

    u = np.abs(drive(driver, pz.SimulatedStage(FS, LOOP), r, read).u)
    assert driver.status.fault == wrong
    # The fault is named within a period; what was learnt meanwhile is forgotten.
    assert u[6000:].max() < 2.0 * u[3000:6000].max()
    assert u[7000:].max() < 1.3 * u[3000:6000].max()


def test_a_zero_that_jumps_does_not_move_the_stage() -> None:
    r, driver = triangle(20, 3.0), pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=())
    true = drive(driver, pz.SimulatedStage(FS, LOOP), r, lambda k, x: x + (20.0 if k >= 6000 else 0.0)).x
    assert driver.status.fault == "zero moved"
    assert np.abs(r - true)[6000:].max() < 1.3 * np.abs(r - true)[5000:6000].max()


def test_ways_for_nothing_leave_the_stage_where_it_was() -> None:
    driver, rng = pz.AdaptiveFeedforward(FS, limits=LIMITS), np.random.default_rng(0)
    run = drive(driver, pz.SimulatedStage(FS, LOOP), np.ones(20000), lambda *_: rng.normal())
    assert driver.status.fault == "no response"
    assert run.x.max() > 4.0
    assert abs(run.x[run.u == 0.0][-1]) < 0.25


def test_a_sensor_that_never_speaks_is_named() -> None:
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=())
    r, stage = np.ones(5000), pz.SimulatedStage(FS, LOOP)
    drive(driver, stage, r, lambda *_: None)
    assert (driver.status.fault, driver.events[0].name, driver.voltage) == ("no readings", "no readings", 0.0)
    x = drive(driver, stage, r).x
    assert driver.status.stage == "running"
    assert abs(x[-1] - 1.0) < 0.1
