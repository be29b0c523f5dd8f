"""Small legs that are flatter than wide ones, and an amplifier that slews: neither is taken for the gain."""

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray

FS, SLOPE = 2000.0, 0.1


def driven(
    r: FloatArray, low: float, width: float, free: float = 1.0, slew: float = np.inf
) -> tuple[pz.AdaptiveFeedforward, FloatArray]:
    """A controller behind a reference on a stage with backlash, and r - x [µm].

    The slope of small legs is a part `free` of the wide ones'; the amplifier gives no more than `slew` V/s.
    """
    driver = pz.AdaptiveFeedforward(FS, limits=pz.VoltageLimits(low, 100.0), estimators=())
    place, given, error = 0.0, 0.0, np.empty_like(r)
    for k, r_k in enumerate(r.tolist()):
        u = driver.step(r_k)
        given = min(max(u, given - slew / FS), given + slew / FS)
        place = min(max(place, given - width), given + width)
        x = SLOPE * ((1.0 - free) * place + free * given)
        error[k] = r_k - x
        driver.learn(u, x)
    return driver, error


def waves(*shapes: tuple[float, int]) -> FloatArray:
    """Triangles of amplitudes [µm] and numbers of periods of 4 Hz, on a bias of 6 µm."""
    parts = [pz.signals.triangle(amplitude, 4.0, periods, FS).values for amplitude, periods in shapes]
    return np.concatenate((np.linspace(0.0, 6.0, 500), 6.0 + np.concatenate(parts)))


def test_wide_legs_behind_a_small_scan_do_not_follow_its_slope() -> None:
    r = waves((2.0, 6), (0.06, 12), (2.0, 1))
    driver, error = driven(r, -20.0, 8.0, free=0.3)
    assert np.abs(error[-1000:-500]).max() < 1e-3  # the last small period
    assert np.abs(error[-500:]).max() < 1.5
    assert driver.events == ()


def test_wide_legs_behind_small_ones_are_not_scaled() -> None:
    driver, error = driven(waves((0.2, 3), (2.0, 8)), -20.0, 8.0, free=0.3)
    assert not any(event.reason.startswith("scaled") for event in driver.events)
    assert np.abs(error[-500:]).max() < 1.0


@pytest.mark.parametrize("slew", [20.0, 60.0])
def test_the_start_waits_for_an_amplifier_that_slews(slew: float) -> None:
    r = pz.signals.triangle(0.3, 1.0, 10, FS).values
    driver, error = driven(r, -100.0, 0.0, slew=slew)
    assert driver.events == ()
    assert driver.state["line"]["gain"] == pytest.approx(SLOPE, rel=1e-3)
    assert np.abs(error).max() < 3.0
    assert np.abs(error[-2000:]).max() < 1e-3
