"""Single samples that are wrong or missing: readings that are garbage, a `learn` left out, few steps."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from tests.controller import shared
from tests.controller.shared import LIMITS, LOOP

FS = 5000.0
TRIANGLE = pz.signals.triangle(5.0, 10.0, 30, FS).values


def drive(sensor: Any, r: FloatArray = TRIANGLE, left_out: Any = ()) -> tuple[Any, FloatArray, FloatArray]:
    """A controller after a reference, the voltage, and where the stage was; some `learn` are left out."""
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS)
    return driver, *shared.drive(driver, pz.SimulatedStage(FS, LOOP), r, sensor, left_out)[:2]


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


@pytest.mark.parametrize("share", [0.001, 0.01])
@pytest.mark.parametrize(
    "wrong",
    [
        lambda rng: 1e-3 * float(rng.integers(-(2**31), 2**31)),
        lambda rng: float(10.0 ** rng.uniform(-2.0, 6.0)),
        lambda rng: float(rng.uniform(-10.0, 10.0)),
        lambda rng: 0.0,
    ],
    ids=["int32 in nm", "any size", "within the stroke", "zero"],
)
def test_single_readings_that_are_garbage_do_not_matter(wrong: Any, share: float) -> None:
    driver, _, x = drive(garbage(wrong, share))
    assert last(x) < 0.05
    assert driver.events == ()


def test_two_seconds_of_garbage_are_forgotten() -> None:
    bad = garbage(lambda rng: 1e-3 * float(rng.integers(-(2**31), 2**31)), 0.05)
    good = garbage(lambda rng: 0.0, 0.0)
    _, _, x = drive(lambda k, x: (bad if 2000 < k < 12000 else good)(k, x))
    assert last(x) < 0.05


def test_a_learn_that_is_left_out_does_not_matter() -> None:
    sensor = garbage(lambda rng: 0.0, 0.0)
    whole, u, _ = drive(sensor)
    for left_out in (range(37, TRIANGLE.size, 100), range(1, TRIANGLE.size, 3)):
        driver, planned, x = drive(sensor, left_out=left_out)
        assert last(x) < 0.1
        # The voltage goes on as smoothly as that of a loop without a gap.
        largest = np.abs(np.diff(u[-5000:])).max()
        assert np.abs(np.diff(planned[-5000:])).max() < 2.5 * largest
        assert driver.status.driving == whole.status.driving


def test_nobody_need_learn() -> None:
    driver, _, _ = drive(lambda _, x: x)
    voltages = np.array([driver.step(float(r)) for r in TRIANGLE])
    line = driver.candidates[0].model
    # Beside the line by no more than before, however long.
    assert np.abs(voltages - (TRIANGLE - line.offset) / line.gain).max() < 0.4 * 5.0 / line.gain


@pytest.mark.parametrize("step", [0.05, 0.2, 0.4])
def test_a_coarse_sensor_is_enough(step: float) -> None:
    driver, _, x = drive(lambda _, x: step * round(x / step))
    assert driver.status.stage == "running"
    assert last(x) < 0.7 + step


@pytest.mark.parametrize("size", [0.0, 1.0, 0.02])
def test_what_is_out_of_reach_is_said_once(size: float) -> None:
    driver, u, _ = drive(lambda _, x: x, 12.0 + size / 5.0 * TRIANGLE)
    assert [event.reason.split(":")[0] for event in driver.events] == ["out of reach"]
    assert driver.status.fault == ""
    assert np.all(u[-5000:] == 60.0)


@pytest.mark.parametrize("given", [{}, {"gain": 0.15}])
def test_without_a_reference_the_voltage_stays_where_the_start_has_left_it(given: Any) -> None:
    driver, stage = pz.AdaptiveFeedforward(FS, limits=LIMITS, **given), pz.SimulatedStage(FS, LOOP)
    u = shared.drive(driver, stage, np.full(2000, np.nan)).u
    assert np.ptp(u[1000:]) == 0.0
    _, x, _ = shared.drive(driver, stage, TRIANGLE)
    assert last(x) < 0.05


def test_readings_that_do_not_come_are_reported_once_and_so_is_their_return() -> None:
    driver, _, _ = drive(lambda k, x: None if 4000 < k < 12_000 else x)
    assert [(event.action, event.name) for event in driver.events] == [
        ("went on", "no readings"),
        ("resumed", ""),
    ]
    assert driver.events[0].time == pytest.approx(1.8, abs=0.01)


def test_a_sensor_that_has_never_given_a_reading_is_reported() -> None:
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS)
    for r_k in TRIANGLE[:6000].tolist():
        driver.learn(driver.step(r_k), None)
    assert driver.events[0].name == "no readings"
    assert driver.voltage == 0.0


def test_between_rare_readings_the_approach_does_not_go_too_far() -> None:
    r = pz.signals.triangle(3.0, 2.0, 10, 1000.0).values
    driver, stage = pz.AdaptiveFeedforward(1000.0, limits=LIMITS), pz.PaperStage(1000.0, seed=1)
    _, x, _ = shared.drive(driver, stage, r, lambda k, x: x if k % 50 == 0 else None)
    assert np.abs(x).max() < 5.0
    assert shared.last_error(r, x) < 0.05
