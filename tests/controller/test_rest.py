"""A long rest within a leg: the line stays what the legs have shown."""

import numpy as np
import pytest

import piezoest as pz

FS = 1000.0
LIMITS = pz.VoltageLimits(minimum=-60.0, maximum=60.0)
LOOP = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)


@pytest.mark.parametrize(("part", "noise"), [(0.1, 1e-3), (0.3, 0.0), (0.4, 1e-3), (0.6, 0.0), (0.85, 1e-3)])
def test_a_rest_does_not_count_as_a_leg(part: float, noise: float) -> None:
    """A minute is hundreds of legs, in which a stage creeps and a loop is at one side."""
    rng, period = np.random.default_rng(0), 500
    wave = np.tile(5.0 * np.sin(2.0 * np.pi * np.arange(period) / period), 10)
    k = 6 * period + round(part * period)
    rest = wave[k - 1] + noise * rng.normal(size=30_000)
    r = np.concatenate((wave[:k], rest, wave[k:]))
    driver, stage = pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=()), pz.SimulatedStage(FS, LOOP)
    gains = []
    for j, r_j in enumerate(r.tolist()):
        u = driver.step(r_j)
        driver.learn(u, stage.step(u) + 1e-3 * rng.normal() - 0.1 * np.log10(1.0 + max(j - k, 0)))
        gains.append(float(driver.state["line"]["gain"]))
    before, after = gains[k], np.array(gains[k + rest.size :])
    assert np.abs(after / before - 1.0).max() < 0.08


@pytest.mark.parametrize("part", [0.1, 0.3, 0.6, 0.85])
def test_what_feedback_corrects_at_rest_does_not_spoil_the_waves_behind(part: float) -> None:
    """The stage creeps at rest by 0.43 µm; the first waves behind wipe that out within 0.1 s."""
    period, rests = 250, 20_000
    wave = np.tile(5.0 * np.sin(2.0 * np.pi * np.arange(period) / period), 24)
    k = 12 * period + round(part * period)
    r = np.concatenate((wave[:k], np.full(rests, wave[k - 1]), wave[k:]))
    crept = np.zeros_like(r)
    crept[k : k + rests] = 0.1 * np.log10(1.0 + np.arange(rests))
    crept[k + rests :] = crept[k + rests - 1] * np.exp(-np.arange(r.size - k - rests) / 100.0)
    driver, stage = pz.AdaptiveFeedforward(FS, limits=LIMITS, feedback=1.0), pz.SimulatedStage(FS, LOOP)
    error, corrected = np.empty_like(r), np.empty_like(r)
    for j, r_j in enumerate(r.tolist()):
        u = driver.step(r_j)
        x = stage.step(u) - crept[j]
        driver.learn(u, x)
        error[j], corrected[j] = abs(r_j - x), driver.state["feedback"]
    assert abs(corrected[k + rests - 1]) > 0.3
    assert error[k + rests - 1] < 5e-3
    waves = error[k + rests :][: 4 * period].reshape(4, -1).max(axis=1)
    assert waves[1] < 0.15  # 0.28 to 0.44 if the correction stays
    assert waves[3] < 0.06
