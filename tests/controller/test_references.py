"""References: small scans behind large moves, minor loops, a walk, the first period, and a long rest."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.bench.zoo.families import Reach, draw_family
from piezoest.controller import travel as travels
from piezoest.layout import Named, new
from tests.controller import shared
from tests.controller.shared import LIMITS, drive, in_blocks, last_error

FS, FAST, SLOW = 2000.0, 5000.0, 1000.0
# Its small loops close: those of a Coleman-Hodgdon stage wander for many periods.
LOOP = pz.PaperStage(FS).hysteresis
EIGHT = pz.signals.triangle(5.0, 5.0, 8, FS).values


def noisy(noise: float, seed: int = 0, besides: Callable[[int], float] = lambda k: 0.0) -> Any:
    """A sensor with noise [µm], of a stage that also moves by itself."""
    rng = np.random.default_rng(seed)
    return lambda k, x: x + float(besides(k)) + noise * rng.normal()


def driven(r: FloatArray, read: Any, **options: Any) -> tuple[Any, shared.Run]:
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS)
    return driver, drive(driver, pz.SimulatedStage(FS, LOOP, **options), r, read)


def scan(part: float, periods: int = 25, wide: Any = (), drift: float = 0.0) -> tuple[Any, Any, float]:
    """A move of 5 µm, or wide waves before it, and a triangle of a part of it around its end.

    It drifts by so many µm/s.
    """
    small = 5.0 * part * pz.signals.triangle(1.0, 5.0, periods, FS).values
    small = small + drift * np.arange(small.size) / FS
    r = np.concatenate((wide, np.linspace(0.0, 5.0, 800), 5.0 + small))
    driver, run = driven(r, noisy(1e-4))
    return r, driver, last_error(r, run.x, 800) / small.max()


@pytest.mark.parametrize("part", [0.002, 0.004, 0.008, 0.012, 0.03])
def test_a_small_scan_behind_a_large_move_is_learnt(part: float) -> None:
    _, driver, error = scan(part)
    assert error < 0.06
    assert driver.events == ()


@pytest.mark.parametrize("part", [0.004, 0.02])
def test_a_small_scan_behind_wide_waves_is_learnt(part: float) -> None:
    assert scan(part, 40, EIGHT[:2400])[2] < 0.1


@pytest.mark.parametrize("drift", [0.001, 0.003])
def test_a_small_scan_that_drifts_is_learnt(drift: float) -> None:
    # 10 nm where each sample that goes farther than all others is a way on.
    r, _, error = scan(0.008, 60, drift=drift)
    assert error * np.ptp(r[-800:]) < 0.002


@pytest.mark.parametrize("noise", [2e-3, 1e-2])
def test_waves_go_on_behind_a_rest_with_more_noise_than_a_small_scan(noise: float) -> None:
    rng = np.random.default_rng(0)
    r = np.concatenate((EIGHT, noise * rng.normal(size=20_000), EIGHT))
    off = np.abs(r - driven(r, lambda _, x: x + 1e-4 * rng.normal())[1].x)
    assert off[EIGHT.size + 20_000 :].max() < max(1.5 * off[EIGHT.size - 800 : EIGHT.size].max(), 0.05)


def test_noise_in_a_reference_that_rests_does_not_move_the_stage() -> None:
    k, noise = EIGHT.size - 120, 2e-3
    rest = EIGHT[k - 1] + noise * np.random.default_rng(0).normal(size=30_000)
    r = np.concatenate((EIGHT[:k], rest, EIGHT[k:], EIGHT))
    _, run = driven(r, noisy(0.0))
    # As soon as the rest is twice as long as a leg.
    assert np.ptp(run.u[k + 2000 : k + 30_000]) < 0.5 * noise * np.ptp(run.u) / np.ptp(r)
    off = np.abs(r - run.x)
    assert off[k + 30_000 :].max() < 1.5 * max(off[k - 1000 : k].max(), noise)


def test_a_long_move_behind_small_scans_is_no_leap() -> None:
    small, k = pz.signals.triangle(0.3, 5.0, 10, FS).values, np.linspace(0.0, 1.0, 2000)
    r = np.concatenate((small, 6.0 * k * k * (3.0 - 2.0 * k), np.full(1000, 6.0)))
    off = np.abs(r - driven(r, noisy(3e-4))[1].x)
    assert off[small.size :].max() < 0.25
    assert off[-1] < 0.1


def test_steps_up_and_one_step_back_show_the_gain() -> None:
    r = np.tile(np.repeat(np.linspace(-4.0, 4.0, 9), 400), 6)
    driver, run = driven(r, noisy(3e-4))
    settled = np.flatnonzero(np.arange(r.size) % 400 > 100)[-4000:]
    slope = np.polyfit(run.u[settled], run.x[settled], 1)[0]
    assert float(driver.state["line"]["gain"]) == pytest.approx(slope, rel=0.06)


@pytest.mark.parametrize("family", ["preisach", "coleman-hodgdon", "relays"])
@pytest.mark.parametrize("bias", [0.0, 3.0])
def test_small_waves_behind_wide_ones_stay_within_the_corridor(family: str, bias: float) -> None:
    """The corridor must not become narrow before the line has come to where the small waves are."""
    model = draw_family(family, np.random.default_rng(3), Reach(-100.0, 100.0), width=0.14, gain=0.1)
    small = bias + pz.signals.sine(0.25, 5.0, 25, FS).values
    r = np.concatenate((EIGHT, np.linspace(EIGHT[-1], bias, 300), small))
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS)
    x = in_blocks(driver, pz.SimulatedStage(FS, model, gauge=pz.Gauge(noise=3e-4), seed=1), r, 10)[1]
    assert np.abs(r - x)[-9000:].max() < 0.025


def test_a_smooth_step_behind_a_wide_way_is_no_noise_of_a_rest() -> None:
    """Near its top it hardly moves; held at its mean, it would be followed late afterwards."""
    noise = 3e-3 * np.random.default_rng(0).standard_normal(3000)
    pole = np.exp(0.02 * (-0.7 + 1j * np.sqrt(1.0 - 0.7**2)))
    step = lfilter([abs(1.0 - pole) ** 2], [1.0, -2.0 * pole.real, abs(pole) ** 2], np.full(3000, 0.3))
    for dither, rests in ((0.0, False), (noise, True)):
        travel = Named(new(travels.TRAVEL), travels.TRAVEL)
        travels.begin(travel, 0.0, 0.1)
        r = np.concatenate((np.linspace(0.0, 25.0, 200), 25.0 + step + dither))
        assert any(travels.trembles(travel) for value in r if travels.follow(travel, value) >= 0.0) == rests


def test_a_reference_that_leaves_a_rest_slowly_is_not_held() -> None:
    """Its noise is known by its steps: its distance from the mean grows with the motion itself."""
    t = np.arange(60_000) / FS
    noise = 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    r = np.concatenate((EIGHT, noise[:10_000], 0.25 * np.sin(2.0 * np.pi * 0.5 * t) + noise))
    off = np.abs(r - driven(r, noisy(3e-4))[1].x)
    assert off[-20_000:].max() < 0.03


@pytest.mark.parametrize("noise", [0.003, 0.006])
def test_a_dither_below_the_noise_makes_no_leap(noise: float) -> None:
    hold = 5.0 + 0.002 * np.sin(2.0 * np.pi * 20.0 * np.arange(30_000) / FS)
    r = np.concatenate((np.linspace(0.0, 5.0, 4000), hold))
    read = noisy(noise, 1, lambda k: 0.15 * np.log10(1.0 + max(k - 4000, 0) / 200.0))
    off = (r - driven(r, read)[1].x)[6000:]
    assert np.abs(off[100:] - off[:-100]).max() < 0.03


def test_a_rest_with_a_coarse_sensor_is_no_fault() -> None:
    r = np.concatenate((EIGHT, 1.0 + 3e-4 * np.random.default_rng(0).normal(size=60_000)))
    driver, run = driven(r, noisy(0.0), gauge=pz.Gauge(noise=2e-4, resolution=5e-3))
    assert driver.events == ()
    assert last_error(r, run.x) < 0.1


def test_a_long_walk_is_left_to_the_models() -> None:
    a = 1.0 - np.exp(-0.004)
    walk = np.random.default_rng(2).standard_normal(230_000)
    for _ in range(2):
        walk = lfilter([a], [1.0, a - 1.0], walk)
    r = 4.0 * np.tanh(walk / (1.5 * walk.std()))
    model = draw_family("preisach", np.random.default_rng(2), Reach(-100.0, 100.0), width=0.15, gain=0.07)
    stage = pz.SimulatedStage(FS, model, gauge=pz.Gauge(noise=3e-4), seed=2)
    driver = pz.AdaptiveFeedforward(FS, limits=pz.VoltageLimits(minimum=-100.0, maximum=100.0))
    x = in_blocks(driver, stage, r, 10)[1]
    assert np.sqrt(np.mean((r - x)[150_000:] ** 2)) < 0.04


def largest(error: FloatArray) -> float:
    return float(np.abs(error).max())


def mean(error: FloatArray) -> float:
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize(
    ("r", "begin", "size", "most"),
    [
        # 10 % where the corridor goes by the last legs alone.
        (pz.signals.two_tone([3.5, 1.5], [2.0, 7.0], 4.0, FAST), -5000, largest, 0.01),
        # 2 % where two legs have to pass before a model drives.
        (pz.signals.triangle(5.0, 5.0, 3, FAST), 1000, largest, 0.012),
        # More where models are measured by the smallest miss of the line, whatever the last legs were.
        (pz.signals.random_walk(5.0, 10.0, 10.0, FAST, seed=0), 10_000, mean, 0.02),
    ],
    ids=["minor loops", "first turn", "walk"],
)
def test_what_does_not_repeat_is_followed(r: pz.Signal, begin: int, size: Any, most: float) -> None:
    driver = pz.AdaptiveFeedforward(FAST, limits=pz.VoltageLimits(minimum=-100.0, maximum=100.0))
    error = pz.track(r, stage=pz.PaperStage(FAST, seed=1), controller=driver).error[begin:]
    assert size(error / 5.0) < most


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("frequency", [5.0, 15.0])
def test_a_model_drives_in_the_first_period_at_a_high_rate(seed: int, frequency: float) -> None:
    """At 5 Hz the start leaves little of the first leg, which says nothing about late readings.

    At 15 Hz the line leaves the stage far off, which says nothing about the model that drives then.
    """
    r = pz.signals.triangle(5.0, frequency, 2, 50_000.0)
    driver = pz.AdaptiveFeedforward(r.sample_rate, limits=pz.VoltageLimits(minimum=-50.0, maximum=100.0))
    record = pz.track(r, stage=pz.PaperStage(r.sample_rate, seed=seed), controller=driver)
    # 0.7 µm where the line drives.
    assert record.max_error(last_periods=1) < 0.15


@pytest.mark.parametrize(("part", "noise"), [(0.1, 1e-3), (0.3, 0.0), (0.4, 1e-3), (0.6, 0.0), (0.85, 1e-3)])
def test_a_rest_does_not_count_as_a_leg(part: float, noise: float) -> None:
    rng, period, gains = np.random.default_rng(0), 500, []
    wave = np.tile(5.0 * np.sin(2.0 * np.pi * np.arange(period) / period), 10)
    k = 6 * period + round(part * period)
    rest = wave[k - 1] + noise * rng.normal(size=30_000)
    driver = pz.AdaptiveFeedforward(SLOW, limits=LIMITS, estimators=())

    def read(j: int, x: float) -> float:
        gains.append(float(driver.state["line"]["gain"]))
        return float(x + 1e-3 * rng.normal() - 0.1 * np.log10(1.0 + max(j - k, 0)))

    drive(driver, pz.SimulatedStage(SLOW, shared.LOOP), np.concatenate((wave[:k], rest, wave[k:])), read)
    assert np.abs(np.array(gains[k + rest.size + 1 :]) / gains[k + 1] - 1.0).max() < 0.08
