"""What `learn` is told: wrong, missing and saturated readings, voltages that were rounded or measured."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.controller import levels
from tests.controller import shared
from tests.controller.shared import LIMITS, LOOP

FS, FAST = 5000.0, 50_000.0
TRIANGLE = pz.signals.triangle(5.0, 10.0, 30, FS).values
# So slow beside the sample rate that a sample of it is far less than a step of the converter.
SINE = 1.0 - pz.signals.sine(1.5, 10.0, 8, FAST).values


def drive(
    sensor: Any, r: FloatArray = TRIANGLE, left_out: Any = (), rate: float = FS
) -> tuple[Any, Any, Any]:
    """A controller after a reference, the voltage, and where the stage was; some `learn` are left out."""
    driver = pz.AdaptiveFeedforward(rate, limits=LIMITS)
    return driver, *shared.drive(driver, pz.SimulatedStage(rate, LOOP), r, sensor, left_out)[:2]


def true(_: int, x: float) -> float:
    return x


def last(x: FloatArray) -> float:
    """Largest error of the last three periods [µm]."""
    return shared.last_error(TRIANGLE, x, 1500)


def garbage(wrong: Callable[[Any], float], share: float) -> Callable[[int, float], float]:
    """A noisy sensor of which a share of the readings is something else."""
    rng = np.random.default_rng(7)

    def read(_: int, x: float) -> float:
        bad, noise = rng.random() < share, 0.003 * rng.standard_normal()
        return wrong(rng) if bad else x + noise

    return read


def int32(rng: Any) -> float:
    return 1e-3 * float(rng.integers(-(2**31), 2**31))


def zero(_: Any) -> float:
    return 0.0


@pytest.mark.parametrize("share", [0.001, 0.01])
@pytest.mark.parametrize(
    "wrong",
    [
        int32,
        lambda rng: float(10.0 ** rng.uniform(-2.0, 6.0)),
        lambda rng: float(rng.uniform(-10.0, 10.0)),
        zero,
    ],
    ids=["int32 in nm", "any size", "within the stroke", "zero"],
)
def test_single_readings_that_are_garbage_do_not_matter(wrong: Any, share: float) -> None:
    driver, _, x = drive(garbage(wrong, share))
    assert last(x) < 0.05
    assert driver.events == ()


def test_two_seconds_of_garbage_are_forgotten() -> None:
    bad, good = garbage(int32, 0.05), garbage(zero, 0.0)
    assert last(drive(lambda k, x: (bad if 2000 < k < 12000 else good)(k, x))[2]) < 0.05


def test_a_learn_that_is_left_out_does_not_matter() -> None:
    sensor = garbage(zero, 0.0)
    whole, u, _ = drive(sensor)
    for left_out in (range(37, TRIANGLE.size, 100), range(1, TRIANGLE.size, 3)):
        driver, planned, x = drive(sensor, left_out=left_out)
        assert last(x) < 0.1
        # The voltage goes on as smoothly as that of a loop without a gap.
        assert np.abs(np.diff(planned[-5000:])).max() < 2.5 * np.abs(np.diff(u[-5000:])).max()
        assert driver.status.driving == whole.status.driving


@pytest.mark.parametrize("step", [0.05, 0.2, 0.4])
def test_a_coarse_sensor_is_enough(step: float) -> None:
    driver, _, x = drive(lambda _, x: step * round(x / step))
    assert driver.status.stage == "running"
    assert last(x) < 0.7 + step


@pytest.mark.parametrize("size", [0.0, 1.0, 0.02])
def test_what_is_out_of_reach_is_said_once(size: float) -> None:
    driver, u, _ = drive(true, 12.0 + size / 5.0 * TRIANGLE)
    assert [event.name for event in driver.events] == ["out of reach"]
    assert driver.status.fault == ""
    assert np.all(u[-5000:] == 60.0)


@pytest.mark.parametrize("given", [{}, {"gain": 0.15}])
def test_without_a_reference_the_voltage_stays_where_the_start_has_left_it(given: Any) -> None:
    driver, stage = pz.AdaptiveFeedforward(FS, limits=LIMITS, **given), pz.SimulatedStage(FS, LOOP)
    assert np.ptp(shared.drive(driver, stage, np.full(2000, np.nan)).u[1000:]) == 0.0
    assert last(shared.drive(driver, stage, TRIANGLE).x) < 0.05


def test_readings_that_do_not_come_are_reported_once_and_so_is_their_return() -> None:
    driver, _, _ = drive(lambda k, x: None if 4000 < k < 12_000 else x)
    said = [(event.action, event.name) for event in driver.events]
    assert said == [("went on", "no readings"), ("resumed", "")]
    assert driver.events[0].time == pytest.approx(1.8, abs=0.01)


def test_between_rare_readings_the_approach_does_not_go_too_far() -> None:
    r = pz.signals.triangle(3.0, 2.0, 10, 1000.0).values
    driver, stage = pz.AdaptiveFeedforward(1000.0, limits=LIMITS), pz.PaperStage(1000.0, seed=1)
    x = shared.drive(driver, stage, r, lambda k, x: x if k % 50 == 0 else None).x
    assert np.abs(x).max() < 5.0
    assert shared.last_error(r, x) < 0.05


def saturated(end: float, before: Callable[[int, float], float] = true, since: int = 0) -> Any:
    """A noisy sensor whose readings stay within -end and end [µm] from a sample on."""
    rng = np.random.default_rng(3)

    def read(k: int, x: float) -> float:
        reading = before(k, x) + rng.normal(0.0, 0.002)
        return min(max(reading, -end), end) if k >= since else reading

    return read


# Levels taken for answers made the line 45 % and more; one that was good before is kept.
@pytest.mark.parametrize(
    ("amplitude", "since", "most"), [(1.0, 0, 0.12), (2.0, 0, 0.12), (5.0, 0, 0.12), (4.0, 8000, 0.1)]
)
def test_the_line_is_that_between_the_levels_of_a_saturated_sensor(
    amplitude: float, since: int, most: float
) -> None:
    r = pz.signals.triangle(amplitude, 5.0, 20, FS).values
    driver, _, x = drive(saturated(0.6 * amplitude, since=since), r)
    assert "saturated" in {event.name for event in driver.events}
    assert shared.last_error(r, x) < most * amplitude


def test_late_readings_that_stand_still() -> None:
    raster = np.clip(1.6 * pz.signals.triangle(2.0, 47.0, 60, 1000.0).values, -2.0, 2.0)
    _, _, x = drive(saturated(1.2, shared.late(3)), raster, rate=1000.0)
    assert shared.last_error(raster, x) < 0.2


def told(change: Callable[[float], float], r: FloatArray = SINE, block: int = 1) -> tuple[Any, FloatArray]:
    """The controller and its errors where the stage gets a voltage and `learn` is told a changed one."""
    driver, stage, x = (
        pz.AdaptiveFeedforward(FAST, limits=LIMITS),
        pz.SimulatedStage(FAST, LOOP),
        np.empty_like(r),
    )
    for k in range(0, r.size, block):
        part = slice(k, k + block)
        u = driver.run(r[part])
        x[part] = stage.run(u)
        driver.learn([change(each) for each in u.tolist()], x[part])
    return driver, np.abs(r - x)


def rounded(bits: int) -> Callable[[float], float]:
    step = 120.0 / 2**bits
    return lambda u: round(u / step) * step


@pytest.mark.parametrize(
    ("bits", "block", "most"), [(10, 1, 0.1), (12, 1, 0.03), (16, 1, 0.01), (12, 7, 0.03), (12, 50, 0.03)]
)
def test_a_voltage_that_a_converter_has_rounded_does_not_stand_still(
    bits: int, block: int, most: float
) -> None:
    driver, error = told(rounded(bits), block=block)
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


def test_a_limit_is_one_whatever_a_converter_makes_of_it() -> None:
    driver, _ = told(rounded(9), np.full(30_000, 40.0))
    assert [event.name for event in driver.events] == ["out of reach"]


def test_a_slew_rate_is_kept_where_a_sample_of_it_is_less_than_a_step() -> None:
    limits = pz.VoltageLimits(-60.0, 60.0, slew_rate=1000.0, sample_rate=FAST)
    driver, stage = pz.AdaptiveFeedforward(FAST, limits=limits), pz.SimulatedStage(FAST, LOOP)
    run = shared.drive(driver, stage, np.full(50_000, 4.0), told=rounded(10))
    assert np.abs(np.diff(run.u)).max() < limits.largest_step * (1.0 + 1e-9)
    assert abs(run.x[-1] - 4.0) < 0.05


def test_a_reading_beyond_a_level_shows_that_it_is_none() -> None:
    known = SimpleNamespace(rose=0.0, top=0.0, bottom=0.0, has_top=0.0, has_bottom=0.0, early=0.0)
    levels.change(known, 0.0, 2.0)
    levels.stand(known, 2.0, False)
    levels.change(known, 2.0, -1.0)
    levels.stand(known, -1.0, True)
    assert levels.holds(known, 2.0)
    assert levels.holds(known, -1.0)
    assert not levels.holds(known, 0.5)
    levels.change(known, -1.0, 2.5)
    assert not levels.holds(known, 2.0)
    assert levels.are_known(known)
    assert known.early == 1.0
