"""A reference that is too fast is told, once: near the resonance, or where lag passes for hysteresis."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from tests.controller.shared import LIMITS, LOOP, drive

FS = 10_000.0


def wave(frequency: float, periods: int = 5) -> FloatArray:
    return pz.signals.triangle(4.0, frequency, periods, FS).values


def driven(r: FloatArray, lag: float = 0.0, block: int = 1, noise: float = 0.0, **options: Any) -> Any:
    """A controller behind a reference, of a stage that follows with a lag [s]."""
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=(), **options)
    stage, rng, share, late = pz.SimulatedStage(FS, LOOP), np.random.default_rng(0), 1.0, 0.0
    share = 1.0 - np.exp(-1.0 / (lag * FS)) if lag else 1.0
    for begin in range(0, r.size, block):
        u = driver.run(r[begin : begin + block])
        x = stage.run(u)
        for k, x_k in enumerate(x.tolist()):
            late += share * (x_k - late)
            x[k] = late
        driver.learn(u, x + noise * rng.normal(size=x.size))
    return driver


def warnings(driver: Any) -> list[str]:
    return [name for event in driver.events if (name := event.reason.split(":")[0]) in ("lag", "resonance")]


@pytest.mark.parametrize("block", [1, 150])
@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_lag_that_passes_for_hysteresis_is_told_once(block: int, noise: float) -> None:
    """Of 1 ms: its phase is 0.13 at 20 Hz, and 0.01 at 2 Hz; no lag has none, whatever the block."""
    driver = driven(wave(20.0, 12), lag=1e-3, block=block, noise=noise)
    assert warnings(driver) == ["lag"]
    assert driver.state["start"]["lag"] / FS == pytest.approx(1e-3, rel=0.25)
    assert warnings(driven(wave(2.0, 3), lag=1e-3, block=block, noise=noise)) == []
    assert warnings(driven(wave(20.0, 12), block=block, noise=noise)) == []


def test_an_amplifier_that_slews_is_no_lag() -> None:
    """The start goes faster than it can; the reference does not."""
    amplifier, r = pz.stage.Amplifier(-60.0, 60.0, slew_rate=120.0), wave(1.0, 3)
    slow = pz.SimulatedStage(FS, LOOP, amplifier=amplifier)
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=())
    drive(driver, slow, np.concatenate((r, 0.1 * wave(30.0))))
    assert warnings(driver) == []


@pytest.mark.parametrize(("resonance", "told"), [(None, []), (300.0, ["resonance"]), (500.0, [])])
def test_a_reference_near_the_resonance_is_told_once(resonance: float | None, told: list[str]) -> None:
    driver = driven(wave(20.0, 10), resonance=resonance)
    assert warnings(driver) == told
    # A lag is told beside it, also within blocks.
    driver = driven(wave(20.0, 30), lag=1e-3, block=2000, resonance=resonance)
    assert sorted(warnings(driver)) == ["lag", *told]


def test_a_rest_is_not_fast() -> None:
    rest = 1.0 + 1e-3 * np.random.default_rng(1).normal(size=20_000)
    r = np.concatenate((wave(20.0, 4), np.linspace(0.0, 1.0, 200), rest, wave(20.0, 4)[125:]))
    assert warnings(driven(r, resonance=500.0)) == []
