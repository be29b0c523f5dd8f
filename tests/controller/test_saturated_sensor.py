"""A sensor that saturates: its readings at the ends of its range say nothing, those between are right."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.controller import levels
from tests.controller.shared import LIMITS, LOOP, drive, last_error, late

FS = 5000.0


def saturated(
    end: float, before: Callable[[int, float], float] = lambda _, x: x, since: int = 0
) -> Callable[[int, float], float]:
    """A noisy sensor whose readings stay within -end and end [µm] from a sample on."""
    rng = np.random.default_rng(3)

    def read(k: int, x: float) -> float:
        reading = before(k, x) + rng.normal(0.0, 0.002)
        return min(max(reading, -end), end) if k >= since else reading

    return read


def driven(
    r: FloatArray, sample_rate: float, read: Callable[[int, float], float]
) -> tuple[pz.AdaptiveFeedforward, FloatArray]:
    controller = pz.AdaptiveFeedforward(sample_rate, limits=LIMITS)
    return controller, drive(controller, pz.SimulatedStage(sample_rate, LOOP), r, read).x


@pytest.mark.parametrize("amplitude", [1.0, 2.0, 5.0])
def test_the_line_is_found_between_the_levels(amplitude: float) -> None:
    r = pz.signals.triangle(amplitude, 5.0, 20, FS).values
    controller, x = driven(r, FS, saturated(0.6 * amplitude))
    assert "saturated" in {event.name for event in controller.events}
    # Levels taken for answers made it 45 % and more.
    assert last_error(r, x) < 0.12 * amplitude


def test_late_readings_that_stand_still() -> None:
    raster = np.clip(1.6 * pz.signals.triangle(2.0, 47.0, 60, 1000.0).values, -2.0, 2.0)
    _, x = driven(raster, 1000.0, saturated(1.2, late(3)))
    assert last_error(raster, x) < 0.2


def test_a_good_line_is_kept() -> None:
    r = pz.signals.triangle(4.0, 5.0, 20, FS).values
    controller, x = driven(r, FS, saturated(2.4, since=8 * 1000))
    assert "saturated" in {event.name for event in controller.events}
    assert last_error(r, x) < 0.1 * 4.0


def test_a_reading_beyond_a_level_shows_that_it_is_none() -> None:
    known = SimpleNamespace(rose=0.0, top=0.0, bottom=0.0, has_top=0.0, has_bottom=0.0, early=0.0)
    levels.change(known, 0.0, 2.0)
    levels.stand(known, 2.0, False)
    levels.change(known, 2.0, -1.0)
    levels.stand(known, -1.0, True)
    assert levels.holds(known, 2.0)
    assert levels.holds(known, -1.0)
    assert not levels.holds(known, 0.5)
    levels.change(known, -1.0, 2.5)
    assert not levels.holds(known, 2.0)
    assert levels.are_known(known)
    assert known.early == 1.0
