"""HysteresisRLS: the paper's, with a memory in seconds, and the default, with random-walk forgetting."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.estimators.shared import START, TRUE, recorded
from tests.reference import hysteresis_rls as reference

FS = 50_000.0
TRIANGLE, STEP = pz.signals.triangle, {"gain_schedule": np.array([[1.0, 1.0], [1.005, 0.8]])}
AMPLITUDES = pz.signals.multi_amplitude([2.5, 7.5, 2.5], 5.0, 5, FS)
FAR = pz.ColemanHodgdon(0.014, 0.2, 0.0054).nearest_admissible(1e-3)


def taught(u: Any, x: Any, **options: Any) -> Any:
    estimator = pz.HysteresisRLS(FS, memory=0.4, **options)
    estimator.run(u, x)
    return estimator


def error(estimator: Any) -> float:
    return float(np.abs(estimator.theta[:3] / TRUE.theta - 1.0).max())


def test_equals_the_textbook_with_gaps() -> None:
    u, x = recorded(FS, 0.75)
    x[2000] = x[5001] = x[5002] = np.nan
    theta = pz.HysteresisRLS(FS, memory=0.1, policies=()).run(u, x).theta
    given = {"uncertainty": 0.5, "noise": 1.5e-3, "memory": 0.1, "cutoff": 2500.0}
    expected = reference.coleman_hodgdon(u, x, FS, START.theta, **given)
    np.testing.assert_allclose(theta, expected, rtol=1e-7)


def test_finds_the_centre_of_the_loop() -> None:
    u, x = recorded(FS, 5.0)
    u, x = u + 60.0, x - 120.0
    filtered = pz.HysteresisEKF(FS, noise=1e-3, drift=0.0, mismatch=0.0, offset=True)
    filtered.run(u, x)
    for estimator in (taught(u, x, offset=True), filtered):
        assert error(estimator) < 0.03
        assert estimator.model.offset == pytest.approx(-120.0 - TRUE.c * 60.0, abs=0.15)
        assert np.max(np.abs(estimator.model.simulate(u) - x)[u.size // 2 :]) < 0.02
    assert error(taught(u, x)) > 0.2


def test_high_pass_removes_a_bias_of_the_sensor() -> None:
    u = pz.signals.triangle(33.0, 5.0, 25, FS, smoothing=0.0).values
    x = TRUE.simulate(u) + 2.0
    assert error(taught(u, x, high_pass=0.5)) < 1e-3 < 0.5 < error(taught(u, x))


@pytest.mark.parametrize("delay", [0.5, 2.5, 3.0])
@pytest.mark.slow_but_first
def test_delay(delay: float) -> None:
    u, x = recorded(FS, 5.0, 0.0)
    late = np.interp(np.arange(x.size) - delay, np.arange(x.size), x)
    told = error(taught(u, late, delay=delay))
    assert told < 2e-3
    assert told < 0.5 * error(taught(u, late))


def test_long_gap_starts_anew() -> None:
    u, x = recorded(FS, 10.0, 0.0)
    x[30_000:52_345] = np.nan
    assert error(taught(u, x)) < 1e-3


@pytest.mark.parametrize(
    ("kind", "start", "reference", "stage", "within"),
    [
        # A cold start, then a step of the gain.
        (pz.HysteresisRLS, START, TRIANGLE(5.0, 5.0, 10, FS), STEP, {2: 5.0, 7: 5.0}),
        (pz.HysteresisRLS, START, AMPLITUDES, {}, {2: 2.5, 7: 7.5, 12: 2.5}),
        # The same defaults at other amplitudes and frequencies; the noise is 1.2 nm throughout.
        (pz.HysteresisRLS, START, TRIANGLE(2.5, 10.0, 6, 20_000.0), {}, {3: 2.5}),
        (pz.HysteresisRLS, START, TRIANGLE(10.0, 2.0, 6, 20_000.0), {}, {3: 10.0}),
        (pz.HysteresisRLS, START, TRIANGLE(5.0, 1.0, 6, 20_000.0), {}, {3: 5.0}),
        (pz.OutputErrorRLS, FAR, TRIANGLE(5.0, 5.0, 8, 10_000.0), {}, {2: 5.0, 5: 5.0}),
    ],
)
def test_settles_within_periods(kind: Any, start: Any, reference: Any, stage: Any, within: Any) -> None:
    """From so many periods on the error is below 1.2 % of the amplitude, three periods long at the least."""
    rate = reference.sample_rate
    parts: Any = {"compensator": pz.InverseCompensator(start), "estimator": kind(rate, initial_model=start)}
    record = pz.track(reference, stage=pz.PaperStage(sample_rate=rate, seed=0, **stage), **parts)
    errors = record.max_error_per_period()
    for period, amplitude in within.items():
        assert np.all(errors[period : period + 3] < 0.012 * amplitude)


@pytest.mark.parametrize(("memory", "within"), [("period", 0.1), (0.4, 0.02)])
@pytest.mark.slow_but_first
def test_a_dwell_of_half_a_minute_moves_nothing(memory: Any, within: float) -> None:
    u, x = recorded(FS, 10.0)
    half = u.size // 2
    estimator = pz.HysteresisRLS(FS, memory=memory)
    estimator.run(u[:half], x[:half])
    before, P = estimator.theta, estimator.P
    noise = 1e-3 * np.random.default_rng(1).standard_normal(50_000)
    for _ in range(30):
        estimator.run(np.full(50_000, u[half]), x[half] + noise, every=50_000)
    np.testing.assert_allclose(estimator.theta[:3], before[:3], rtol=2e-3)
    assert np.trace(estimator.P) <= 1.01 * np.trace(P)
    assert estimator.status.held > 1_400_000
    estimator.run(u[half:], x[half:])
    np.testing.assert_allclose(estimator.theta[:3], TRUE.theta, rtol=within)


def test_spikes_are_left_out() -> None:
    u, x = recorded(FS, 5.0)
    clean, spiked = pz.HysteresisRLS(FS), pz.HysteresisRLS(FS)
    clean.run(u, x)
    x[np.random.default_rng(0).choice(np.arange(1000, x.size), 200, replace=False)] += 3.0
    spiked.run(u, x)
    assert spiked.status.outliers == pytest.approx(200, abs=5)
    np.testing.assert_allclose(spiked.theta[:3], clean.theta[:3], rtol=5e-3)


def test_step_of_the_sensors_offset_is_taken_for_a_new_level() -> None:
    u, x = recorded(FS, 15.0)
    estimator = pz.HysteresisRLS(FS)
    estimator.run(u, x + np.where(np.arange(x.size) > 20_000, 1.0, 0.0))
    assert 90 <= estimator.status.outliers <= 110
    model: Any = estimator.model
    assert model.offset == pytest.approx(1.0, abs=0.1)
    assert np.max(np.abs(model.simulate(u) - TRUE.simulate(u) - 1.0)[-10_000:]) < 0.1


def test_frozen() -> None:
    u, x = recorded(FS, 1.0)
    estimator = pz.HysteresisRLS(FS)
    estimator.run(u, x)
    before = estimator.theta
    estimator.frozen = True
    estimator.run(u, x)
    assert np.array_equal(estimator.theta, before)
    assert estimator.status.last == "held"
    assert pz.HysteresisRLS.from_dict(estimator.to_dict()).frozen
    estimator.frozen = False
    estimator.run(u, x)
    assert not np.array_equal(estimator.theta, before)


@pytest.mark.slow
def test_it_neither_winds_up_nor_drifts() -> None:
    rng, estimator, found = np.random.default_rng(0), pz.HysteresisRLS(FS), []
    u = pz.signals.triangle(35.0, 5.0, 50, FS).values
    loop = TRUE.simulate(np.tile(u, 2))[u.size :]
    for _ in range(100):
        estimator.run(u, loop + 1.2e-3 * rng.standard_normal(u.size), every=u.size)
        found.append(estimator.theta)
        P = estimator.P
        np.testing.assert_array_equal(P, P.T)
        assert np.linalg.eigvalsh(P / np.sqrt(np.outer(np.diag(P), np.diag(P))))[0] > 0.0
    settled = np.array(found[4:])  # the noise of the sensor is learnt over a hundred periods
    # In standard deviations of the first blocks, of which an estimate of these is itself uncertain.
    deviation = (settled - settled[:20].mean(axis=0)) / settled[:20].std(axis=0, ddof=1)
    assert np.max(np.abs(deviation)) < 8.0
    assert np.max(np.abs(np.polyfit(np.linspace(0.0, 1.0, len(settled)), deviation, 1)[0])) < 8.0


@pytest.mark.parametrize(
    ("make", "every", "most"),
    [(pz.HysteresisRLS, 10, 0.15), (pz.HysteresisEKF, 10, 0.2), (pz.OutputErrorRLS, 1, 0.15)],
)
def test_coarse_steps_of_the_voltage(make: Any, every: int, most: float) -> None:
    """A resonance answers each step over several samples; every tenth sample has the whole answer."""
    rate, step = 10_000.0, 0.2
    r = pz.signals.triangle(5.0, 5.0, 6, rate).values
    estimator, stage = make(rate / every), pz.PaperStage(rate, seed=0)
    compensator = pz.InverseCompensator(estimator.model)
    x = np.empty_like(r)
    for k, r_k in enumerate(r.tolist()):
        u = round(compensator.step(r_k) / step) * step
        x[k] = stage.step(u)
        if k % every == 0:
            estimator.step(u, float(x[k]))
            compensator.model = estimator.model
    assert np.abs(r - x)[-2000:].max() < most
