"""Rigs drawn at random on which a controller once went wrong."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench import zoo
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Traces, run_controller
from piezoest.bench.zoo.settling import Cell
from piezoest.controller.faults import FAULTS
from tests.controller.shared import drive


def driven(seed: int) -> tuple[Rig, pz.AdaptiveFeedforward, Traces]:
    """A rig, the controller that drove it, and the run."""
    rig = zoo.draw(seed)
    controller = pz.AdaptiveFeedforward(rig.sample_rate, limits=rig.limits)
    return rig, controller, run_controller(rig, controller)[0]


@pytest.mark.parametrize("seed", [22883, 23749])
def test_what_hysteresis_leaves_of_a_wide_way_does_not_refute_the_start(seed: int) -> None:
    assert "false start" not in [event.name for event in driven(seed)[1].events]


@pytest.mark.parametrize(
    ("seed", "begin", "end", "most"),
    [
        # 500 V/s: while it came down from a limit, the gain was found with the wrong sign, for ever.
        pytest.param(22688, 4.0, 5.5, 0.15, id="a start waits until a slow amplifier is there"),
        # It comes back a while after a way of the start: the gain was -0.72 instead of 0.26 µm/V.
        pytest.param(20862, 0.29, 1.2, 0.02, id="a sensor that recovers is no late answer"),
        # A twentieth of the true gain: later the voltage went from one limit to the other again and again.
        pytest.param(26402, 4.0, 20.0, 3.0, id="a gain from a dead zone is left behind on a long leg"),
        pytest.param(29762, 0.15, 0.5, 0.1, id="a line made too steep by the way there comes back"),
    ],
)
def test_the_start_leaves_a_good_line(seed: int, begin: float, end: float, most: float) -> None:
    rig, _, run = driven(seed)
    part = slice(int(begin * rig.sample_rate), int(end * rig.sample_rate))
    assert np.abs(run.error[part]).max() < most * 2.0 * rig.plain.amplitude


def test_ringing_does_not_make_the_line_steeper_and_steeper() -> None:
    rig, controller, _ = driven(25500)
    assert abs(controller.state["line"]["gain"]) < 30.0 * rig.to_dict()["gain"]


@pytest.mark.parametrize("seed", [30230, 30468, 31415])
def test_what_the_first_way_leaves_behind_is_no_small_gain(seed: int) -> None:
    rig, _, run = driven(seed)
    assert np.abs(run.displacement).max() < 6.0 * rig.plain.amplitude


@pytest.mark.parametrize("place", [("bouc-wen", 5.0, 3.0, 504), ("duhem", 5.0, 3.0, 502)])
def test_a_loop_recorded_anew_drives_soon_after_a_change_of_amplitude(place: Any) -> None:
    changes = {part["change"]: part for part in Cell(*place).play(pz.AdaptiveFeedforward)["segments"]}
    assert changes["switch-back"]["periods"] <= 2


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
    rig = zoo.draw(47342)
    driver = pz.AdaptiveFeedforward(rig.sample_rate, limits=rig.limits)
    u = drive(driver, rig.stage(), rig.reference).u
    assert driver.status.switches > 2
    assert np.abs(np.diff(u)).max() < 0.08 * np.ptp(u)
