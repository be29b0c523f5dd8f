"""The default HysteresisRLS: random-walk forgetting on the reference's own clock, and its guards."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz

FS = 50_000.0
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)


def ring(r: Any, estimator: Any = None, **stage: Any) -> Any:
    return pz.track(
        r,
        stage=pz.PaperStage(sample_rate=r.sample_rate, seed=0, **stage),
        compensator=pz.InverseCompensator(START),
        estimator=estimator or pz.HysteresisRLS(r.sample_rate),
    )


def record(seconds: float = 1.0, noise: float = 1e-3) -> tuple[Any, Any]:
    u = pz.signals.triangle(33.0, 5.0, 5.0 * seconds, FS).values
    return u, TRUE.simulate(u) + noise * np.random.default_rng(0).standard_normal(u.size)


def test_settles_within_two_periods_from_a_cold_start() -> None:
    errors = ring(pz.signals.triangle(5.0, 5.0, 8, FS)).max_error_per_period()
    assert np.all(errors[2:] < 0.012 * 5.0)
    assert errors[-1] < 0.04


def test_settles_within_two_periods_of_a_change_of_amplitude() -> None:
    errors = ring(pz.signals.multi_amplitude([2.5, 7.5, 2.5], 5.0, 5, FS)).max_error_per_period()
    assert np.all(errors[2:5] < 0.012 * 2.5)
    assert np.all(errors[7:10] < 0.012 * 7.5)
    assert np.all(errors[12:] < 0.012 * 2.5)


def test_settles_within_two_periods_of_a_step_of_the_gain() -> None:
    schedule = np.array([[0.0, 1.0], [1.0, 1.0], [1.005, 0.8], [9.0, 0.8]])
    errors = ring(pz.signals.triangle(5.0, 5.0, 10, FS), gain_schedule=schedule).max_error_per_period()
    assert np.all(errors[7:] < 0.012 * 5.0)


@pytest.mark.parametrize(("amplitude", "frequency"), [(2.5, 10.0), (10.0, 2.0), (5.0, 1.0)])
def test_needs_no_tuning(amplitude: float, frequency: float) -> None:
    """The same defaults at other amplitudes and frequencies; sensor noise is 1.2 nm throughout."""
    fs = 20_000.0
    errors = ring(pz.signals.triangle(amplitude, frequency, 6, fs)).max_error_per_period()
    assert np.all(errors[3:] < 0.012 * amplitude)


@pytest.mark.parametrize("memory", ["period", 0.4])
def test_a_dwell_of_half_a_minute_moves_nothing(memory: Any) -> None:
    u, x = record(2.0)
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
    u, x = record(1.0)
    clean, spiked = pz.HysteresisRLS(FS), pz.HysteresisRLS(FS)
    clean.run(u, x)
    places = np.random.default_rng(0).choice(np.arange(1000, x.size), 200, replace=False)
    x[places] += 3.0
    spiked.run(u, x)
    assert spiked.status.outliers == pytest.approx(200, abs=5)
    np.testing.assert_allclose(spiked.theta[:3], clean.theta[:3], rtol=5e-3)


def test_step_of_the_sensors_offset_is_taken_for_a_new_level() -> None:
    u, x = record(3.0)
    estimator = pz.HysteresisRLS(FS)
    estimator.run(u, x + np.where(np.arange(x.size) > 20_000, 1.0, 0.0))
    assert 90 <= estimator.status.outliers <= 110
    model = estimator.model
    assert isinstance(model, pz.ColemanHodgdon)
    assert model.offset == pytest.approx(1.0, abs=0.1)
    assert np.max(np.abs(model.simulate(u) - TRUE.simulate(u) - 1.0)[-10_000:]) < 0.1


def test_frozen() -> None:
    u, x = record(0.4)
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
