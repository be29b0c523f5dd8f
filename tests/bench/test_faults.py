"""Faults do what they say; and what each does to a ring stays within bounds."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench import faulty_stages as faults
from piezoest.bench.faults import FAULTS

FS = 10_000.0
START = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
LIMITS = pz.VoltageLimits(-100.0, 100.0)


def sound(sample_rate: float = FS) -> pz.PaperStage:
    return pz.PaperStage(sample_rate, seed=1)


@functools.cache
def voltage() -> np.ndarray[Any, np.dtype[np.float64]]:
    """Three seconds."""
    return np.asarray(pz.signals.triangle(35.0, 5.0, 15, FS))


@functools.cache
def reading() -> np.ndarray[Any, np.dtype[np.float64]]:
    return sound().run(voltage())


@pytest.mark.parametrize("name", FAULTS)
def test_step_and_run_are_the_same_to_the_bit(name: str) -> None:
    u = voltage()[: 2 * 2000 + 7]
    whole = FAULTS[name].build(sound, FS, seed=2)
    x = whole.run(u)
    assert x.shape == u.shape
    assert whole.sample_rate == FS
    pieces = FAULTS[name].build(sound, FS, seed=2)
    parts = [pieces.run(u[:123]), pieces.run(u[123:2500])]
    steps, true = [], []
    for value in u[2500:].tolist():
        steps.append(pieces.step(value))
        true.append(pieces.displacement)
    np.testing.assert_array_equal(np.concatenate([*parts, steps]), x)
    np.testing.assert_array_equal(true, whole.displacement[2500:])
    whole.reset()
    np.testing.assert_array_equal(whole.run(u), x)


def read(name: str, seed: int = 0) -> np.ndarray[Any, np.dtype[np.float64]]:
    stage = FAULTS[name].build(sound, FS, seed=seed)
    return np.asarray(stage.run(voltage()))


def test_missing_samples() -> None:
    for name, part in (("missing-1", 0.01), ("missing-50", 0.5)):
        x = read(name)
        lost = np.isnan(x)
        assert np.mean(lost) == pytest.approx(part, rel=0.15)
        np.testing.assert_array_equal(x[~lost], reading()[~lost])
        assert np.any(np.isnan(read(name, seed=1)) != lost)


def test_gap() -> None:
    assert np.flatnonzero(np.isnan(read("gap"))).tolist() == list(range(10_000, 20_000))


def test_spikes() -> None:
    off = read("spikes") - reading()
    hit = off[off != 0.0]
    assert 5 <= hit.size <= 30
    np.testing.assert_allclose(np.abs(hit), 10.0)
    assert np.any(hit > 0.0)
    assert np.any(hit < 0.0)


def test_stuck() -> None:
    x = read("stuck")
    assert np.all(x[10_000:20_000] == reading()[10_000])
    np.testing.assert_array_equal(
        np.delete(x, np.s_[10_000:20_000]), np.delete(reading(), np.s_[10_000:20_000])
    )


def test_readings_out_of_range_and_wrong_factors() -> None:
    assert np.max(np.abs(reading())) > 4.0
    np.testing.assert_array_equal(read("adc-saturation"), np.clip(reading(), -4.0, 4.0))
    np.testing.assert_array_equal(read("gauge-sign"), -reading())
    np.testing.assert_array_equal(read("wrong-unit"), 1000.0 * reading())


def test_offset_step() -> None:
    off = read("offset-step") - reading()
    assert np.all(off[:10_000] == 0.0)
    np.testing.assert_allclose(off[10_000:], 0.5)


def test_amplifiers() -> None:
    np.testing.assert_array_equal(read("voltage-saturation"), sound().run(np.clip(voltage(), -25.0, 25.0)))
    np.testing.assert_array_equal(read("voltage-sign"), sound().run(-voltage()))


def test_reference_out_of_range() -> None:
    r = pz.signals.triangle(5.0, 5.0, 2, FS)
    fault = FAULTS["out-of-range"]
    np.testing.assert_array_equal(fault.reference(r).values, 4.0 * r.values)
    assert fault.reference(r).period == r.period
    np.testing.assert_array_equal(read("out-of-range"), reading())
    assert FAULTS["gap"].reference(r) is r


def test_only_a_gauge_that_moved_carries_the_stage_along() -> None:
    assert {name for name, fault in FAULTS.items() if fault.carried} == {"offset-step"}
    assert {name for name, fault in FAULTS.items() if not fault.recovers} == {
        "adc-saturation", "gauge-sign", "voltage-sign", "wrong-unit", "voltage-saturation", "out-of-range",
    }  # fmt: skip


def test_wrong_rate() -> None:
    x = read("wrong-rate")
    np.testing.assert_array_equal(x, sound(FS / 1.1).run(voltage()))
    assert faults.WrongRate(sound(), 1.1).sample_rate == pytest.approx(1.1 * FS)


@pytest.mark.parametrize(
    ("kind", "arguments", "words"),
    [
        (faults.Missing, {"share": 1.5}, "share"),
        (faults.Gap, {"start": -1.0}, "start"),
        (faults.Saturation, {"limit": 0.0}, "limit"),
        (faults.WrongRate, {"factor": 0.0}, "factor"),
        (faults.FaultyStage, {"seed": -1}, "seed"),
    ],
)
def test_refuses_what_makes_no_sense(kind: Any, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        kind(sound(), **arguments)


def ring(name: str, estimator: type, *, guard: bool = False) -> tuple[pz.TrackingRecord, Any]:
    fault = FAULTS[name]
    learner = estimator(FS)
    record = pz.track(
        fault.reference(pz.signals.triangle(5.0, 5.0, 15, FS)),
        stage=fault.build(sound, FS, seed=3),
        compensator=pz.InverseCompensator(START, LIMITS, transfer_samples=100, sample_rate=FS),
        estimator=learner,
        update_interval=20,
        supervisor=pz.Supervisor(FS) if guard else None,
    )
    return record, learner


ESTIMATORS = [pz.HysteresisRLS, pz.HysteresisEKF, pz.PrandtlIshlinskiiRLS]


@pytest.mark.parametrize("guard", [False, True])
@pytest.mark.parametrize("estimator", [*ESTIMATORS, pz.OutputErrorRLS])
@pytest.mark.parametrize("name", FAULTS)
def test_the_ring_stays_within_bounds(name: str, estimator: type, guard: bool) -> None:
    record, learner = ring(name, estimator, guard=guard)
    assert np.all(np.isfinite(record.theta))
    assert np.all(np.isfinite(learner.theta))
    assert np.all(np.isfinite(learner.P))
    assert learner.model.is_admissible
    assert np.max(np.abs(record.voltage)) <= 100.0
    assert np.all(np.isfinite(record.displacement))


@pytest.mark.parametrize(
    ("name", "estimator"),
    [
        (name, estimator)
        for estimator in (pz.HysteresisRLS, pz.PrandtlIshlinskiiRLS, pz.OutputErrorRLS)
        for name, fault in FAULTS.items()
        if fault.recovers
    ]
    + [(name, pz.HysteresisEKF) for name in ("missing-1", "missing-50", "gap", "wrong-rate")],
)
def test_what_can_recover_recovers(name: str, estimator: type) -> None:
    record, _ = ring(name, estimator)
    error = record.error[-3 * 2000 :]
    assert np.max(np.abs(error - FAULTS[name].carried)) < 0.012 * 5.0


@pytest.mark.parametrize("estimator", [pz.HysteresisRLS, pz.PrandtlIshlinskiiRLS])
def test_a_dead_sensor_does_not_mislead(estimator: type) -> None:
    """For a second the reading does not change: the model stays what it was."""
    record, _ = ring("stuck", estimator)
    assert record.max_error_per_period()[5:].max() < 0.55


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("name", ["stuck", "adc-saturation", "spikes"])
def test_with_the_guard_no_worse_than_a_line(name: str, estimator: type) -> None:
    record, _ = ring(name, estimator, guard=True)
    assert record.max_error_per_period()[3:].max() < 1.5 * 0.55


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("name", ["gauge-sign", "voltage-sign"])
def test_the_guard_turns_no_gain_round(name: str, estimator: type) -> None:
    """It cannot know which wire is wrong: the model in use stays, and the voltage off its limits."""
    record, _ = ring(name, estimator, guard=True)
    assert np.max(np.abs(record.voltage)) < 50.0
    assert record.parameters[:, 0].min() > 0.0
