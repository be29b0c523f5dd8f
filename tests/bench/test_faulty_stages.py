"""Faults do what they say, and what each does to a loop stays within bounds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.zoo import faulty_stages as faults

FS = 5000.0
START = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
LIMITS = pz.VoltageLimits(-100.0, 100.0)
Make = Callable[[Any], faults.FaultyStage]

# Faults, and whether a loop is right again when they are over.
FAULTS: dict[str, tuple[Make, bool]] = {
    "missing": (lambda stage: faults.Missing(stage, 0.5, seed=2), True),
    "gap": (lambda stage: faults.Gap(stage, 1.0, 0.4), True),
    "stuck": (lambda stage: faults.Stuck(stage, 1.0, 0.4), True),
    "spikes": (lambda stage: faults.Spikes(stage, 5.0, 10.0, seed=2), True),
    "offset": (lambda stage: faults.OffsetStep(stage, 1.0, 0.5), False),
    "saturation": (lambda stage: faults.Saturation(stage, 4.0), False),
    "unit": (lambda stage: faults.Factor(stage, 1000.0), False),
    "sign": (lambda stage: faults.Factor(stage, -1.0), False),
}
EVERY = pytest.mark.parametrize("name", FAULTS)


def sound() -> pz.PaperStage:
    return pz.PaperStage(FS, seed=1)


def voltage(periods: int = 10) -> Any:
    return pz.signals.triangle(35.0, 5.0, periods, FS).values


@EVERY
def test_step_and_run_are_the_same_to_the_bit(name: str) -> None:
    make, _ = FAULTS[name]
    u = voltage()
    whole = make(sound())
    x = whole.run(u)
    pieces = make(sound())
    parts: list[Any] = [
        pieces.run(u[:123]),
        pieces.run(u[123:5500]),
        [pieces.step(float(v)) for v in u[5500:]],
    ]
    np.testing.assert_array_equal(np.concatenate(parts), x)
    whole.reset()
    np.testing.assert_array_equal(whole.run(u), x)


def test_each_fault_is_what_its_name_says() -> None:
    clean = sound().run(voltage())
    found = {name: make(sound()).run(voltage()) for name, (make, _) in FAULTS.items()}
    during = np.arange(clean.size) // 1000 == 5  # the second fifth of a second from 1 s on
    assert np.mean(np.isnan(found["missing"])) == pytest.approx(0.5, abs=0.05)
    assert np.array_equal(np.flatnonzero(np.isnan(found["gap"])), np.arange(5000, 7000))
    assert np.ptp(found["stuck"][during]) == 0.0
    spikes = np.abs(found["spikes"] - clean)
    assert np.all((spikes == 0.0) | np.isclose(spikes, 10.0))
    assert 5 <= np.count_nonzero(spikes) <= 20
    np.testing.assert_allclose((found["offset"] - clean)[5000:], 0.5)
    np.testing.assert_array_equal(found["saturation"], np.clip(clean, -4.0, 4.0))
    np.testing.assert_array_equal(found["unit"], 1000.0 * clean)
    np.testing.assert_array_equal(found["sign"], -clean)


@pytest.mark.parametrize("estimator", [pz.HysteresisRLS, pz.OutputErrorRLS, pz.PrandtlIshlinskiiRLS])
@EVERY
def test_a_loop_stays_within_bounds_and_recovers(name: str, estimator: Any) -> None:
    make, recovers = FAULTS[name]
    learner = estimator(FS)
    record = pz.track(
        pz.signals.triangle(5.0, 5.0, 15, FS),
        stage=make(sound()),
        compensator=pz.InverseCompensator(START, LIMITS, transfer_samples=50),
        estimator=learner,
        update_interval=20,
    )
    assert np.all(np.isfinite(record.theta))
    assert np.all(np.isfinite(learner.P))
    assert learner.model.is_admissible
    assert np.max(np.abs(record.voltage)) <= 100.0
    if recovers:
        assert record.max_error(last_periods=3) < 0.012 * 5.0
