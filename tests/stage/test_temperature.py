"""Stages that warm: the law, the schedules, the same bits in step and run."""

from typing import Any

import numpy as np
import pytest

from piezoest import (
    ColemanHodgdon,
    PaperStage,
    PrandtlIshlinskii,
    SimulatedStage,
    TemperatureLaw,
    signals,
)

FS = 10_000.0
U = 40.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(3000) / FS)
LAW = TemperatureLaw(reference=20.0, gain=2e-3, hysteresis=-6e-3)
PLAYS = PrandtlIshlinskii(0.1, [1.0, 5.0, 20.0], [0.02, 0.01, 0.03], offset=-0.2)
COLEMAN_HODGDON = ColemanHodgdon(0.021, 0.147, 4.29e-3, offset=0.3)


def test_law_scales_the_plays_against_the_line() -> None:
    warm = SimulatedStage(FS, PLAYS, temperature=45.0, temperature_law=LAW).run(U)
    g, h = np.exp(2e-3 * 25.0), np.exp(-6e-3 * 25.0)
    scaled = PrandtlIshlinskii(g * PLAYS.gain, PLAYS.thresholds, g * h * PLAYS.weights, PLAYS.offset)
    np.testing.assert_allclose(warm, scaled.simulate(U), atol=1e-12)


def test_law_scales_the_loop_of_coleman_hodgdon() -> None:
    """In (2), (3) it is b that makes w_h; a, the voltage scale, stays."""
    warm = SimulatedStage(FS, COLEMAN_HODGDON, temperature=45.0, temperature_law=LAW).run(U)
    g, h = np.exp(2e-3 * 25.0), np.exp(-6e-3 * 25.0)
    a, b, c = COLEMAN_HODGDON.a, g * h * COLEMAN_HODGDON.b, g * COLEMAN_HODGDON.c
    scaled = ColemanHodgdon(a, c - b, a * c, COLEMAN_HODGDON.offset)
    np.testing.assert_allclose(warm, scaled.simulate(U), atol=1e-12)


def loop(temperature: float | None) -> tuple[float, float]:
    """Gain [µm/V] and half the opening of the loop, relative to the amplitude, at some 5 µm."""
    stage = PaperStage(noise=0.0, quantisation=False, temperature=temperature)
    u = np.asarray(signals.triangle(32.0, 5.0, 3, 50_000.0))
    stage.run(u)
    u, x = u[-10_000:], np.asarray(stage.displacement)[-10_000:]
    gain = float(u @ x / (u @ u))
    return gain, float(np.max(np.abs(x - gain * u)) / np.max(np.abs(x)))


def test_the_paper_stage_gains_and_straightens_as_it_warms() -> None:
    (cold_gain, cold_loop), (gain, opening), (warm_gain, warm_loop) = loop(10.0), loop(None), loop(30.0)
    assert loop(20.0) == (gain, opening)
    assert cold_gain < gain < warm_gain
    assert cold_loop > opening > warm_loop
    # About 0.1 % a kelvin, as the docstring says.
    assert warm_gain / cold_gain == pytest.approx(1.02, abs=0.01)


@pytest.mark.parametrize(
    ("temperature", "message"),
    [
        (np.array([20.0, 30.0]), r"temperature must have shape \(M, 2\), time and temperature"),
        (float("nan"), "temperature must be finite"),
        ([[1.0, 20.0], [0.0, 30.0]], "temperature must have rising times"),
        (lambda t: np.ones(3), "temperature must return one temperature per time"),
        (lambda t: t * np.nan, "temperature returned NaN or infinity"),
    ],
)
def test_refusals(temperature: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PaperStage(temperature=temperature).run(U)
