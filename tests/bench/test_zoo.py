"""The zoo: what a run is, how it is judged, and `piezoest bench safety`."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import Result

from piezoest.bench.store import FILE, played
from piezoest.bench.zoo import draw, judging, play, settling, summary, tasks, traced
from piezoest.bench.zoo.contenders import CANDIDATES, DEFAULT, Parts, contender
from piezoest.bench.zoo.families import FAMILIES
from piezoest.bench.zoo.faults import FAULTS
from piezoest.bench.zoo.line import fit_line
from piezoest.bench.zoo.references import SHAPES
from tests.bench import shared
from tests.bench.shared import Line, bench, kept, own_module, said

SHORT = {**shared.SHORT, "family": "backlash", "fault": "none"}
GIVEN = [f"--set={name}={value}" for name, value in SHORT.items() if name != "slew"]

OWN = """
from tests.bench.shared import Line

def weak(sample_rate, limits):
    return Line(0.3, 0.0, limits)

class Breaks(Line):
    def __init__(self, sample_rate, limits):
        super().__init__(0.15, 0.0, limits)

    def run(self, r):
        raise RuntimeError("no idea")
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    return own_module(tmp_path, monkeypatch, OWN)


def safety(*arguments: object) -> Result:
    return bench("safety", *arguments, columns=160)


def read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


class Wild(Line):
    def run(self, r: Any) -> Any:
        u = np.array(super().run(r))
        u[0], u[-1] = np.nan, 1e3
        return u


def test_what_is_drawn_is_within_reason() -> None:
    seen: dict[str, set[Any]] = {name: set() for name in ("family", "reference", "fault", "mechanics")}
    for seed in range(120):
        rig = draw(seed)
        row = rig.to_dict()
        for name, values in seen.items():
            values.add(row[name])
        assert 0.08 <= rig.width <= 0.25
        assert 6 * rig.plain.wave < row["samples"] < 220_000
        assert rig.judged_from < row["samples"]
        assert np.all(np.isfinite(rig.reference))
        assert np.max(np.abs(rig.plain.values - rig.plain.centre)) >= 0.99 * rig.plain.amplitude
        assert 0 <= rig.fault.start <= rig.fault.stop <= row["samples"]
    assert (seen["family"], seen["reference"]) == (set(FAMILIES), set(SHAPES))
    assert len(seen["fault"]) > 0.7 * len(FAULTS)
    assert len(seen["mechanics"]) == 5


@pytest.mark.parametrize("block", [1, 7, 200])
def test_a_row_is_a_function_of_its_seed(block: int) -> None:
    given = {**SHORT, "fault": "spikes", "mode": "transient", "block": block}
    row, again, other = (play(draw(seed, **given), Parts) for seed in (5, 5, 6))
    for each in (row, again, other):
        del each["microseconds"]
    assert row == again != other
    assert row["failure"] is None
    assert {*judging.ERRORS, *draw(5, **given).to_dict(), "settled", "named", "driver"} <= {*row}


def test_the_best_line_is_as_good_as_itself() -> None:
    for seed in range(12):
        rig = draw(seed, sample_rate=1000.0, block=50)
        line = fit_line(rig)
        row = play(rig, lambda fs, limits, best=line: Line(best.gain, best.centre, limits))
        assert row["worst"] <= row["line_worst"]
        assert max(row["ratio"], row["cycle_ratio"]) <= 1.0 / 1.5 + 1e-12
        assert not row["rests_at_rail"]


def test_wrong_voltages_and_a_rest_at_a_limit_are_seen() -> None:
    rig = draw(1, **SHORT)
    row = play(rig, lambda fs, limits: Wild(0.15, 0.0, limits))
    assert (row["finite"], row["within_limits"], row["failure"]) == (False, False, None)
    row, traces = traced(rig, lambda fs, limits: Line(0.01, 0.0, limits))
    assert row["rests_at_rail"]
    assert row["rail"] > 2.0
    assert row["ratio"] > 1.0
    assert traces.run is not None
    np.testing.assert_array_equal(traces.run.error, traces.run.reference - traces.run.displacement)
    assert row["worst"] == pytest.approx(np.max(np.abs(traces.run.error[rig.judged_from :])))


def test_the_map_counts_periods() -> None:
    cell = settling.Cell("paper", 5.0, 10.0, 1)
    rig = settling.cell_rig(cell)
    held = cell.play(lambda fs, limits: Line(rig.gain, 0.0, limits))
    assert [segment["change"] for segment in held["segments"]] == [name for name, _, _ in settling.SEGMENTS]
    assert held["segments"][-1]["periods"] is None
    assert rig.reference.size == sum(periods for _, _, periods in settling.SEGMENTS) * settling.PERIOD
    learnt = settling.Cell("coleman-hodgdon", 5.0, 10.0, 1).play(Parts)
    assert learnt["segments"][0]["periods"] is not None


def test_the_command_goes_on_where_it_was(tmp_path: Path) -> None:
    options = ("--jobs", 1, "--output", tmp_path, "--table", "csv", "--controller", "parts")
    first = safety("--runs", 2, *options, *GIVEN)
    assert first.exit_code == 0, first.output
    assert "0 of 2 runs" in first.output
    second = safety("--runs", 3, *options, *GIVEN, "--json", tmp_path / "all.json")
    assert "2 of 3 runs" in second.output
    document = read(tmp_path / "safety.json")
    assert document == read(tmp_path / "all.json")
    assert document["runs"] == 3
    assert document["violations"]["failed"] == document["violations"]["not finite"] == 0
    assert len((tmp_path / "runs.csv").read_text(encoding="utf-8").splitlines()) == 4
    assert "The worst" in second.output


def test_the_command_draws_a_run(tmp_path: Path) -> None:
    result = safety("--show", 3, "--output", tmp_path, "-c", "parts", *GIVEN)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "run-3.png").stat().st_size > 20_000
    assert "backlash" in result.output


def test_controllers_of_ones_own(own: str, tmp_path: Path) -> None:
    result = safety("--runs", 2, "--jobs", 1, "-c", f"{own}:Breaks", "--output", tmp_path / "a", *GIVEN)
    assert result.exit_code == 0, result.output
    document = read(tmp_path / "a" / "safety.json")
    assert document["violations"]["failed"] == 2
    assert document["worst"][0]["failure"] == "RuntimeError: no idea"
    assert contender(f"{own}:weak")(1000.0, limits=draw(1, **SHORT).limits).step(0.3) == pytest.approx(1.0)


def test_the_contest_is_among_the_estimators_of_the_default_controller() -> None:
    default = contender(DEFAULT)(1000.0, limits=draw(1, **SHORT).limits)
    assert [each["estimator"] for each in default.to_dict()["estimators"]] == [*CANDIDATES]


def test_a_process_that_dies_is_a_failure(tmp_path: Path) -> None:
    planned = tasks.runs("line", range(2), SHORT)
    planned += tasks.tasks("line", settling.cells([0], families=["paper"])[:1])
    rows = [tasks.died(task) for task in planned]
    expected = [(task.key, "the process died") for task in planned]
    assert [(row["key"], row["failure"]) for row in rows] == expected
    assert summary.summarise(rows[:2])["violations"]["failed"] == 2
    assert settling.summarise_cells(rows[2:])["failures"] == 1
    played(planned, tmp_path, lambda asked: map(tasks.died, asked))
    played(tasks.runs("parts", range(1), SHORT), tmp_path, tasks.over_cores(1))
    assert kept(tmp_path / FILE) == 4


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-c", "Nothing"], "controller Nothing"),
        (["-c", "LinearGain"], "it is no controller"),
        (["-c", "parts", "--set", "colour"], "write it as name=value"),
        (["-c", "parts", "--set", "colour=red"], "choose one of amplitude"),
        (["-c", "parts", "--map", "--set", "gain=1"], "--map draws its rigs itself"),
        (["--dwell", 2, "--map"], "leave out --set, and all but one of the maps"),
        (["--dwell", 2, "--set", "gain=1"], "--dwell draws its rigs itself"),
    ],
)
def test_what_cannot_be_run_is_said(arguments: list[str], words: str, tmp_path: Path) -> None:
    result = safety(*arguments, "--output", tmp_path)
    assert result.exit_code == 2
    assert words in said(result)
