"""The paper's stage: its loops are those of Tables I and II."""

from typing import Any

import numpy as np
import pytest

from piezoest import PaperStage, PrandtlIshlinskii, signals

# Amplitude [µm], K [µm/V] and maximum error of linear feed-forward [µm]: Tables I and II, 5 Hz.
ROWS = [(2.5, 0.141, 0.20), (5.0, 0.155, 0.54), (7.5, 0.165, 0.93)]


@pytest.mark.parametrize(("amplitude", "gain", "error"), ROWS)
def test_gain_and_linear_error(amplitude: float, gain: float, error: float) -> None:
    r: Any = np.asarray(signals.triangle(amplitude, 5.0, 5, 50_000.0))
    stage = PaperStage(noise=0.0)
    last = slice(-10_000, None)
    fitted = gain
    for _ in range(3):  # as in the ring, u = r / K with the K that is found
        stage.reset()
        u = r / fitted
        stage.run(u)
        x = np.asarray(stage.displacement)
        fitted = float((u[last] @ x[last]) / (u[last] @ u[last]))
    assert fitted == pytest.approx(gain, rel=0.02)
    assert np.max(np.abs(r - x)[last]) == pytest.approx(error, rel=0.05)


def test_hysteresis_is_admissible_and_can_be_inverted() -> None:
    stage = PaperStage()
    model = stage.hysteresis
    assert isinstance(model, PrandtlIshlinskii)
    assert model.is_admissible
    assert np.all(np.diff(model.thresholds) > 0.0)
    assert np.all(model.weights > 0.0)
    assert stage.creep is not None
    assert np.all(stage.creep.gains >= 0.0)
    assert stage.creep.gains.sum() < 0.1
    r = 7.5 * np.sin(np.linspace(0.0, 12.0, 500))
    np.testing.assert_allclose(model.simulate(model.invert(r)), r, atol=1e-9)


def test_readings_lie_on_the_converter_and_carry_the_noise() -> None:
    stage = PaperStage()
    x = stage.run(np.zeros(20_000))
    codes = x / stage.gauge.resolution
    np.testing.assert_allclose(codes, np.round(codes), atol=1e-9)
    assert 0.5e-3 < x.std() < 1.5e-3
    smooth = PaperStage(noise=0.0, quantisation=False)
    np.testing.assert_array_equal(smooth.run(np.zeros(100)), np.zeros(100))
