"""PrandtlIshlinskiiRLS: what it learns, what it leaves alone, in the ring and on a recording."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz

RATE = 10_000.0
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)


def ring(stage: Any, reference: pz.Signal, **options: Any) -> pz.TrackingRecord:
    return pz.track(
        reference,
        stage=stage,
        compensator=pz.InverseCompensator(START, transfer_samples=100),
        estimator=pz.PrandtlIshlinskiiRLS(RATE, **options),
        update_interval=10,
    )


@pytest.mark.parametrize("stage", [pz.PaperStage, pz.PreisachStage])
@pytest.mark.slow_but_first
def test_minor_loops_in_the_ring(stage: Any) -> None:
    reference = pz.signals.two_tone([3.5, 1.5], [2.0, 7.0], 4.0, RATE)
    record = ring(stage(RATE), reference)
    error = np.abs(record.error)
    assert error[-10_000:].max() < 0.03
    assert np.all(np.isfinite(record.theta))


def test_learns_a_plant_of_its_own_kind() -> None:
    true = pz.PrandtlIshlinskii(
        0.1, np.arange(1.0, 7.0) * 5.0, [0.01, 0.005, 0.008, 0.004, 0.003, 0.002], 0.7,
        creep=pz.Creep([0.03], [0.05]), sample_rate=RATE,
    )  # fmt: skip
    start = pz.PrandtlIshlinskii(
        0.12, true.thresholds, np.full(6, 0.004), creep=pz.Creep([0.01], [0.05]), sample_rate=RATE
    )
    rng = np.random.default_rng(0)
    u = 30.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(40_000) / RATE) * np.linspace(1.0, 0.3, 40_000)
    x = true.simulate(u) + 1e-3 * rng.standard_normal(u.size)
    estimator = pz.PrandtlIshlinskiiRLS(RATE, initial_model=start)
    estimator.run(u, x)
    np.testing.assert_array_equal(estimator.thresholds, true.thresholds)
    model: Any = estimator.model
    np.testing.assert_allclose(model.simulate(u)[-20_000:], true.simulate(u)[-20_000:], atol=5e-3)
    assert model.gain == pytest.approx(true.gain, rel=0.02)
    assert model.creep.gains[0] == pytest.approx(0.03, rel=0.2)


def test_only_what_moves_may_change() -> None:
    u = 30.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(10_000) / RATE)
    stage = pz.PaperStage(RATE)
    estimator = pz.PrandtlIshlinskiiRLS(RATE, voltage_range=(-30.0, 30.0))
    estimator.run(u, stage.run(u))
    deviations = estimator.standard_errors[:-3]
    # What had begun to move is finished within the first of the dwell, by less than it is known to.
    before = estimator.theta[:-3]
    rest = np.full(20_000, u[-1])
    x = stage.run(rest) + np.linspace(0.0, 0.5, rest.size)
    estimator.run(rest[:2000], x[:2000])
    slopes = estimator.theta[:-3]
    np.testing.assert_allclose(slopes, before, rtol=1e-2)
    # From then on a dwell moves no slope, whatever the sensor says.
    estimator.run(rest[2000:], x[2000:])
    np.testing.assert_allclose(estimator.theta[:-3], slopes, rtol=1e-6)
    # Small loops leave what is known of the large thresholds as known as it was.
    small = u[-1] + 3.0 * np.sin(2.0 * np.pi * 20.0 * np.arange(10_000) / RATE)
    estimator.run(small, stage.run(small))
    large = [i for i, name in enumerate(estimator.parameter_names[:-3]) if name.startswith("weights[9]")]
    assert np.all(estimator.standard_errors[large] <= 1.01 * deviations[large])


def test_grid_follows_the_voltage() -> None:
    estimator = pz.PrandtlIshlinskiiRLS(RATE)
    first = estimator.thresholds[-1]
    small = 3.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(8000) / RATE)
    estimator.run(small, pz.PaperStage(RATE).run(small))
    assert first > 20.0
    assert estimator.thresholds[-1] == pytest.approx(3.0, rel=0.1)
    large = 60.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(8000) / RATE)
    estimator.run(large, pz.PaperStage(RATE).run(large))
    assert estimator.thresholds[-1] == pytest.approx(60.0, rel=0.15)
    assert estimator.status.resets > 1
    assert estimator.model.is_admissible


def test_a_piezo_recorded(data_dir: Path) -> None:
    record = pz.read_record(data_dir / "discrete_backlash_operator" / "test_1hz.csv")
    u, x, rate = record.voltage, record.displacement, record.sample_rate
    late = np.concatenate([u[:1], u[:-1]])
    half = u.size // 2
    estimator = pz.PrandtlIshlinskiiRLS(rate, initial_model=pz.ColemanHodgdon(0.5, 8.0, 6.0), delay=1.0)
    estimator.run(u[:half], x[:half])
    model: Any = estimator.model
    error = (x - model.simulate(late))[half:]
    assert np.sqrt(np.mean(error**2)) < 0.28
