"""Tables: settled waveforms and branches, exact against the model."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.records import read_record

LOOP = pz.ColemanHodgdon(0.02, 0.12, 0.0036, offset=0.3)
TRIANGLE = pz.signals.triangle(4.0, 5.0, 1, 5000.0)


@pytest.mark.parametrize(
    "model",
    [
        LOOP,
        pz.PrandtlIshlinskii(0.1, np.linspace(0.5, 30.0, 20), np.full(20, 2e-3)),
        pz.LinearGain(0.15, offset=0.2),
    ],
)
def test_settled_voltage_gives_the_reference(model: Any) -> None:
    made = pz.export.table(model, TRIANGLE)
    # From the start the loop closes within some periods, the last of which is the reference.
    x = model.simulate(np.concatenate([np.linspace(0.0, made.voltage[0], 200), np.tile(made.voltage, 8)]))
    np.testing.assert_allclose(x[-TRIANGLE.values.size :], made.reference, atol=1e-6)


def test_creep_is_that_at_the_rate_of_the_reference() -> None:
    creep = pz.Creep([0.3], [0.05])
    model = pz.PrandtlIshlinskii(
        0.1, [1.0, 5.0], [0.01, 0.02], creep=creep, sample_rate=2.0 * TRIANGLE.sample_rate
    )
    made = pz.export.table(model, TRIANGLE)
    x = model.simulate(np.tile(made.voltage, 40), sample_rate=TRIANGLE.sample_rate)
    np.testing.assert_allclose(x[-TRIANGLE.values.size :], made.reference, atol=1e-6)


def test_branches_run_between_turning_points_and_files_can_be_read_back(tmp_path: Path) -> None:
    made = pz.export.table(LOOP, TRIANGLE, points=65)
    assert [b.shape for b in made.branches] == [(65, 2)] * 2
    for x, u in np.concatenate(made.branches)[::16]:
        near = np.argsort(np.abs(made.reference - x))[:8]
        assert np.min(np.abs(made.voltage[near] - u)) < 0.2
    falling, rising = sorted(made.branches, key=lambda branch: branch[0, 0], reverse=True)
    np.testing.assert_allclose(falling[0], rising[-1], rtol=1e-6)
    # A loop: between its ends the falling branch needs less voltage than the rising one.
    assert falling[32, 1] < rising[32, 1] - 1.0
    waveform, branches = made.write(tmp_path / "new")
    record = read_record(waveform, columns={"displacement": "reference_um"})
    np.testing.assert_allclose(record.voltage, made.voltage, rtol=1e-8)
    assert branches.read_text().splitlines()[0] == "branch,displacement_um,voltage_V"


@pytest.mark.parametrize(
    ("r", "options", "words"),
    [
        (np.zeros(10), {}, "sample_rate"),
        (TRIANGLE, {"sample_rate": 1.0}, "sample_rate"),
        (pz.Signal(np.zeros(100), 100.0, 33.3), {}, "whole number"),
        (np.linspace(0.0, 5.0, 500), {"sample_rate": 500.0}, "jump"),
    ],
)
def test_wrong_references_are_refused(r: Any, options: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pz.export.table(LOOP, r, **options)
