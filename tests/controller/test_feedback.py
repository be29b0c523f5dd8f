"""Integral feedback within the controller: what it removes, and how far a wrong sensor can drive it."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from tests.controller import shared
from tests.controller.shared import LIMITS, LOOP, last_error

FS = 1000.0
PERIOD = 250
WAVE = 5.0 * np.sin(2.0 * np.pi * 2.0 * np.arange(5000) / FS)


def controller(feedback: float | None, limits: pz.VoltageLimits = LIMITS, **options: Any) -> Any:
    return pz.AdaptiveFeedforward(FS, limits=limits, estimators=(), feedback=feedback, **options)


def none(_: float) -> float:
    return 0.0


def drive(driver: Any, r: FloatArray, drift: Any = none, noise: float = 0.0) -> Any:
    """Voltage, displacement and correction of a stage that drifts; noise of reference and reading."""
    stage, rng = pz.SimulatedStage(FS, LOOP), np.random.default_rng(0)
    u, x, i = np.empty_like(r), np.empty_like(r), np.empty_like(r)
    for k, r_k in enumerate(r.tolist()):
        u[k] = driver.step(r_k + noise * rng.normal())
        x[k] = stage.step(u[k]) + drift(k / FS)
        driver.learn(u[k], x[k] + noise * rng.normal())
        i[k] = driver.state["feedback"]
    return u, x, i


@pytest.mark.parametrize(("noise", "moved"), [(0.0, True), (0.02, False), (0.2, True), (0.2, False)])
def test_a_long_dwell_ends_where_it_should(noise: float, moved: bool) -> None:
    r = np.concatenate([WAVE if moved else [], np.full(40_000, 3.0)])
    u, x, _ = drive(controller(10.0), r, noise=noise)
    assert np.abs(u)[-20_000:].max() < 25.0
    assert np.abs(r - x)[-10_000:].max() < 0.01 + 5.0 * noise
    assert abs(np.mean((r - x)[-10_000:])) < 0.005 + 0.1 * noise


@pytest.mark.slow
def test_in_an_exact_rest_a_model_is_corrected_too() -> None:
    """Its voltage must not stand still while the correction grows: it would jump in the end."""
    # Where each way of the wave is longer than the last one, the recorded loop does not drive.
    grows = np.maximum(0.5, 1.15 ** (np.arange(-10_000, 0) / 250.0))
    r = np.concatenate([np.tile(WAVE, 2) * grows, np.full(20_000, WAVE[0]), WAVE])
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=(pz.HysteresisRLS,), feedback=2.0)
    u, x, _ = drive(driver, r, lambda t: 0.02 * max(t - 10.0, 0.0))
    assert driver.status.driving == "HysteresisRLS"
    assert np.abs(r - x)[28_000:30_000].max() < 0.02
    assert np.abs(np.diff(u))[29_990:30_010].max() < 2.0 * np.abs(np.diff(u))[30_010:].max()
    assert np.abs(r - x)[30_000:30_020].max() < 0.05


def test_none_changes_nothing() -> None:
    r = np.tile(WAVE, 2)
    first, second = (drive(controller(feedback), r)[0] for feedback in (None, 0))
    np.testing.assert_array_equal(first, second)


def test_it_goes_no_farther_than_the_corridor() -> None:
    r = np.concatenate([WAVE, np.full(10_000, 0.0)])
    _, _, i = drive(controller(20.0, corridor=0.2), r, lambda t: 2.0 * max(t - 5.0, 0.0))
    assert np.abs(i).max() == pytest.approx(0.2 * 5.0, rel=0.1)


def test_at_a_limit_it_does_not_wind_up() -> None:
    r = np.concatenate([WAVE - 3.0, np.full(5000, 6.0), np.tile(WAVE - 3.0, 4)])
    u, x, i = drive(controller(5.0, pz.VoltageLimits(-60.0, 20.0)), r)
    assert np.all(u[6000:10_000] == 20.0)
    assert np.ptp(i[6000:10_000]) < 0.1
    assert np.abs(r - x)[-5000:].max() < 0.8


def test_a_fault_holds_it() -> None:
    _, _, i = drive(controller(5.0), np.tile(WAVE, 4), lambda t: np.nan if 12.0 < t < 16.0 else 0.0)
    assert np.ptp(i[12_100:15_900]) == 0.0
    assert np.ptp(i) > 0.0


def test_a_stage_that_answers_late_does_not_swing() -> None:
    r, x, share = np.full(20_000, 5.0), 0.0, 1.0 - np.exp(-1.0 / (0.02 * FS))

    def late(u: float) -> float:
        nonlocal x
        x += share * (0.15 * u - x)
        return x

    assert last_error(r, shared.drive(controller(200.0), SimpleNamespace(step=late), r).x, 5000) < 0.01


def around_a_rest(part: float, behind: Any) -> tuple[FloatArray, FloatArray, int]:
    """Waves that stop for 20 s at a part of a period: errors, correction, and the first sample behind.

    The stage creeps by 0.43 µm in the rest; `behind` is what is left of it some samples after.
    """
    wave = np.tile(5.0 * np.sin(2.0 * np.pi * np.arange(PERIOD) / PERIOD), 24)
    k, rests = 12 * PERIOD + round(part * PERIOD), 20_000
    r = np.concatenate((wave[:k], np.full(rests, wave[k - 1]), wave[k:]))
    crept = np.zeros_like(r)
    crept[k : k + rests] = 0.1 * np.log10(1.0 + np.arange(rests))
    crept[k + rests :] = crept[k + rests - 1] * behind(np.arange(r.size - k - rests))
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, feedback=1.0)
    _, x, corrected = drive(driver, r, lambda t: -crept[round(t * FS)])
    return np.abs(r - x), corrected, k + rests


@pytest.mark.parametrize("part", [0.1, 0.3, 0.6, 0.85])
def test_what_feedback_corrects_at_rest_does_not_spoil_the_waves_behind(part: float) -> None:
    # The first waves behind wipe out the creep within 0.1 s.
    error, corrected, k = around_a_rest(part, lambda samples: np.exp(-samples / 100.0))
    assert abs(corrected[k - 1]) > 0.3
    assert error[k - 1] < 5e-3
    assert error[k + 3 * PERIOD : k + 4 * PERIOD].max() < 0.08  # 0.16 to 0.21 by the integral alone


# In the first case the first wave would miss 0.47 if the model and the feedback both corrected the creep.
@pytest.mark.parametrize(
    ("part", "most"),
    [(0.1, (0.2, 0.1)), *((part, (np.inf, 0.15, 0.05)) for part in (0.3, 0.5, 0.8))],
)
def test_creep_that_stays_is_learnt_within_a_wave_and_not_corrected_twice(part: float, most: Any) -> None:
    error, _, k = around_a_rest(part, np.ones_like)
    waves = error[k:][: len(most) * PERIOD].reshape(len(most), -1).max(axis=1)
    assert np.all(waves < most), waves


def test_a_staircase_keeps_its_correction_and_a_square_wave_its_steps() -> None:
    # Each plateau is a rest, and the stage drifts; the amplifier slews.
    limits = pz.VoltageLimits(-50.0, 50.0, slew_rate=4000.0, sample_rate=FS)
    stairs, square = np.repeat(-3.0 + 0.5 * np.arange(10), 1000), np.tile(np.repeat([3.0, -3.0], 2000), 3)
    for steps, length, soon, within in ((stairs, 1000, 50, 0.02), (square, 2000, 12, 0.3)):
        driver, error = controller(5.0, limits), []
        for k, r_k in enumerate((*WAVE.tolist(), *steps.tolist())):
            x = 0.15 * driver.step(r_k) + 0.02 * max(k / FS - 5.0, 0.0)
            driver.learn(driver.voltage, x)
            error.append(abs(r_k - x))
        plateaus = np.array(error[WAVE.size :]).reshape(-1, length)
        assert plateaus[1:, soon:].max() < within


QUICK = 1e4
TEN_HERTZ = np.tile(pz.signals.sine(3.0, 10.0, 1, QUICK).values, 20)


def ringing() -> pz.SimulatedStage:
    return pz.SimulatedStage(QUICK, LOOP, mechanics=pz.MassSpringDamper(500.0, 0.02))


@pytest.mark.parametrize("gain", [400.0, 1500.0])
def test_a_gain_that_shakes_the_stage_is_halved_until_it_does_not(gain: float) -> None:
    # Integral feedback is stable below twice damping times resonance, here 126/s.
    driver = pz.AdaptiveFeedforward(QUICK, limits=LIMITS, feedback=gain)
    assert last_error(TEN_HERTZ, shared.drive(driver, ringing(), TEN_HERTZ).x) < 0.05
    names = [event.name for event in driver.events]
    assert set(names) == {"feedback"}
    assert gain / 2.0 ** (len(names) - 1) > 60.0  # what rings when it is small enough may halve it again


def test_readings_that_are_late_do_not_pass_for_an_error() -> None:
    errors = []
    for feedback in (None, 20.0):
        driver = pz.AdaptiveFeedforward(QUICK, limits=LIMITS, feedback=feedback)
        run = shared.drive(driver, pz.SimulatedStage(QUICK, LOOP), TEN_HERTZ, shared.late(20))
        errors.append(last_error(TEN_HERTZ, run.x))
    assert errors[1] < 1.2 * errors[0]


def test_ringing_behind_steps_and_rare_readings_do_not_pass_for_shaking() -> None:
    def rare(k: int, x: float) -> float | None:
        return x if k % 10 == 0 else None

    driver = pz.AdaptiveFeedforward(QUICK, limits=LIMITS, feedback=20.0)
    shared.drive(driver, ringing(), np.tile(np.repeat([1.0, -1.0], 4000), 8))
    assert driver.state["shaking"]["halved"] == 0.0
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS, feedback=20.0)
    shared.drive(driver, pz.SimulatedStage(FS, LOOP), WAVE, rare)
    assert driver.state["shaking"]["halved"] == 0.0
