"""A controller notes, once, that the run leaves what the user's model was learnt on."""

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.models import LearntModel, LearntOn
from tests.controller.shared import LIMITS, LOOP, in_blocks

FS = 10_000.0
WIDE = LearntOn((-60.0, 60.0), (-10.0, 10.0), 1e4)
SMALL, LARGE = (pz.signals.triangle(amplitude, 10.0, 3, FS).values for amplitude in (2.0, 4.0))


def controller(model: Any, **options: Any) -> Any:
    return pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=(), model=model, **options)


def driven(driver: Any, r: FloatArray, block: int = 1) -> Any:
    in_blocks(driver, pz.SimulatedStage(FS, LOOP), r, block)
    return driver


def notes(driver: Any) -> list[str]:
    return [event.reason for event in driver.events if event.reason.startswith("outside: ")]


@pytest.mark.parametrize("block", [1, 250])
@pytest.mark.parametrize(
    ("known", "told"),
    [
        (None, False),
        (WIDE, False),
        (LearntOn((-60.0, 60.0), (-3.7, 3.7), 1.0), False),  # within 5 %
        (LearntOn((-60.0, 60.0), (-3.0, 10.0), 1.0), True),
        (LearntOn((-60.0, 60.0), (-10.0, 3.0), 1.0), True),
        (LearntOn((-60.0, 15.0), (-10.0, 10.0), 1.0), True),
        (LearntOn((-15.0, 60.0), (-10.0, 10.0), 1.0), True),
    ],
)
def test_who_leaves_it_is_told_once(known: LearntOn | None, told: bool, block: int) -> None:
    driver = driven(controller(LearntModel(LOOP, known)), np.concatenate((SMALL, LARGE, SMALL, LARGE)), block)
    assert len(notes(driver)) == told
    assert driver.status.fault == ""


def test_what_is_said_has_the_figures(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        known = LearntOn((-60.0, 60.0), (-3.0, 3.0), 1.0)
        driver = driven(controller(LearntModel(LOOP, known)), np.concatenate((SMALL, LARGE)))
    (event,) = driver.events
    assert event.action == "went on"
    assert event.time == pytest.approx(0.3 + 3.3 / 160.0, abs=1e-3)
    assert "the reference is at 3.3" in event.reason
    assert "learnt from -3 to 3 µm and from -60 to 60 V" in event.reason
    assert caplog.text.count("outside:") == 1


def test_it_changes_no_voltage() -> None:
    known = LearntOn((-1.0, 1.0), (-1.0, 1.0), 1.0)
    with_ranges, without = (driven(controller(each), LARGE) for each in (LearntModel(LOOP, known), LOOP))
    assert notes(with_ranges)
    assert (with_ranges.voltage, with_ranges.model) == (without.voltage, without.model)


def test_a_file_and_what_identify_returns_will_do(tmp_path: Path) -> None:
    class Found:
        model, learnt_on = LOOP, WIDE

    file = tmp_path / "model.json"
    file.write_text(json.dumps(LearntModel(LOOP, WIDE).to_dict()))
    data = controller(LearntModel(LOOP, WIDE)).to_dict()
    assert data["learnt_on"] == WIDE.to_dict()
    for given in (file, str(file), Found()):
        assert controller(given).to_dict() == data
    assert controller(LOOP).to_dict()["learnt_on"] is None
    with pytest.raises(FileNotFoundError):
        controller(tmp_path / "none.json")


def test_a_sweep_may_go_farther() -> None:
    driver = driven(controller(LearntModel(LOOP, LearntOn((-30.0, 30.0), (-5.0, 5.0), 1.0))), SMALL)
    driver.home(amplitude=55.0, frequency=20.0, cycles=3)
    driven(driver, np.zeros(3000))
    assert driver.status.stage != "homing"
    assert notes(driver) == []
