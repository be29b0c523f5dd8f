"""The benchmark of estimators: what it measures, prints and refuses. No time is asserted."""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import piezoest as pz
from piezoest.bench import estimators as bench
from piezoest.cli import app
from piezoest.demo import AMPLITUDE
from piezoest.estimators.base import EstimatorBase

OWN = """
import piezoest as pz

class Still:
    def __init__(self, sample_rate, initial_model=None):
        self.model = initial_model

    model = None

    def step(self, u, x):
        pass

class Broken(Still):
    def step(self, u, x):
        raise RuntimeError("no idea")

class Speechless:
    pass
"""


def run(*arguments: object) -> Result:
    words = ["bench", "estimators", *(str(argument) for argument in arguments)]
    return CliRunner().invoke(app, words, env={"COLUMNS": "120"})


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "own_estimators_of_the_bench.py").write_text(OWN, encoding="utf-8")
    return "own_estimators_of_the_bench"


def test_finds_every_estimator() -> None:
    found = bench.find_estimators()
    assert {"HysteresisRLS", "HysteresisEKF", "FilterPyEKF", "FilterPyUKF"} <= set(found)
    for name, cls in found.items():
        assert issubclass(cls, EstimatorBase)
        assert getattr(pz, name) is cls
        made = bench.make(cls, 1000.0)
        assert made.sample_rate == 1000.0
        assert not np.allclose(made.model.theta, cls(1000.0).model.theta), f"{name} ignores the wrong start"
    assert set(bench.OPTIONS) <= {"BatchFit", *found}
    for name, options in bench.OPTIONS.items():
        if name in found:
            assert set(options) <= set(inspect.signature(found[name]).parameters)


def test_adaptive_estimators_settle_and_linear_feed_forward_does_not() -> None:
    said: list[str] = []
    found = {name: getattr(pz, name) for name in ("HysteresisRLS", "HysteresisEKF")}
    rows = bench.compare(found, bench.Scenario(seconds=2.0, sample_rate=10_000.0), said.append)
    assert [row.name for row in rows] == ["linear feed-forward", *found]
    assert len(said) == 2 * len(rows)
    linear, *adaptive = rows
    assert linear.settling_time is None
    assert linear.settled_error is not None
    assert linear.settled_error > 0.05 * AMPLITUDE
    for row in adaptive:
        assert row.failure is None
        assert row.settled_error is not None
        assert row.settled_error < 0.1 * linear.settled_error
        assert row.settling_periods is not None
        assert 0 < row.settling_periods <= 5
        assert row.settling_time == pytest.approx(0.2 * row.settling_periods)
        assert all(error < 0.012 * AMPLITUDE for error in row.errors[row.settling_periods :])
        assert row.errors[row.settling_periods - 1] >= 0.012 * AMPLITUDE
        assert set(row.parameters) == {"alpha", "beta", "gamma"}
        assert row.run_microseconds is not None
        assert row.step_microseconds is not None
        assert row.longest_step_microseconds is not None
        assert row.memory_bytes is not None
        assert 500 < row.memory_bytes < 10_000


def test_settling_counts_the_periods_that_were_needed() -> None:
    N = 100

    def record(errors: list[float]) -> pz.TrackingRecord:
        r = np.repeat(errors, N)
        nothing = np.zeros(r.size)
        return pz.TrackingRecord(r, nothing, nothing, nothing, np.ones((r.size, 1)), ("gain",), 500.0, N)

    for errors, periods in (
        ([0.01, 0.01], 0),
        ([1.0, 0.01, 0.01], 1),
        ([0.01, 1.0, 0.01], 2),
        ([1.0, 0.01, 1.0], None),
        ([1.0, 0.01, np.nan], None),
    ):
        found = bench.accuracy(record(errors))
        assert found["settling_periods"] == periods
        assert found["parameters"] == {"gain": 1.0}


def test_the_same_seed_gives_the_same_errors() -> None:
    found = {"HysteresisEKF": pz.HysteresisEKF}
    scenario = bench.Scenario(seconds=0.4, sample_rate=5000.0, seed=3)
    first, second = (bench.compare(found, scenario)[1] for _ in range(2))
    assert (first.errors, first.parameters) == (second.errors, second.parameters)


def test_command_prints_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = run("--only", "HysteresisRLS", "--seconds", 0.4, "--sample-rate", 5000, "--json", "rows.json")
    assert result.exit_code == 0
    for word in ("linear feed-forward", "HysteresisRLS", "all at 5000 Hz", "never", "alpha", "cores"):
        assert word in result.stdout
    assert "HysteresisEKF" not in result.stdout
    assert "HysteresisRLS: in the ring" in result.stderr
    assert "rows" in json.loads(Path("rows.json").read_text(encoding="utf-8"))


def test_json_says_where_the_numbers_come_from() -> None:
    result = run(
        "--only", "HysteresisEKF", "--seconds", 0.4, "--sample-rate", 5000, "--seed", 7, "--json", "-"
    )
    assert result.exit_code == 0

    def refuse(constant: str) -> Any:
        raise AssertionError(f"{constant} is not JSON")

    document = json.loads(result.stdout, parse_constant=refuse)
    assert document["suite"] == "estimators"
    assert document["versions"]["piezoest"] == pz.__version__
    assert {"numpy", "numba", "casadi", "filterpy"} <= set(document["versions"])
    assert {"cpu", "cores", "platform", "python"} <= set(document["machine"])
    assert document["date"].endswith("+00:00")
    assert document["scenario"]["seed"] == 7
    assert document["scenario"]["sample_rate"] == 5000.0
    assert [row["name"] for row in document["rows"]] == ["linear feed-forward", "HysteresisEKF"]


def test_an_estimator_of_ones_own(own: str) -> None:
    short = ("--only", "HysteresisRLS", "--seconds", 0.4, "--sample-rate", 5000, "--json", "-")
    result = run(f"{own}:Still", f"{own}:Broken", *short)
    assert result.exit_code == 0
    rows = {row["name"]: row for row in json.loads(result.stdout)["rows"]}
    still, broken = rows[f"{own}:Still"], rows[f"{own}:Broken"]
    assert still["failure"] is None
    assert still["run_microseconds"] is None
    assert still["step_microseconds"] > 0.0
    assert still["settling_time"] is None
    assert broken["failure"] == "RuntimeError: no idea"
    assert broken["settled_error"] is None
    # And in the table.
    table = run(f"{own}:Broken", *short[:-2])
    assert table.exit_code == 0
    assert "failed" in table.stdout
    assert "no idea" in table.stdout


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("nonsense", "module:Class"),
        ("no_such_module:Thing", "No module named"),
        ("json:Nothing", "has no class Nothing"),
        ("{own}:Speechless", "has no step and no model"),
    ],
)
def test_refuses_what_is_no_estimator(own: str, path: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        bench.load_estimator(path.format(own=own))
    result = run(path.format(own=own))
    assert result.exit_code == 2
    assert result.stdout == ""


def test_refuses_wrong_options(tmp_path: Path) -> None:
    for arguments in (
        ("--only", "NoSuch"),
        ("--seconds", 0.1),
        ("--sample-rate", 10),
        ("--json", tmp_path),
        ("--json", tmp_path / "nowhere" / "rows.json"),
    ):
        assert run(*arguments).exit_code == 2, arguments
    with pytest.raises(ValueError, match="seconds must be at least"):
        bench.Scenario(seconds=0.1)
