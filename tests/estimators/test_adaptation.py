"""The default HysteresisRLS: random-walk forgetting on the reference's own clock, and its guards."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.estimators.shared import TRUE, recorded

FS = 50_000.0
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)


def ring(r: Any, estimator: Any = None, **stage: Any) -> Any:
    return pz.track(
        r,
        stage=pz.PaperStage(sample_rate=r.sample_rate, seed=0, **stage),
        compensator=pz.InverseCompensator(START),
        estimator=estimator or pz.HysteresisRLS(r.sample_rate),
    )


TRIANGLE, STEP = pz.signals.triangle, {"gain_schedule": np.array([[1.0, 1.0], [1.005, 0.8]])}


@pytest.mark.parametrize(
    ("reference", "stage", "within"),
    [
        (TRIANGLE(5.0, 5.0, 8, FS), {}, {2: 5.0}),
        (pz.signals.multi_amplitude([2.5, 7.5, 2.5], 5.0, 5, FS), {}, {2: 2.5, 7: 7.5, 12: 2.5}),
        (TRIANGLE(5.0, 5.0, 10, FS), STEP, {7: 5.0}),
        # The same defaults at other amplitudes and frequencies; the noise is 1.2 nm throughout.
        (TRIANGLE(2.5, 10.0, 6, 20_000.0), {}, {3: 2.5}),
        (TRIANGLE(10.0, 2.0, 6, 20_000.0), {}, {3: 10.0}),
        (TRIANGLE(5.0, 1.0, 6, 20_000.0), {}, {3: 5.0}),
    ],
    ids=["cold start", "other amplitudes", "step of the gain", "fast", "wide", "slow"],
)
def test_settles_within_periods(reference: Any, stage: Any, within: dict[int, float]) -> None:
    """From so many periods on the error is below 1.2 % of the amplitude, three periods long at the least."""
    errors = ring(reference, **stage).max_error_per_period()
    for period, amplitude in within.items():
        assert np.all(errors[period : period + 3] < 0.012 * amplitude)


@pytest.mark.parametrize("memory", ["period", 0.4])
@pytest.mark.slow_but_first
def test_a_dwell_of_half_a_minute_moves_nothing(memory: Any) -> None:
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
    np.testing.assert_allclose(estimator.theta[:3], TRUE.theta, rtol=0.1 if memory == "period" else 0.02)


def test_spikes_are_left_out() -> None:
    u, x = recorded(FS, 5.0)
    clean, spiked = pz.HysteresisRLS(FS), pz.HysteresisRLS(FS)
    clean.run(u, x)
    places = np.random.default_rng(0).choice(np.arange(1000, x.size), 200, replace=False)
    x[places] += 3.0
    spiked.run(u, x)
    assert spiked.status.outliers == pytest.approx(200, abs=5)
    np.testing.assert_allclose(spiked.theta[:3], clean.theta[:3], rtol=5e-3)


def test_step_of_the_sensors_offset_is_taken_for_a_new_level() -> None:
    u, x = recorded(FS, 15.0)
    estimator = pz.HysteresisRLS(FS)
    estimator.run(u, x + np.where(np.arange(x.size) > 20_000, 1.0, 0.0))
    assert 90 <= estimator.status.outliers <= 110
    model = estimator.model
    assert isinstance(model, pz.ColemanHodgdon)
    assert model.offset == pytest.approx(1.0, abs=0.1)
    assert np.max(np.abs(model.simulate(u) - TRUE.simulate(u) - 1.0)[-10_000:]) < 0.1


def test_frozen() -> None:
    u, x = recorded(FS, 2.0)
    estimator = pz.HysteresisRLS(FS)
    estimator.run(u[:5000], x[:5000])
    before = estimator.theta
    estimator.frozen = True
    estimator.run(u[5000:10_000], x[5000:10_000])
    assert np.array_equal(estimator.theta, before)
    assert estimator.status.last == "held"
    assert pz.HysteresisRLS.from_dict(estimator.to_dict()).frozen
    estimator.frozen = False
    estimator.run(u[10_000:], x[10_000:])
    assert not np.array_equal(estimator.theta, before)


@pytest.mark.slow
def test_it_neither_winds_up_nor_drifts() -> None:
    """Over a hundred million samples: half an hour of a stage at 50 kHz."""
    rng, estimator = np.random.default_rng(0), pz.HysteresisRLS(FS)
    u = pz.signals.triangle(35.0, 5.0, 50, FS).values
    loop = TRUE.simulate(np.tile(u, 2))[u.size :]
    found = []
    for _ in range(200):
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
