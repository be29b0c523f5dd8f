"""The voltage that `learn` is told: rounded by a converter, or measured by a monitor with errors."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from tests.controller.shared import LIMITS, LOOP, drive

FS = 50_000.0
RANGE = LIMITS.maximum - LIMITS.minimum
# So slow beside the sample rate that a sample of it is far less than a step of the converter.
SINE = 1.0 - pz.signals.sine(1.5, 10.0, 8, FS).values


def told(change: Callable[[float], float], r: FloatArray = SINE) -> tuple[Any, FloatArray]:
    """The controller and its errors where the stage gets a voltage and `learn` is told a changed one."""
    driver, stage = pz.AdaptiveFeedforward(FS, limits=LIMITS), pz.SimulatedStage(FS, LOOP)
    return driver, np.abs(r - drive(driver, stage, r, told=change).x)


def rounded(bits: int) -> Callable[[float], float]:
    step = RANGE / 2**bits
    return lambda u: round(u / step) * step


@pytest.mark.parametrize(("bits", "most"), [(10, 0.1), (12, 0.03), (16, 0.01)])
def test_a_voltage_that_a_converter_has_rounded_does_not_stand_still(bits: int, most: float) -> None:
    driver, error = told(rounded(bits))
    assert driver.status.stage == "running"
    assert driver.events == ()
    assert error[-10_000:].max() < most


@pytest.mark.parametrize(("gain", "offset", "noise"), [(0.99, 0.5, 0.0), (1.01, -0.4, 0.0), (1.0, 0.0, 0.1)])
def test_a_monitor_may_be_off_by_a_hundredth_of_the_range(gain: float, offset: float, noise: float) -> None:
    rng = np.random.default_rng(3)
    driver, error = told(lambda u: gain * u + offset + noise * rng.standard_normal())
    assert driver.status.stage == "running"
    assert driver.events == ()
    assert error[-10_000:].max() < 0.01


@pytest.mark.parametrize("block", [7, 50])
def test_blocks_may_be_rounded(block: int) -> None:
    driver, stage = pz.AdaptiveFeedforward(FS, limits=LIMITS), pz.SimulatedStage(FS, LOOP)
    change, x = rounded(12), np.empty_like(SINE)
    for k in range(0, SINE.size, block):
        part = slice(k, k + block)
        u = driver.run(SINE[part])
        x[part] = stage.run(u)
        driver.learn(np.array([change(each) for each in u.tolist()]), x[part])
    assert driver.status.stage == "running"
    assert np.abs(SINE - x)[-10_000:].max() < 0.03


def test_a_limit_is_one_whatever_a_converter_makes_of_it() -> None:
    driver, _ = told(rounded(9), np.full(30_000, 40.0))
    assert [event.name for event in driver.events] == ["out of reach"]


def test_a_slew_rate_is_kept_where_a_sample_of_it_is_less_than_a_step() -> None:
    limits = pz.VoltageLimits(-60.0, 60.0, slew_rate=1000.0, sample_rate=FS)
    driver, stage = pz.AdaptiveFeedforward(FS, limits=limits), pz.SimulatedStage(FS, LOOP)
    u = drive(driver, stage, np.full(50_000, 4.0), told=rounded(10)).u
    assert np.abs(np.diff(u)).max() < limits.largest_step * (1.0 + 1e-9)
    assert abs(float(np.asarray(stage.displacement)) - 4.0) < 0.05
