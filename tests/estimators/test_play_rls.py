"""PrandtlIshlinskiiRLS: what it learns, what it leaves alone, and the ring."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.estimators.shared import START

RATE = 10_000.0


def sine(volts: float, samples: int, frequency: float = 5.0) -> Any:
    return volts * np.sin(2.0 * np.pi * frequency * np.arange(samples) / RATE)


@pytest.mark.parametrize("stage", [pz.PaperStage, pz.PreisachStage])
@pytest.mark.slow_but_first
def test_minor_loops_in_the_ring(stage: Any) -> None:
    compensator = pz.InverseCompensator(START, transfer_samples=100)
    parts: Any = {"compensator": compensator, "estimator": pz.PrandtlIshlinskiiRLS(RATE)}
    reference = pz.signals.two_tone([3.5, 1.5], [2.0, 7.0], 4.0, RATE)
    record = pz.track(reference, stage=stage(RATE), **parts, update_interval=10)
    assert np.abs(record.error)[-10_000:].max() < 0.03
    assert np.all(np.isfinite(record.theta))


def test_learns_a_plant_of_its_own_kind() -> None:
    true = pz.PrandtlIshlinskii(
        0.1, np.arange(1.0, 7.0) * 5.0, [0.01, 0.005, 0.008, 0.004, 0.003, 0.002], 0.7,
        creep=pz.Creep([0.03], [0.05]), sample_rate=RATE,
    )  # fmt: skip
    start = pz.PrandtlIshlinskii(
        0.12, true.thresholds, np.full(6, 0.004), creep=pz.Creep([0.01], [0.05]), sample_rate=RATE
    )
    u = sine(30.0, 40_000) * np.linspace(1.0, 0.3, 40_000)
    estimator = pz.PrandtlIshlinskiiRLS(RATE, initial_model=start)
    estimator.run(u, true.simulate(u) + 1e-3 * np.random.default_rng(0).standard_normal(u.size))
    np.testing.assert_array_equal(estimator.thresholds, true.thresholds)
    model: Any = estimator.model
    np.testing.assert_allclose(model.simulate(u)[-20_000:], true.simulate(u)[-20_000:], atol=5e-3)
    assert model.gain == pytest.approx(true.gain, rel=0.02)
    assert model.creep.gains[0] == pytest.approx(0.03, rel=0.2)


def test_only_what_moves_may_change() -> None:
    u, stage = sine(30.0, 10_000), pz.PaperStage(RATE)
    estimator = pz.PrandtlIshlinskiiRLS(RATE, voltage_range=(-30.0, 30.0))
    estimator.run(u, stage.run(u))
    before, deviations = estimator.theta[:-3], estimator.standard_errors[:-3]
    # What had begun to move is finished within the first of the dwell, by less than it is known to.
    rest = np.full(20_000, u[-1])
    x = stage.run(rest) + np.linspace(0.0, 0.5, rest.size)
    estimator.run(rest[:2000], x[:2000])
    slopes = estimator.theta[:-3]
    np.testing.assert_allclose(slopes, before, rtol=1e-2)
    # From then on a dwell moves no slope, whatever the sensor says.
    estimator.run(rest[2000:], x[2000:])
    np.testing.assert_allclose(estimator.theta[:-3], slopes, rtol=1e-6)
    # Small loops leave what is known of the large thresholds as known as it was.
    small = u[-1] + sine(3.0, 10_000, 20.0)
    estimator.run(small, stage.run(small))
    large = [i for i, name in enumerate(estimator.parameter_names[:-3]) if name.startswith("weights[9]")]
    assert np.all(estimator.standard_errors[large] <= 1.01 * deviations[large])


def test_grid_follows_the_voltage() -> None:
    estimator = pz.PrandtlIshlinskiiRLS(RATE)
    assert estimator.thresholds[-1] > 20.0
    for volts, within in ((3.0, 0.1), (60.0, 0.15)):
        u = sine(volts, 8000)
        estimator.run(u, pz.PaperStage(RATE).run(u))
        assert estimator.thresholds[-1] == pytest.approx(volts, rel=within)
    assert estimator.status.resets > 1
    assert estimator.model.is_admissible
