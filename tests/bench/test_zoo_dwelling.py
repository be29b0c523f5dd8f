"""Whether a controller goes on after a long rest as it did before."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest.bench.zoo import dwelling, tasks
from piezoest.bench.zoo.dwelling import BEFORE, SHAPES, Dwell, dwell_rig, dwells, summarise_dwells
from piezoest.bench.zoo.line import fit_line
from tests.bench.shared import Line, bench


def line(dwell: Dwell, jump: float = 0.0) -> Any:
    """A line in hindsight, which may forget where it was when the reference rests."""
    rig, rest, _ = dwell_rig(dwell)
    fitted = fit_line(rig)

    class Forgetful(Line):
        seen = 0

        def run(self, r: Any) -> Any:
            self.seen += r.size
            return super().run(r) + (jump if self.seen > rest.start + 2 * rig.block else 0.0)

    return lambda sample_rate, limits, feedback=0.0: Forgetful(fitted.gain, fitted.centre, limits)


@pytest.mark.parametrize("seed", range(8))
def test_it_rests_where_the_wave_is(seed: int) -> None:
    rig, rest, drawn = dwell_rig(Dwell(seed, True, 2.0))
    r, cycle = rig.reference, rig.plain.cycle
    assert rest.stop - rest.start == round(2.0 * rig.sample_rate)
    assert np.abs(r[rest] - r[rest.start - 1]).max() <= 6.0 * drawn["setpoint_noise"]
    # Without the rest the wave goes on, and each period but the first is like the one before.
    whole = np.concatenate((r[: rest.start], r[rest.stop :]))[rig.plain.begins :]
    np.testing.assert_allclose(whole[2 * cycle :], whole[cycle:-cycle], atol=1e-9 * abs(r).max())
    assert whole.size - (rest.start - rig.plain.begins) >= 3 * cycle
    assert rest.start - rig.plain.begins >= BEFORE * cycle
    assert rig.plain.kind in SHAPES
    assert drawn["feedback"] > 0.0
    assert dwell_rig(Dwell(seed, False, 2.0))[2]["feedback"] == 0.0


def test_a_line_goes_on_as_before_and_a_jump_is_seen() -> None:
    dwell = next(each for each in dwells(range(40), 1.0) if dwell_rig(each)[0].block > 1)
    rig, _, _ = dwell_rig(dwell)
    row = dwell.play(line(dwell))
    assert row["failure"] is None
    assert row["kept"]
    assert row["excursion"] < 0.05
    far = dwell.play(line(dwell, 0.2 * rig.reach.half))
    assert not far["kept"]
    assert far["excursion"] > row["excursion"]
    found = summarise_dwells([row, {**far, "seed": -1}, {**row, "failure": "ValueError: no"}])
    assert (found["runs"], found["failures"], found["kept"], found["rigs"]) == (3, 1, 1, 2)
    (group,) = found["groups"]
    assert (group["runs"], group["kept"], group["feedback"]) == (3, 1, False)
    assert group["largest"] == far["first"] / far["allowed"]
    assert [each["seed"] for each in found["worst"]] == [-1]


def test_what_breaks_is_a_row() -> None:
    (task,) = tasks.tasks("parts", [Dwell(3, True, 1.0)])
    row, died = tasks.carry_out(task), tasks.died(task)
    assert "unexpected keyword argument 'feedback'" in row["failure"]
    assert died["failure"] == "the process died"
    found = summarise_dwells([row, died])
    assert found["failures"] == 2
    assert found["groups"][0]["first"] is None


def test_the_command_plays_it(tmp_path: Path) -> None:
    """By a controller that takes no feedback, so half of the runs fail."""
    words = ["safety", "--dwell", 1, "-c", "parts", "--jobs", 1, "--table", "csv", "--output", tmp_path]
    result = bench(*words, columns=160)
    assert result.exit_code == 0, result.output
    assert "After a rest of 60 s" in result.output
    document = json.loads((tmp_path / "dwell.json").read_text(encoding="utf-8"))
    assert (document["runs"], document["failures"]) == (2, 1)
    heads = (tmp_path / "dwell.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert heads[:3] == ["key", "controller", "seed"]
    assert {"duration", "setpoint_noise", "feedback", "failure", *dwelling.PERIODS, "kept"} <= {*heads}
