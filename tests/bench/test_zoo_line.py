"""The line that a user could have had: it is learnt leg by leg, from true readings alone, and held else."""

from typing import Any

import numpy as np
import pytest

from piezoest._checks import FloatArray
from piezoest.bench.zoo import play
from piezoest.bench.zoo.faults import truthful
from piezoest.bench.zoo.line import fit_line, run_learnt_line, run_line
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Traces
from tests.bench.shared import Line, rig_with


def learnt(rig: Rig) -> tuple[Traces, int]:
    return run_learnt_line(rig, fit_line(rig))


def bend(run: Traces, part: slice) -> float:
    """By how much the voltages of a part are off one straight line of the reference [V]."""
    r, u = run.reference[part], run.voltage[part]
    return float(np.max(np.abs(u - np.polyval(np.polyfit(r, u, 1), r))))


@pytest.mark.parametrize("given", [{}, {"block": 1}, {"delay": 5, "block": 1}, {"limits": "0..150"}])
def test_it_becomes_about_as_good_as_in_hindsight(given: dict[str, Any]) -> None:
    rig = rig_with(**{"amplitude": 5.0, **given})
    run, knows = learnt(rig)
    best = np.abs(run_line(rig, fit_line(rig)).error[-100:]).max()
    assert np.abs(run.error[-100:]).max() < 1.15 * best
    assert knows == rig.block
    np.testing.assert_array_equal(run.voltage[:knows], rig.limits.rest)
    assert np.ptp(run.voltage[: knows + 20]) > 0.0


def test_it_knows_nothing_of_what_is_still_to_come() -> None:
    for kind in ("gain-step", "sensor-constant", "zero-off"):
        rig = rig_with(kind, "permanent")
        before = rig.fault.start
        np.testing.assert_array_equal(learnt(rig)[0].voltage[:before], learnt(rig_with())[0].voltage[:before])


@pytest.mark.parametrize("kind", ["sensor-constant", "sensor-noise", "stage-stuck", "gap", "sensor-factor"])
def test_it_is_held_while_nothing_true_is_read(kind: str) -> None:
    rig = rig_with(kind, "permanent")
    run = learnt(rig)[0]
    # The legs before the fault are still learnt from, half of one at least.
    held = slice(rig.fault.start + 3 * rig.plain.cycle // 2, None)
    assert bend(run, held) < 1e-9
    assert bend(run, slice(rig.fault.start - 300, rig.fault.start)) > 1e-3


@pytest.mark.parametrize("kind", ["sensor-constant", "sensor-noise", "gap"])
def test_without_a_true_reading_it_rests(kind: str) -> None:
    rig = rig_with(kind, "from-start", limits="0..150")
    run, knows = learnt(rig)
    assert knows == run.voltage.size
    np.testing.assert_array_equal(run.voltage, 0.0)
    # Nobody knows where to go: resting at a limit is no offence, and all of such a run is judged.
    row = play(rig, lambda fs, limits: Line(1e9, 0.0, limits))
    assert not row["rests_at_rail"]
    assert row["ratio"] == pytest.approx(1.0 / 1.5, rel=1e-3)


def test_single_wrong_readings_are_left_out() -> None:
    spikes, sound = (
        learnt(rig_with(kind, mode))[0] for kind, mode in (("spikes", "from-start"), ("none", None))
    )
    assert np.max(np.abs(spikes.voltage - sound.voltage)) < 0.5
    rig = rig_with("sensor-saturated", "from-start")
    x: FloatArray = np.array([1.0, np.nan, 6.0, 6.0])
    told = truthful(rig, 0, x, np.array([1.0, 2.0, 6.0, 8.0]), 0.1)
    assert told.tolist() == [True, False, True, False]
