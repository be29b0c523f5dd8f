"""Rigs drawn at random on which a controller once went wrong."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.zoo.drawing import draw
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Traces, run_controller
from piezoest.bench.zoo.settling import Cell


def driven(seed: int) -> tuple[Rig, pz.AdaptiveFeedforward, Traces]:
    """A rig, the controller that drove it, and the run."""
    rig = draw(seed)
    controller = pz.AdaptiveFeedforward(rig.sample_rate, limits=rig.limits)
    return rig, controller, run_controller(rig, controller)[0]


def largest(rig: Rig, run: Traces, begin: float, end: float) -> float:
    """Largest error between two times [s], in swings of the reference."""
    part = slice(int(begin * rig.sample_rate), int(end * rig.sample_rate))
    return float(np.abs(run.error[part]).max()) / (2.0 * rig.plain.amplitude)


@pytest.mark.parametrize("seed", [22883, 23749])
def test_what_hysteresis_leaves_of_a_wide_way_does_not_refute_the_start(seed: int) -> None:
    """The reference is faster than the start: the voltage goes far to one side, and back."""
    _, controller, _ = driven(seed)
    assert "false start" not in [event.name for event in controller.events]


def test_a_start_waits_until_a_slow_amplifier_is_there() -> None:
    """500 V/s: while it came down from a limit, the gain was found with the wrong sign, for ever."""
    rig, _, run = driven(22688)
    assert largest(rig, run, 4.0, 5.5) < 0.15


def test_a_sensor_that_recovers_is_no_late_answer() -> None:
    """It comes back a while after a way of the start: the gain was -0.72 instead of 0.26 µm/V."""
    rig, _, run = driven(20862)
    assert largest(rig, run, 0.29, 1.2) < 0.02


def test_a_gain_from_a_dead_zone_is_left_behind_on_the_first_long_leg() -> None:
    """A twentieth of the true gain: later the voltage went from one limit to the other again and again."""
    rig, _, run = driven(26402)
    assert largest(rig, run, 4.0, 20.0) < 3.0


def test_a_line_made_too_steep_by_the_way_to_the_reference_comes_back() -> None:
    rig, _, run = driven(29762)
    assert largest(rig, run, 0.15, 0.5) < 0.1


def test_ringing_does_not_make_the_line_steeper_and_steeper() -> None:
    """The gain doubled in every leg, to a thousand times the true one, and the stage stood still."""
    rig, controller, _ = driven(25500)
    assert abs(controller.state["line"]["gain"]) < 30.0 * rig.to_dict()["gain"]


@pytest.mark.parametrize("place", [("bouc-wen", 5.0, 3.0, 504), ("duhem", 5.0, 3.0, 502)])
def test_a_loop_recorded_anew_drives_soon_after_a_change_of_amplitude(place: Any) -> None:
    """What the loop before had missed kept it from driving for another period."""
    changes = {part["change"]: part for part in Cell(*place).play(pz.AdaptiveFeedforward)["segments"]}
    assert changes["switch-back"]["periods"] <= 2
