"""The straight line, and references whose legs become wider, smaller or quicker."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.controller import line as lines
from piezoest.layout import Named, new
from tests.controller.shared import drive, in_blocks, last_error, late

FS, SLOW = 2000.0, 1000.0
SLOPE = 0.1


class Plays:
    """A stage of a line and plays of some widths: x = SLOPE (share u + (1 - share) mean of the plays) [µm].

    The amplifier gives no more than `slew` V/s; the gain changes by a factor after so many samples.
    """

    def __init__(
        self, share: float, widths: Any = (5.0, 15.0, 30.0), slew: float = np.inf, factor: Any = (1.0, 0)
    ) -> None:
        self.share, self.widths, self.slew, self.factor = share, widths, slew / FS, factor
        self.places, self.u, self.count = [0.0] * len(widths), 0.0, 0

    def step(self, u: float) -> float:
        self.u = u = min(max(u, self.u - self.slew), self.u + self.slew)
        for i, width in enumerate(self.widths):
            self.places[i] = min(max(self.places[i], u - width), u + width)
        self.count += 1
        x = SLOPE * (self.share * u + (1.0 - self.share) * sum(self.places) / len(self.widths))
        return x * self.factor[0] if self.count > self.factor[1] else x


def controller(low: float, high: float, rate: float = FS, estimators: Any = ()) -> Any:
    return pz.AdaptiveFeedforward(rate, limits=pz.VoltageLimits(low, high), estimators=estimators)


def fresh() -> Any:
    """A line of 0.2 µm/V, as the start leaves it."""
    line = Named(new(lines.LINE), lines.LINE)
    lines.begin(line, 0.2, 0.0, 0.0, 1.0)
    return line


def leg(line: Any, gain: float, zero: float, direction: float, readings: int) -> None:
    for u in direction * np.linspace(-10.0, 10.0, readings):
        lines.add(line.now, u, gain * u + zero, 1e9)
    lines.turn(line, direction, 20.0 * gain)


def test_a_way_back_of_few_readings_leaves_nothing_old() -> None:
    """A quick flyback has too few readings to be a leg: what the one before it has shown is not kept."""
    line = fresh()
    for k in range(20):
        leg(line, 0.2, 0.0, 1.0 - 2.0 * (k % 2), 50)
    for _ in range(20):
        leg(line, 0.14, 1.0, 1.0, 50)
        leg(line, 0.14, 1.0, -1.0, 3)
    assert abs(line.gain / 0.14 - 1.0) < 0.02
    assert abs(line.centre - 1.0) < 0.02


def test_the_drift_is_that_of_a_period_and_unknown_where_the_stage_hardly_answers() -> None:
    line = fresh()
    for k in range(20):
        leg(line, 0.2, -0.1 * k, 1.0 - 2.0 * (k % 2), 50)
    assert line.drift == pytest.approx(-0.2, rel=1e-3)
    leg(line, 0.02, -2.0, 1.0, 50)
    assert line.drift == 0.0
    leg(line, 0.2, -2.0, -1.0, 50)
    assert line.drift != 0.0
    lines.hold(line)
    assert line.drift == 0.0


@pytest.mark.parametrize(("answer", "gain"), [(0.02, 0.2), (0.6, 2.0)])
def test_a_line_that_became_too_steep_comes_back_where_little_moves(answer: float, gain: float) -> None:
    """Behind ringing a tenth of the voltage is left, which a stage with backlash hardly answers."""
    line = fresh()
    line.gain = 2.0
    for k in range(20):
        # A loop that no line explains; the reference goes by 2 µm, for which the voltage goes by 1 V.
        direction = 1.0 - 2.0 * (k % 2)
        for phase in np.linspace(0.0, np.pi, 50):
            u = -0.5 * direction * np.cos(phase)
            lines.add(line.now, u, answer * (u + 2.0 * direction * np.sin(phase)), 1e9)
        lines.turn(line, direction, 2.0)
    assert line.gain == pytest.approx(gain, rel=0.2)


def test_ringing_does_not_make_the_line_so_steep_that_nothing_moves() -> None:
    line = fresh()
    first = line.gain
    for k in range(12):
        direction = 1.0 - 2.0 * (k % 2)
        for phase in np.linspace(0.0, np.pi, 50):
            u = -0.5 * direction * np.cos(phase) / line.gain
            lines.add(line.now, u, 20.0 * np.sin(7.3 * phase + k), 1e9)
        lines.turn(line, direction, 1.0)
    assert first < line.gain < 5.0 * first


def test_no_dead_zone_makes_the_line_flat() -> None:
    line = fresh()
    for k in range(20):
        leg(line, 0.01, 0.0, 1.0 - 2.0 * (k % 2), 50)
    assert 0.04 < line.gain < 0.08


def test_gain_does_not_swing_with_the_size_of_the_legs() -> None:
    t, gains = np.arange(30_000) / 10_000.0, []
    r = 4.0 * np.sin(4.0 * np.pi * t) + 1.2 * np.sin(26.0 * np.pi * t)
    driver, stage = controller(-100.0, 100.0, 10_000.0), pz.PaperStage(10_000.0, seed=3)
    for part in r.reshape(-1, 50):
        in_blocks(driver, stage, part, 50)
        gains.append(float(driver.state["line"]["gain"]))
    assert np.ptp(gains[200:]) < 0.1 * np.mean(gains[200:])


def test_a_factor_of_the_sensor_is_no_new_start_where_readings_were_late() -> None:
    driver = controller(-100.0, 100.0, SLOW)
    r, read = pz.signals.triangle(2.0, 20.0, 80, SLOW).values, late(5)
    u = drive(driver, Plays(1.0), r, lambda k, x: read(k, x) * (1.0 if k < 2000 else -0.05)).u
    assert np.abs(u[2000:]).max() < 33.0
    assert driver.status.fault in ("reversed", "no response", "scaled")


@pytest.mark.parametrize("samples", [6, 13, 25])
def test_the_line_is_that_of_the_voltage_that_late_readings_answer(samples: int) -> None:
    r = 5.0 + np.concatenate([np.zeros(200), 2.0 * np.sin(2.0 * np.pi * 0.02 * np.arange(1000))])
    driver = controller(0.0, 100.0, SLOW)
    x = drive(driver, SimpleNamespace(step=lambda u: 0.2 * u + 1.0), r, late(samples, 1.0)).x
    assert abs(driver.state["line"]["gain"] / 0.2 - 1.0) < 0.05
    assert last_error(r, x, 500) < 0.1
    assert not any(event.reason.startswith("reversed") for event in driver.events)


def waves(*shapes: tuple[float, int]) -> FloatArray:
    """Triangles of amplitudes [µm] and numbers of periods of 4 Hz, on a bias of 6 µm."""
    parts = [pz.signals.triangle(amplitude, 4.0, periods, FS).values for amplitude, periods in shapes]
    return np.concatenate((np.linspace(0.0, 6.0, 500), 6.0 + np.concatenate(parts)))


def test_wide_legs_behind_a_small_scan_do_not_follow_its_slope() -> None:
    driver, r = controller(-20.0, 100.0), waves((2.0, 6), (0.06, 12), (2.0, 1))
    error = np.abs(r - drive(driver, Plays(0.3, (8.0,)), r).x)
    assert error[-1000:-500].max() < 1e-3  # the last small period
    assert error[-500:].max() < 1.5
    assert driver.events == ()


def test_wide_legs_behind_small_ones_are_not_scaled() -> None:
    driver, r = controller(-20.0, 100.0), waves((0.2, 3), (2.0, 8))
    assert last_error(r, drive(driver, Plays(0.3, (8.0,)), r).x, 500) < 1.0
    assert not any(event.reason.startswith("scaled") for event in driver.events)


@pytest.mark.parametrize("slew", [20.0, 60.0])
def test_the_start_waits_for_an_amplifier_that_slews(slew: float) -> None:
    driver, r = controller(-100.0, 100.0), pz.signals.triangle(0.3, 1.0, 10, FS).values
    error = np.abs(r - drive(driver, Plays(1.0, slew=slew), r).x)
    assert driver.events == ()
    assert driver.state["line"]["gain"] == pytest.approx(SLOPE, rel=1e-3)
    assert error.max() < 3.0
    assert error[-2000:].max() < 1e-3


def test_waves_of_seventy_times_the_amplitude_are_no_fault() -> None:
    r = np.concatenate((pz.signals.sine(0.1, 4.0, 20, FS).values, pz.signals.sine(7.0, 4.0, 12, FS).values))
    driver = controller(-150.0, 150.0, estimators=None)
    run = drive(driver, Plays(0.3), r)
    assert not [event.reason for event in driver.events if not event.reason.startswith("lag")]
    assert last_error(r, run.x, 2000) < 0.5
    assert np.abs(run.u)[-2000:].max() < 110.0


@pytest.mark.parametrize("samples", [2, 4])
def test_quick_edges_with_late_readings_are_left_to_the_line(samples: int) -> None:
    edge = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 25))
    way = np.concatenate((2.0 * edge - 1.0, np.ones(400)))
    r: FloatArray = 5.0 * np.tile(np.concatenate((way, -way)), 12)
    run = drive(controller(-150.0, 150.0, estimators=None), Plays(1.0), r, late(samples))
    # Of a stage without a loop the line knows all.
    assert last_error(r, run.x, 1700) < 0.05


def test_a_reference_that_is_faster_than_the_start_is_caught() -> None:
    r = pz.signals.sine(8.0, 150.0, 40, 10_000.0).values
    run = drive(controller(-150.0, 150.0, 10_000.0, None), Plays(0.6), r)
    assert run.doing.index("running") < 1000
    assert np.abs(run.u).max() < 140.0


@pytest.mark.parametrize(("samples", "frequency", "soon"), [(5, 30.0, 80), (10, 20.0, 120), (10, 40.0, 120)])
def test_a_fast_reference_is_caught_with_late_readings(samples: int, frequency: float, soon: int) -> None:
    r = 3.0 + pz.signals.sine(4.0, frequency, 40, SLOW).values
    run = drive(controller(-150.0, 150.0, SLOW), Plays(1.0), r, late(samples))
    assert run.doing.index("running") < soon
    # The gain is 0.1 µm/V, and the first wave already misses little.
    assert np.abs(r - run.x)[soon : soon + 100].max() < 1.0


@pytest.mark.parametrize(("share", "amplitude"), [(0.5, 1.0), (0.7, 1.0), (0.7, 4.0)])
def test_models_go_on_where_the_gain_changes(share: float, amplitude: float) -> None:
    r = pz.signals.sine(amplitude, 4.0, 14, FS).values
    run = drive(controller(-150.0, 150.0, estimators=None), Plays(share, factor=(0.7, 5000)), r)
    worst = np.abs(r - run.x).reshape(14, -1).max(axis=1) / amplitude
    # Back at the line, which knows the old gain, it is 0.3 of the amplitude.
    assert worst[10] < 0.2
    assert worst[12] < 0.03
