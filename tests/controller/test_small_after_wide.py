"""A small scan behind a large move: what was learnt of the move is of no use there."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.controller.shared import LIMITS, drive, last_error

FS = 2000.0
# Its small loops close: those of a Coleman-Hodgdon stage wander for many periods.
LOOP = pz.PaperStage(FS).hysteresis


def scan(part: float, periods: int = 25, wide: Any = ()) -> tuple[Any, Any, float]:
    """A move of 5 µm, or wide waves before it, and a triangle of a part of it on both sides of its end."""
    small = 5.0 * part * pz.signals.triangle(1.0, 5.0, periods, FS).values
    r = np.concatenate((wide, np.linspace(0.0, 5.0, 800), 5.0 + small))
    driver, stage = pz.AdaptiveFeedforward(FS, limits=LIMITS), pz.SimulatedStage(FS, LOOP)
    rng = np.random.default_rng(0)
    x = drive(driver, stage, r, lambda _, x: x + 1e-4 * rng.normal()).x
    return r, driver, last_error(r, x, 800) / small.max()


@pytest.mark.parametrize("part", [0.002, 0.004, 0.008, 0.012, 0.03])
def test_a_small_scan_behind_a_large_move_is_learnt(part: float) -> None:
    _, driver, error = scan(part)
    assert error < 0.06
    assert driver.events == ()


@pytest.mark.parametrize("part", [0.004, 0.02])
def test_a_small_scan_behind_wide_waves_is_learnt(part: float) -> None:
    wide = pz.signals.triangle(5.0, 5.0, 6, FS).values
    assert scan(part, 40, wide)[2] < 0.1


def test_wide_waves_behind_a_small_scan_are_learnt() -> None:
    _, driver, _ = scan(0.004)
    stage, r = pz.SimulatedStage(FS, LOOP), pz.signals.triangle(4.0, 5.0, 12, FS).values
    stage.run(np.full(10, driver.voltage))
    assert last_error(r, drive(driver, stage, r).x, 800) < 0.12


def test_noise_of_a_reference_at_rest_is_no_scan() -> None:
    rng = np.random.default_rng(0)
    driver, stage = pz.AdaptiveFeedforward(FS, limits=LIMITS), pz.SimulatedStage(FS, LOOP)
    wave = pz.signals.triangle(5.0, 5.0, 6, FS).values
    gains = []
    for r_k in (*wave.tolist(), *(1e-3 * rng.normal(size=20_000)).tolist()):
        u = driver.step(r_k)
        driver.learn(u, stage.step(u) + 1e-3 * rng.normal())
        gains.append(float(driver.state["line"]["gain"]))
    assert np.abs(np.array(gains[wave.size :]) / gains[wave.size - 1] - 1.0).max() < 0.05
