"""The benchmark suite: what a run is, how runs are kept, resumed and summed up. No time is asserted."""

from __future__ import annotations

import dataclasses
import errno
import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import piezoest as pz
from piezoest.bench import campaign, recorded, suite, tables
from piezoest.bench.estimators import find_estimators
from piezoest.bench.executors import in_processes
from piezoest.bench.machine import fingerprint
from piezoest.bench.runner import COLUMNS, QUICK, Row, Settings, Task, code_of, crashed, play
from piezoest.bench.scenarios import SCENARIOS
from piezoest.bench.store import Store
from piezoest.cli import app
from piezoest.records import Record

SMALL = Settings(2000.0, before=1, after=3, after_long=2, rest=0.2, drift=0.4, updates=20)

OWN = """
import os

class Still:
    def __init__(self, sample_rate, initial_model, size=1.0):
        self.model = initial_model

    model = None

    def step(self, u, x):
        pass

class Broken(Still):
    def step(self, u, x):
        raise RuntimeError("no idea")

class Quits(Still):
    def step(self, u, x):
        raise SystemExit("enough")

class Dies(Still):
    def step(self, u, x):
        os._exit(3)
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    # Each test's own module: another one of the same name would stay loaded.
    name = f"own_estimators_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(OWN, encoding="utf-8")
    return name


def task(estimator: str = "HysteresisRLS", scenario: str = "cold-start", **settings: Any) -> Task:
    return Task(scenario, estimator, 3, dataclasses.replace(SMALL, **settings), code_of(estimator))


def without_time(row: Row) -> Row:
    return {name: value for name, value in row.items() if name != "microseconds"}


def bench(*arguments: object) -> Result:
    return CliRunner().invoke(
        app, ["bench", *(str(argument) for argument in arguments)], env={"COLUMNS": "120"}
    )


# ---------------------------------------------------------------- a run


def test_a_run_is_a_function_of_its_task() -> None:
    first, again = play(task()), play(task())
    assert without_time(first) == without_time(again)
    assert set(first) == {*COLUMNS, "errors"}
    assert first["failure"] is None
    assert first["key"] == task().key
    assert first["microseconds"] > 0.0
    assert first["period"] == pytest.approx(0.2)
    assert first["mean_error"] == pytest.approx(math.prod(first["errors"]) ** (1.0 / 3.0))
    assert first["worst_error"] >= max(first["errors"])
    json.dumps(first, allow_nan=False)


def test_keys_tell_runs_apart() -> None:
    others = [
        task(scenario="noise"),
        task("HysteresisEKF"),
        task(stage="preisach"),
        dataclasses.replace(task(), seed=4),
        dataclasses.replace(task(), code="another"),
    ]
    assert len({task().key, *(other.key for other in others)}) == 6


def test_an_estimators_own_file_is_part_of_its_code(own: str) -> None:
    before = code_of(f"{own}:Still")
    assert code_of("HysteresisRLS") == fingerprint() != before
    with Path(f"{own}.py").open("a", encoding="utf-8") as file:
        file.write("\n# changed\n")
    assert code_of(f"{own}:Still") != before


def test_linear_feed_forward_is_measured_by_itself() -> None:
    row = play(task("linear feed-forward"))
    assert row["ratio"] == row["run_ratio"] == 1.0
    assert row["microseconds"] is None
    assert play(task())["linear_settled_max"] == row["settled_max"]


def test_the_other_stage_is_another() -> None:
    assert play(task(stage="preisach"))["settled_max"] != play(task())["settled_max"]
    with pytest.raises(ValueError, match="stage must be one of paper, preisach"):
        Settings(stage="best")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="after_long"):
        Settings(after_long=0)


def test_long_periods_are_fewer() -> None:
    assert SMALL.conditions("cold-start")["after"] == 3
    assert SMALL.conditions("two-tone")["after"] == 2
    assert set(SMALL.conditions("prbs")) == {"sample_rate", "before", "after", "rest", "drift", "updates"}


@pytest.mark.parametrize(
    ("name", "failure"), [("Broken", "RuntimeError: no idea"), ("Quits", "SystemExit: enough")]
)
def test_what_an_estimator_raises_is_its_own_failure(own: str, name: str, failure: str) -> None:
    row = play(task(f"{own}:{name}"))
    assert row["failure"] == failure
    assert row["settled_max"] is None
    assert row["errors"] == []


# ---------------------------------------------------------------- tables


@pytest.mark.parametrize("format", tables.FORMATS)
def test_tables_are_tidy_and_read_back(tmp_path: Path, format: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow")
    rows = [play(task()), crashed(task("HysteresisEKF"))]
    paths = tables.write_tables(rows, tmp_path, format)
    assert [path.name for path in paths] == [f"runs.{format}", f"periods.{format}"]
    read = tables.read_runs(tmp_path)
    assert read == [{name: row[name] for name in COLUMNS} for row in rows]
    assert read[1]["failure"] == "the process died"
    if format == "csv":
        lines = paths[1].read_text(encoding="utf-8").splitlines()
        assert lines[0] == "key,scenario,stage,estimator,seed,period,error"
        assert len(lines) == 1 + 3


def test_tables_refuse_other_formats(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="parquet, csv"):
        tables.checked_format("xlsx")
    with pytest.raises(ValueError, match=r"holds no runs\.parquet"):
        tables.read_runs(tmp_path)


def test_without_pyarrow_tables_are_csv(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    assert tables.checked_format(None) == "csv"
    with pytest.raises(ValueError, match=r"pip install 'piezoest\[formats\]'"):
        tables.checked_format("parquet")


# ---------------------------------------------------------------- many runs


def test_plan() -> None:
    tasks = campaign.plan(["noise", "prbs"], ["HysteresisEKF", "HysteresisEKF"], range(2), SMALL)
    assert [(each.scenario, each.estimator, each.seed) for each in tasks[:4]] == [
        ("noise", "linear feed-forward", 0),
        ("noise", "HysteresisEKF", 0),
        ("prbs", "linear feed-forward", 0),
        ("prbs", "HysteresisEKF", 0),
    ]
    assert len(tasks) == 8
    with pytest.raises(ValueError, match="nowhere"):
        campaign.plan(["nowhere"], [], range(1), SMALL)
    with pytest.raises(ValueError, match="has no class Nobody"):
        campaign.plan(["prbs"], ["piezoest.bench.runner:Nobody"], range(1), SMALL)


def test_default_estimators_are_all_of_them() -> None:
    names = campaign.default_estimators()
    assert {name.partition("(")[0] for name in names} == set(find_estimators())
    assert "HysteresisRLS(memory=0.4)" in names
    assert "BatchFit(hop=0.1, offset=True)" in names
    campaign.plan(list(SCENARIOS), names, range(1), SMALL)


class Told:
    def __init__(self) -> None:
        self.said: list[tuple[int, int]] = []

    def __call__(self, done: int, of: int) -> None:
        self.said.append((done, of))


def test_processes_give_the_same_rows(tmp_path: Path) -> None:
    tasks = campaign.plan(["cold-start", "noise"], ["HysteresisEKF"], range(2), SMALL)
    found = []
    for processes in (1, 2):
        with Store(tmp_path / f"{processes}.jsonl") as store:
            told = Told()
            campaign.run(tasks, store, campaign.over_cores(processes), told)
            assert told.said == [(k, 8) for k in range(9)]
            found.append([without_time(row) for row in store.rows(campaign.keys_of(tasks))])
    assert found[0] == found[1]


def test_a_process_that_dies_is_a_failure_and_the_rest_goes_on(own: str, tmp_path: Path) -> None:
    estimators = [f"{own}:Still", f"{own}:Dies", f"{own}:Broken"]
    tasks = campaign.plan(["cold-start", "noise"], estimators, range(1), SMALL)
    with campaign.store_in(tmp_path) as store:
        assert campaign.run(tasks, store, campaign.over_cores(2)) == 8
        rows = list(store.rows(campaign.keys_of(tasks)))
    assert [row["failure"] for row in rows] == 2 * [None, None, "the process died", "RuntimeError: no idea"]
    summary = {(row["scenario"], row["estimator"]): row for row in campaign.summarise(rows)}
    assert summary["noise", f"{own}:Dies"]["failures"] == 1
    assert summary["noise", f"{own}:Dies"]["settled_max"] == {"median": None, "q95": None}
    assert summary["noise", f"{own}:Still"]["failures"] == 0
    assert len(campaign.failures(rows)) == 4


def die(item: int) -> int:
    os._exit(item)


def test_a_death_nobody_answers_for_is_an_error() -> None:
    from concurrent.futures.process import BrokenProcessPool

    with pytest.raises(BrokenProcessPool, match="a process died"):
        list(in_processes(die, [1, 2], 2))


def test_summary(own: str) -> None:
    tasks = campaign.plan(["cold-start"], ["HysteresisEKF", f"{own}:Still"], range(3), SMALL)
    rows = [play(each) for each in tasks]
    rows += [play(dataclasses.replace(tasks[1], settings=dataclasses.replace(SMALL, stage="preisach")))]
    summary = campaign.summarise(rows)
    assert [(row["scenario"], row["estimator"], row["runs"]) for row in summary] == [
        ("cold-start", "linear feed-forward", 3),
        ("cold-start", "HysteresisEKF", 3),
        ("cold-start", f"{own}:Still", 3),
        ("cold-start, other stage", "HysteresisEKF", 1),
    ]
    middle = sorted(row["settled_max"] for row in rows if row["estimator"] == "HysteresisEKF")
    filter_row, still = summary[1], summary[2]
    assert filter_row["settled_max"]["median"] in middle
    assert filter_row["settled"] + still["settled"] <= 3
    assert still["settling_time"]["median"] is None
    assert len(filter_row["transient"]) == 3
    assert filter_row["microseconds"]["median"] > 0.0
    over = {row["estimator"]: row for row in suite.overview(summary)}
    assert over["HysteresisEKF"]["runs"] == 4
    assert over[f"{own}:Still"]["settling_time"] is None
    # Still never learns: its error stays what its start makes of it, relative to 5 µm.
    assert over[f"{own}:Still"]["settled_max"] == pytest.approx(still["settled_max"]["median"] / 5.0)


# ---------------------------------------------------------------- recorded logs


def write_log(path: Path, seed: int) -> None:
    u = pz.signals.triangle(30.0, 5.0, 10.0, 2000.0).values
    x = pz.PaperStage(2000.0, seed=seed).run(u)
    x[100:110] = np.nan
    Record.from_arrays(u, x, 2000.0).write(path)


def test_recorded_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("fleet").mkdir()
    for seed, name in enumerate("ab"):
        write_log(Path(f"fleet/{name}.csv"), seed)
    Path("fleet/c.csv").write_text("no numbers", encoding="utf-8")
    logs = recorded.logs_of("fleet")
    assert (
        logs == ["log:fleet/a.csv", "log:fleet/b.csv", "log:fleet/c.csv"] == recorded.logs_of("fleet/*.csv")
    )
    tasks = campaign.plan(logs, ["HysteresisRLS", "PrandtlIshlinskiiRLS"], range(3), SMALL)
    assert len(tasks) == 9  # whatever the seeds
    rows = [play(each) for each in tasks]
    assert [row["failure"] is None for row in rows] == [True] * 6 + [False] * 3
    for linear, derivative, plays in (rows[:3], rows[3:6]):
        assert linear["ratio"] == 1.0
        assert derivative["linear_settled_max"] == linear["settled_max"]
        # Of a triangle on the stage the loop is a tenth of the range.
        assert 0.0 < plays["ratio"] < derivative["ratio"] < 0.5
        assert len(derivative["errors"]) == recorded.SEGMENTS
        assert derivative["settled_rms"] < derivative["settled_max"] == max(derivative["errors"])
    assert len({row["key"] for row in rows}) == 9
    over = {row["estimator"]: row for row in suite.overview(campaign.summarise(rows))}
    assert over["HysteresisRLS"]["failures"] == 1


def test_a_logs_content_is_part_of_its_key(tmp_path: Path) -> None:
    keys = set()
    for seed in range(2):
        (tmp_path / str(seed)).mkdir()
        write_log(tmp_path / str(seed) / "a.csv", seed)
        tasks = campaign.plan(recorded.logs_of(str(tmp_path / str(seed) / "a.csv")), [], range(1), SMALL)
        keys.add(tasks[0].code)
    assert len(keys) == 2
    with pytest.raises(ValueError, match="no log is found at nowhere"):
        recorded.logs_of("nowhere")


# ---------------------------------------------------------------- the command

SHORT = ("--scenario", "cold-start", "--scenario", "noise", "--quick", "--only", "HysteresisEKF")


def test_command_end_to_end(own: str, tmp_path: Path) -> None:
    broken = f"{own}:Broken"
    result = bench(
        *SHORT, "-e", broken, "--seeds", 2, "--jobs", 1, "--by-scenario", "--table", "csv", "--json", "a.json"
    )
    assert result.exit_code == 0, result.output
    for word in ("cold-start: Each start", "linear feed-forward", "HysteresisEKF", "no idea", "2 seeds"):
        assert word in result.stdout
    assert "12 of 12 runs" in result.stderr
    folder = Path("bench-results-quick")
    document = suite.read(folder)
    assert document == json.loads(Path("a.json").read_text(encoding="utf-8"))
    assert document["settings"] == dataclasses.asdict(QUICK)
    assert document["runs"] == 12
    assert document["seeds"] == [0, 1]
    assert document["versions"]["piezoest"] == pz.__version__
    assert {"cpu", "cores", "platform", "python"} <= set(document["machine"])
    assert len(document["failures"]) == 4
    assert len(tables.read_runs(folder)) == 12

    lines = (folder / "runs.jsonl").read_bytes()
    again = bench(*SHORT, "-e", broken, "--seeds", 2, "--jobs", 1, "--table", "csv", "--json", "-")
    assert again.exit_code == 0
    assert (folder / "runs.jsonl").read_bytes() == lines  # nothing was run again
    assert json.loads(again.stdout)["summary"] == document["summary"]


def test_compare_with_itself_finds_no_change(own: str) -> None:
    assert bench(*SHORT, "--jobs", 1, "-o", "one").exit_code == 0
    result = bench("compare", "one", "one", "--fail-if-worse", "--json", "c.json")
    assert result.exit_code == 0, result.output
    document = json.loads(Path("c.json").read_text(encoding="utf-8"))
    assert set(document["counts"]) == {"same"}
    assert document["pairs"] == 4
    assert document["notes"] == []
    assert bench("compare", "one", "nowhere").exit_code == 2
    assert bench(*SHORT, "--jobs", 1, "-o", "other", "--sample-rate", 4000).exit_code == 0
    refused = bench("compare", "one", "other")
    assert refused.exit_code == 2
    assert "sample_rate is 2000.0 in A and 4000.0 in B" in " ".join(refused.stderr.replace("│", "").split())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("-e", "NoSuch"), "choose of"),
        (("-e", "no_such_module:Class"), "No module named"),
        (("-e", "json:NoSuch"), "json has no class NoSuch"),
        (("-e", "json:JSONDecoder"), "has no step"),
        (("--scenario", "nowhere"), "choose of"),
        (("--stage", "best"), "stage must be one of"),
        (("--table", "xlsx"), "parquet, csv"),
        (("--json", "nowhere/a.json"), "no file that can be written"),
        (("--quick", "estimators"), "--quick belong to the suite"),
    ],
)
def test_command_refuses_wrong_words(own: str, arguments: tuple[str, ...], words: str) -> None:
    result = bench(*arguments)
    assert result.exit_code == 2
    assert words in " ".join(result.stderr.replace("│", " ").split())
    assert not Path("bench-results").exists()


def test_what_cannot_be_written_or_read_is_one_sentence(own: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(result: Result, *words: str) -> None:
        assert result.exit_code == 1, result.output
        assert result.stderr.splitlines()[-1].startswith("error: ")
        assert "Traceback" not in result.stderr
        assert all(word in result.stderr.splitlines()[-1] for word in words)

    Path("plain").touch()
    refused(bench(*SHORT, "--jobs", 1, "-o", "plain/folder"), "plain/folder", "Not a directory")

    def full(store: Store, row: Row) -> bool:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "runs.jsonl")

    with monkeypatch.context() as patched:
        patched.setattr(Store, "append", full)
        patched.setattr(campaign, "over_cores", lambda jobs: lambda tasks: iter([{}]))
        refused(bench(*SHORT, "-o", "one"), "runs.jsonl: No space left on device")

    Path("two").mkdir()
    for text in ("{", "[]", "{}", "[" * 100_000, '{"settings": {}}'):
        Path("two", "suite.json").write_text(text, encoding="utf-8")
        result = bench("compare", "two", "two")
        assert result.exit_code == 2, text
        assert "two/suite.json is not" in " ".join(result.stderr.replace("│", " ").split())
    for text in ("a,b\n1,2\n", "key,seed\nx,y\n", "key\n1,2\n", 'key\n"' + "x" * 200_000):
        Path("two", "runs.csv").write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=r"runs\.csv (is damaged|lacks)"):
            tables.read_runs(Path("two"))


def test_a_killed_campaign_goes_on(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "piezoest", "bench", "--quick", "--only", "HysteresisRLS"]
    command += ["--seeds", "3", "--jobs", "2", "--table", "csv", "-o", str(tmp_path)]
    killed = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert killed.stderr is not None
    for line in killed.stderr:
        if " of 60 runs" in line and int(line.split()[0]) >= 10:
            killed.send_signal(signal.SIGKILL)
            break
    killed.communicate()
    assert killed.returncode == -signal.SIGKILL
    kept = [line for line in (tmp_path / "runs.jsonl").read_bytes().split(b"\n") if line.endswith(b"}")]
    assert 10 <= len(kept) < 60

    done = subprocess.run(command, capture_output=True, text=True, check=True)
    # At least those that could be counted are not run again; a torn last line may be whole by now.
    assert int(done.stderr.split(" of 60 runs")[0].split()[-1]) >= 10
    rows = [
        json.loads(line)
        for line in (tmp_path / "runs.jsonl").read_bytes().splitlines()
        if line.endswith(b"}")
    ]
    assert [json.dumps(row) for row in rows[: len(kept)]] == [json.dumps(json.loads(line)) for line in kept]
    assert len(rows) == len({row["key"] for row in rows}) == 60
    assert len(tables.read_runs(tmp_path)) == 60
