"""The straight line of a controller: what it remembers of legs of different length."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.controller import line as lines
from piezoest.layout import Named, new
from tests.controller.shared import drive, last_error, late

FS = 10_000.0
SLOPE = SimpleNamespace(step=lambda u: 0.1 * u)


def test_gain_does_not_swing_with_the_size_of_the_legs() -> None:
    """Small loops on a wide one are flatter; a line through them alone would be wrong by a third."""
    t = np.arange(30_000) / FS
    r = 4.0 * np.sin(4.0 * np.pi * t) + 1.2 * np.sin(26.0 * np.pi * t)
    stage = pz.PaperStage(FS, seed=3)
    controller = pz.AdaptiveFeedforward(FS, limits=pz.VoltageLimits(-100.0, 100.0), estimators=())
    gains = []
    for k in range(0, r.size, 50):
        u = controller.run(r[k : k + 50])
        controller.learn(u, stage.run(u))
        gains.append(float(controller.state["line"]["gain"]))
    late = np.array(gains[200:])
    assert np.ptp(late) < 0.1 * late.mean()


def _leg(line: Any, gain: float, zero: float, direction: float, readings: int) -> None:
    for u in direction * np.linspace(-10.0, 10.0, readings):
        lines.add(line.now, u, gain * u + zero, 1e9)
    lines.turn(line, direction, 20.0 * gain)


def test_a_way_back_of_few_readings_leaves_nothing_old() -> None:
    """A quick flyback has too few readings to be a leg: what the one before it has shown is not kept."""
    line = Named(new(lines.LINE), lines.LINE)
    lines.begin(line, 0.2, 0.0, 0.0, 1.0)
    for k in range(20):
        _leg(line, 0.2, 0.0, 1.0 - 2.0 * (k % 2), 50)
    for _ in range(20):
        _leg(line, 0.14, 1.0, 1.0, 50)
        _leg(line, 0.14, 1.0, -1.0, 3)
    assert abs(line.gain / 0.14 - 1.0) < 0.02
    assert abs(line.centre - 1.0) < 0.02


def test_the_drift_is_that_of_a_period_and_unknown_where_the_stage_hardly_answers() -> None:
    line = Named(new(lines.LINE), lines.LINE)
    lines.begin(line, 0.2, 0.0, 0.0, 1.0)
    for k in range(20):
        _leg(line, 0.2, -0.1 * k, 1.0 - 2.0 * (k % 2), 50)
    assert line.drift == pytest.approx(-0.2, rel=1e-3)
    _leg(line, 0.02, -2.0, 1.0, 50)
    assert line.drift == 0.0
    _leg(line, 0.2, -2.0, -1.0, 50)
    assert line.drift != 0.0
    lines.hold(line)
    assert line.drift == 0.0


@pytest.mark.parametrize(("answer", "gain"), [(0.02, 0.2), (0.6, 2.0)])
def test_a_line_that_became_too_steep_comes_back_where_little_moves(answer: float, gain: float) -> None:
    """Behind ringing a tenth of the voltage is left, which a stage with backlash hardly answers."""
    line = Named(new(lines.LINE), lines.LINE)
    lines.begin(line, 0.2, 0.0, 0.0, 1.0)
    line.gain = 2.0
    for k in range(20):
        # A loop that no line explains; the reference goes by 2 µm, for which the voltage goes by 1 V.
        direction = 1.0 - 2.0 * (k % 2)
        for phase in np.linspace(0.0, np.pi, 50):
            u = -0.5 * direction * np.cos(phase)
            lines.add(line.now, u, answer * (u + 2.0 * direction * np.sin(phase)), 1e9)
        lines.turn(line, direction, 2.0)
    assert line.gain == pytest.approx(gain, rel=0.2)


def test_late_readings_do_not_make_the_line_flat() -> None:
    """Five samples late, of legs of 25: least squares gives 0.078 µm/V."""
    driver = pz.AdaptiveFeedforward(1000.0, limits=pz.VoltageLimits(-100.0, 100.0), estimators=())
    drive(driver, SLOPE, pz.signals.triangle(2.0, 20.0, 40, 1000.0).values, late(5))
    assert driver.state["line"]["gain"] == pytest.approx(0.1, rel=0.12)


def test_a_factor_of_the_sensor_is_no_new_start_where_readings_were_late() -> None:
    """The line was never straight, and has held for long: the voltage stays with it."""
    driver = pz.AdaptiveFeedforward(1000.0, limits=pz.VoltageLimits(-100.0, 100.0), estimators=())
    r, read = pz.signals.triangle(2.0, 20.0, 80, 1000.0).values, late(5)
    u = drive(driver, SLOPE, r, lambda k, x: read(k, x) * (1.0 if k < 2000 else -0.05)).u
    assert np.abs(u[2000:]).max() < 33.0
    assert driver.status.fault in ("reversed", "no response", "scaled")


def test_no_dead_zone_makes_the_line_flat() -> None:
    """A flat line would let the voltage leap from limit to limit where the stage moves at last."""
    line = Named(new(lines.LINE), lines.LINE)
    lines.begin(line, 0.2, 0.0, 0.0, 1.0)
    for k in range(20):
        _leg(line, 0.01, 0.0, 1.0 - 2.0 * (k % 2), 50)
    assert 0.04 < line.gain < 0.08


@pytest.mark.parametrize("samples", [6, 13, 25])
def test_the_line_is_that_of_the_voltage_that_late_readings_answer(samples: int) -> None:
    """Readings of the same samples lie on an ellipse, whose line may fall where the stage rises."""
    fs, frequency = 1000.0, 20.0
    r = 5.0 + np.concatenate([np.zeros(200), 2.0 * np.sin(2.0 * np.pi * frequency / fs * np.arange(1000))])
    controller = pz.AdaptiveFeedforward(fs, limits=pz.VoltageLimits(0.0, 100.0), estimators=())
    x = drive(controller, SimpleNamespace(step=lambda u: 0.2 * u + 1.0), r, late(samples, 1.0)).x
    assert abs(controller.state["line"]["gain"] / 0.2 - 1.0) < 0.05
    assert last_error(r, x, 500) < 0.1
    assert not any(event.reason.startswith("reversed") for event in controller.events)
