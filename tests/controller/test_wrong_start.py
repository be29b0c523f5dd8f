"""Hum that passes for the answer to the first small ways: the gain is doubted, and sought again."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.controller.shared import in_blocks

FS, SLOPE, SWEPT = 10_000.0, 0.06, 2.5
UNIPOLAR, BIASED, BIPOLAR = (0.0, 150.0), (-20.0, 120.0), (-100.0, 100.0)


def driven(limits: Any, width: float, hum: float, phase: float = 2.0 * np.pi / 3.0) -> tuple[Any, float]:
    """A controller behind a triangle on a stage with backlash and 50 Hz on its gauge; its last error [µm]."""
    driver = pz.AdaptiveFeedforward(FS, limits=pz.VoltageLimits(*limits), estimators=())
    bias = 0.7 * SLOPE * 0.5 * (limits[0] + limits[1])
    wave = pz.signals.triangle(SWEPT, 5.0, 14, FS).values + bias
    r = np.concatenate((np.linspace(0.0, wave[0], 1000), wave))
    seen = hum * np.sin(2.0 * np.pi * 50.0 * np.arange(r.size) / FS + phase)
    place, error = 0.0, np.empty_like(r)
    for k, r_k in enumerate(r.tolist()):
        u = driver.step(r_k)
        place = min(max(place, u - width), u + width)
        x = SLOPE * (place + 0.05 * u) / 1.05
        error[k] = r_k - x
        driver.learn(u, x + float(seen[k]))
    return driver, float(np.abs(error[-2000:]).max())


@pytest.mark.parametrize(
    ("limits", "width", "hum"),
    [(UNIPOLAR, 2.0, 0.1), (UNIPOLAR, 5.0, 0.2), (BIASED, 2.0, 0.1), (BIASED, 5.0, 0.2), (BIPOLAR, 2.0, 0.2)],
)
def test_a_gain_of_the_wrong_sign_is_doubted(limits: Any, width: float, hum: float) -> None:
    driver, error = driven(limits, width, hum)
    assert driver.model.line[0] == pytest.approx(SLOPE, rel=0.3)
    assert error < 0.5 * SWEPT
    said = [event.reason for event in driver.events]
    assert any(reason.startswith("false start") for reason in said)
    assert not any(reason.startswith("out of reach") for reason in said)


def test_an_event_tells_where_it_was_noticed_also_within_a_block() -> None:
    limits = pz.VoltageLimits(-50.0, 100.0)
    driver = pz.AdaptiveFeedforward(FS, limits=limits, estimators=())
    r = pz.signals.triangle(14.0, 2.0, 4, FS).values
    in_blocks(driver, pz.SimulatedStage(FS, pz.LinearGain(0.1)), r, 2000)
    (event,) = [event for event in driver.events if event.reason.startswith("out of reach")]
    assert "limit of 100 V" in event.reason or "limit of -50 V" in event.reason
    assert event.time % (2000 / FS) != 0.0
