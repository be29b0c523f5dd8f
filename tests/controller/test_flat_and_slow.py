"""Small legs that are flatter than wide ones are not taken for the gain."""

import numpy as np

import piezoest as pz
from piezoest._checks import FloatArray
from tests.controller.shared import drive

FS, SLOPE = 2000.0, 0.1


class Backlash:
    """A stage whose slope for small legs is 0.3 of that for wide ones."""

    place = 0.0

    def step(self, u: float) -> float:
        self.place = min(max(self.place, u - 8.0), u + 8.0)
        return SLOPE * (0.7 * self.place + 0.3 * u)


def driven(r: FloatArray) -> tuple[pz.AdaptiveFeedforward, FloatArray]:
    """A controller behind a reference, and r - x [µm]."""
    driver = pz.AdaptiveFeedforward(FS, limits=pz.VoltageLimits(-20.0, 100.0), estimators=())
    return driver, r - drive(driver, Backlash(), r).x


def waves(*shapes: tuple[float, int]) -> FloatArray:
    """Triangles of amplitudes [µm] and numbers of periods of 4 Hz, on a bias of 6 µm."""
    parts = [pz.signals.triangle(amplitude, 4.0, periods, FS).values for amplitude, periods in shapes]
    return np.concatenate((np.linspace(0.0, 6.0, 500), 6.0 + np.concatenate(parts)))


def test_wide_legs_behind_a_small_scan_do_not_follow_its_slope() -> None:
    r = waves((2.0, 6), (0.06, 12), (2.0, 1))
    driver, error = driven(r)
    assert np.abs(error[-1000:-500]).max() < 1e-3  # the last small period
    assert np.abs(error[-500:]).max() < 1.5
    assert driver.events == ()


def test_wide_legs_behind_small_ones_are_not_scaled() -> None:
    driver, error = driven(waves((0.2, 3), (2.0, 8)))
    assert not any(event.reason.startswith("scaled") for event in driver.events)
    assert np.abs(error[-500:]).max() < 1.0
