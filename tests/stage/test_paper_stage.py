"""The paper's stage: its loops are those of Tables I and II."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from piezoest import PaperStage, signals

# Amplitude [µm], K [µm/V] and maximum error of linear feed-forward [µm]: Tables I and II, 5 Hz.
ROWS = [(2.5, 0.141, 0.20), (5.0, 0.155, 0.54), (7.5, 0.165, 0.93)]


@pytest.mark.parametrize(("amplitude", "gain", "error"), ROWS)
def test_gain_and_linear_error(amplitude: float, gain: float, error: float) -> None:
    r: Any = np.asarray(signals.triangle(amplitude, 5.0, 10, 50_000.0))
    stage = PaperStage(noise=0.0)
    u = r / gain
    stage.run(u)
    last = slice(-10_000, None)
    x = np.asarray(stage.displacement)
    fitted = (u[last] @ x[last]) / (u[last] @ u[last])
    assert fitted == pytest.approx(gain, rel=0.02)
    assert np.max(np.abs(r - x)[last]) == pytest.approx(error, rel=0.06)


def test_readings_lie_on_the_converter_and_carry_the_noise() -> None:
    stage = PaperStage()
    x = stage.run(np.zeros(20_000))
    codes = x / stage.gauge.resolution
    np.testing.assert_allclose(codes, np.round(codes), atol=1e-9)
    assert 0.5e-3 < x.std() < 1.5e-3
    smooth = PaperStage(noise=0.0, quantisation=False)
    np.testing.assert_array_equal(smooth.run(np.zeros(100)), np.zeros(100))


def test_parts_can_be_left_out() -> None:
    bare = PaperStage(noise=0.0, quantisation=False, filters=False, creep=False, mechanics=False)
    u = 30.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(20_000) / 50_000.0)
    np.testing.assert_array_equal(bare.run(u), bare.hysteresis.simulate(u))
    assert bare.creep is None
    assert bare.mechanics is None
    assert PaperStage(10_000.0).gauge.cutoff is None


def test_voltage_stays_within_range() -> None:
    stage = PaperStage(noise=0.0)
    stage.run(np.full(5000, 1e6))
    clipped = stage.displacement
    stage.reset()
    stage.run(np.full(5000, 100.0))
    np.testing.assert_array_equal(clipped, stage.displacement)


def test_unknown_keywords_are_refused() -> None:
    with pytest.raises(TypeError):
        PaperStage(gain_shedule=None)  # type: ignore[call-arg]
