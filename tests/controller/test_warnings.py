"""What a controller notes, once: a reference that is too fast, or that leaves what a model was learnt on."""

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.models import LearntModel, LearntOn
from tests.controller.shared import LIMITS, LOOP, drive, in_blocks

FS = 10_000.0
WIDE = LearntOn((-60.0, 60.0), (-10.0, 10.0), 1e4)
SMALL, LARGE = (pz.signals.triangle(amplitude, 10.0, 3, FS).values for amplitude in (2.0, 4.0))


def controller(**options: Any) -> Any:
    return pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=(), **options)


def notes(driver: Any, *names: str) -> list[str]:
    return [event.name for event in driver.events if event.name in names]


def wave(frequency: float, periods: int = 5) -> FloatArray:
    return pz.signals.triangle(4.0, frequency, periods, FS).values


def follows(r: FloatArray, lag: float = 0.0, block: int = 1, noise: float = 0.0, **options: Any) -> Any:
    """A controller behind a reference, of a stage that follows with a lag [s], and its warnings."""
    driver, stage, rng, late = (
        controller(**options),
        pz.SimulatedStage(FS, LOOP),
        np.random.default_rng(0),
        0.0,
    )
    share = 1.0 - np.exp(-1.0 / (lag * FS)) if lag else 1.0
    for begin in range(0, r.size, block):
        u = driver.run(r[begin : begin + block])
        x = stage.run(u)
        for k, x_k in enumerate(x.tolist()):
            late += share * (x_k - late)
            x[k] = late
        driver.learn(u, x + noise * rng.normal(size=x.size))
    return driver, notes(driver, "lag", "resonance")


@pytest.mark.parametrize("block", [1, 150])
@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_lag_that_passes_for_hysteresis_is_told_once(block: int, noise: float) -> None:
    """Of 1 ms: its phase is 0.13 at 20 Hz, and 0.01 at 2 Hz; no lag has none, whatever the block."""
    driver, told = follows(wave(20.0, 12), lag=1e-3, block=block, noise=noise)
    assert told == ["lag"]
    assert driver.state["start"]["lag"] / FS == pytest.approx(1e-3, rel=0.25)
    assert follows(wave(2.0, 3), lag=1e-3, block=block, noise=noise)[1] == []
    assert follows(wave(20.0, 12), block=block, noise=noise)[1] == []


@pytest.mark.parametrize("backlash", [0.6, 0.9])
def test_backlash_is_no_lag(backlash: float) -> None:
    """The first way, of 2.4 V, is answered late, but ends at once."""
    driver, rng = controller(), np.random.default_rng(0)
    stage = pz.SimulatedStage(FS, pz.PrandtlIshlinskii(0.005, [backlash], [0.1]))
    drive(driver, stage, wave(20.0, 12), lambda _, x: x + 2e-3 * rng.normal())
    assert notes(driver, "lag") == []
    assert driver.state["start"]["lag"] < 0.1e-3 * FS


def test_an_amplifier_that_slews_is_no_lag() -> None:
    amplifier = pz.stage.Amplifier(-60.0, 60.0, slew_rate=120.0)
    driver = controller()
    r = np.concatenate((wave(1.0, 3), 0.1 * wave(30.0)))
    drive(driver, pz.SimulatedStage(FS, LOOP, amplifier=amplifier), r)
    assert notes(driver, "lag", "resonance") == []


@pytest.mark.parametrize(("resonance", "told"), [(None, []), (300.0, ["resonance"]), (500.0, [])])
def test_a_reference_near_the_resonance_is_told_once(resonance: float | None, told: list[str]) -> None:
    assert follows(wave(20.0, 10), resonance=resonance)[1] == told
    # A lag is told beside it, also within blocks.
    both = follows(wave(20.0, 30), lag=1e-3, block=2000, resonance=resonance)[1]
    assert sorted(both) == ["lag", *told]


def test_a_rest_is_not_fast() -> None:
    rest = 1.0 + 1e-3 * np.random.default_rng(1).normal(size=20_000)
    r = np.concatenate((wave(20.0, 4), np.linspace(0.0, 1.0, 200), rest, wave(20.0, 4)[125:]))
    assert follows(r, resonance=500.0)[1] == []


def driven(driver: Any, r: FloatArray, block: int = 1) -> Any:
    in_blocks(driver, pz.SimulatedStage(FS, LOOP), r, block)
    return driver


@pytest.mark.parametrize("block", [1, 250])
@pytest.mark.parametrize(
    ("known", "told"),
    [
        (None, []),
        (WIDE, []),
        (LearntOn((-60.0, 60.0), (-3.7, 3.7), 1.0), []),  # within 5 %
        (LearntOn((-60.0, 60.0), (-3.0, 10.0), 1.0), ["outside"]),
        (LearntOn((-60.0, 60.0), (-10.0, 3.0), 1.0), ["outside"]),
        (LearntOn((-60.0, 15.0), (-10.0, 10.0), 1.0), ["outside"]),
        (LearntOn((-15.0, 60.0), (-10.0, 10.0), 1.0), ["outside"]),
    ],
)
def test_who_leaves_what_a_model_was_learnt_on_is_told_once(known: Any, told: list[str], block: int) -> None:
    model, r = LearntModel(LOOP, known), np.concatenate((SMALL, LARGE, SMALL, LARGE))
    driver = driven(controller(model=model), r, block)
    assert notes(driver, "outside") == told
    assert driver.status.fault == ""


def test_what_is_said_has_the_figures(caplog: pytest.LogCaptureFixture) -> None:
    model = LearntModel(LOOP, LearntOn((-60.0, 60.0), (-3.0, 3.0), 1.0))
    with caplog.at_level(logging.WARNING):
        (event,) = driven(controller(model=model), np.concatenate((SMALL, LARGE))).events
    assert event.action == "went on"
    assert event.time == pytest.approx(0.3 + 3.3 / 160.0, abs=1e-3)
    assert "the reference is at 3.3" in event.reason
    assert "learnt from -3 to 3 µm and from -60 to 60 V" in event.reason
    assert caplog.text.count("outside:") == 1


def test_it_changes_no_voltage() -> None:
    known = LearntModel(LOOP, LearntOn((-1.0, 1.0), (-1.0, 1.0), 1.0))
    with_ranges, without = (driven(controller(model=model), LARGE) for model in (known, LOOP))
    assert notes(with_ranges, "outside")
    assert (with_ranges.voltage, with_ranges.model) == (without.voltage, without.model)


def test_a_file_and_what_identify_returns_will_do(tmp_path: Path) -> None:
    class Found:
        model, learnt_on = LOOP, WIDE

    file = tmp_path / "model.json"
    file.write_text(json.dumps(LearntModel(LOOP, WIDE).to_dict()))
    data = controller(model=LearntModel(LOOP, WIDE)).to_dict()
    assert data["learnt_on"] == WIDE.to_dict()
    for given in (file, str(file), Found()):
        assert controller(model=given).to_dict() == data
    assert controller(model=LOOP).to_dict()["learnt_on"] is None
    with pytest.raises(FileNotFoundError):
        controller(model=tmp_path / "none.json")


def test_a_sweep_may_go_farther() -> None:
    driver = driven(controller(model=LearntModel(LOOP, LearntOn((-30.0, 30.0), (-5.0, 5.0), 1.0))), SMALL)
    driver.home(amplitude=55.0, frequency=20.0, cycles=3)
    driven(driver, np.zeros(3000))
    assert driver.status.stage != "homing"
    assert notes(driver, "outside") == []
