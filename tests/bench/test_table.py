"""The table of runs: what a run is, how runs are kept, resumed and summed up. No time is asserted."""

import dataclasses
import json
import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import piezoest as pz
from piezoest.bench import figures, recorded, table, tables, tuning
from piezoest.bench.cases import STAGES, STRANGERS, make_stage
from piezoest.bench.estimators import KNOWN, PAPERS, candidate, defaults, found
from piezoest.bench.origin import code_of, code_of_parts, fingerprint
from piezoest.bench.pages import write_html
from piezoest.bench.run import COLUMNS, Task, crashed, play
from piezoest.bench.store import append, opened, played, row_of
from piezoest.bench.table_command import Runs, _plan
from tests.bench.shared import SMALL, bench, kept, own_module, said

OWN = """
import os

from piezoest import LinearGain

class Still:
    def __init__(self, sample_rate, initial_model, size=1.0):
        self.model = initial_model

    model = None

    def step(self, u, x):
        pass

class Bare:
    def __init__(self, sample_rate):
        self.model = LinearGain(0.15)

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
MACHINE = {"date": "2026-01-01", "machine": {"cpu": "x", "python": "3"}, "versions": {"numpy": "2"}}


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    return own_module(tmp_path, monkeypatch, OWN)


def task(estimator: str = "HysteresisRLS", scenario: str = "cold-start", **given: Any) -> Task:
    return Task(scenario, estimator, 3, SMALL | given, code_of(estimator))


def plan(*estimators: str, **given: Any) -> table.Plan:
    asked = {"scenarios": ("cold-start", "noise"), "stages": ("paper",), "seeds": 2, "given": SMALL}
    return table.Plan(estimators=estimators, **{**asked, **given})


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_is_a_function_of_its_seed_and_has_a_loop(name: str) -> None:
    u = pz.signals.triangle(90.0, 5.0, 3.0, 2000.0).values
    x, again, other = (make_stage(name, 2000.0, seed=seed, noise=0.0).run(u) for seed in (1, 1, 2))
    np.testing.assert_array_equal(x, again)
    assert np.any(x != other) == (name != "paper")  # which differs by its noise alone
    gain = np.polyfit(u[800:], x[800:], 1)
    assert 0.05 < gain[0] < 0.5
    assert np.max(np.abs(x[800:] - np.polyval(gain, u[800:]))) > 0.02 * np.ptp(x)


def test_all_estimators_are_compared_and_all_are_told_of_the_offset() -> None:
    names = defaults()
    assert {name.partition("(")[0] for name in names} == set(found())
    assert {"AdaptiveFeedforward", PAPERS} <= {*names}
    for name in names:
        assert hasattr(candidate(name)(2000.0, pz.ColemanHodgdon(0.02, 0.12, 0.0036)), "step")
    assert all("offset=True" in text for text in (*KNOWN.values(), PAPERS))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("NoSuch", "choose one of"),
        ("no_such_module:Class", "No module named"),
        ("json:NoSuch", "has no attribute .NoSuch."),
        ("json:JSONDecoder", "has no step"),
        ("HysteresisRLS(0.4)", "every argument needs its name"),
        ("HysteresisRLS(wrong=1)", "takes no wrong"),
        ("HysteresisRLS(memory=open)", "no number, string, tuple or policy"),
        ("HysteresisRLS(policies=(Nothing(),))", "is no policy"),
    ],
)
def test_what_is_no_estimator_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        candidate(text)


def test_settings_that_are_refused_are_so_before_the_runs() -> None:
    with pytest.raises(ValueError, match="memory must be above zero"):
        plan("HysteresisRLS(memory=-1)")


def test_a_run_is_a_function_of_its_task() -> None:
    first, again = play(task()), play(task())
    assert first == again
    assert set(first) == {*COLUMNS, "errors"}
    assert first["failure"] is None
    assert (first["key"], first["period"]) == (task().key, pytest.approx(0.2))
    assert first["typical"] == pytest.approx(math.prod(first["errors"]) ** (1.0 / 6.0))
    assert first["worst"] >= max(first["errors"])
    json.dumps(first, allow_nan=False)
    others = [
        task(scenario="noise"), task("HysteresisEKF"), task(stage="duhem"),
        dataclasses.replace(task(), seed=4), dataclasses.replace(task(), code="another"),
    ]  # fmt: skip
    assert len({task().key, *(other.key for other in others)}) == 6


def test_an_estimators_own_file_is_part_of_its_code(own: str) -> None:
    before = code_of(f"{own}:Still")
    assert code_of("HysteresisRLS") == fingerprint() != before
    with Path(f"{own}.py").open("a", encoding="utf-8") as file:
        file.write("\n# changed\n")
    assert code_of(f"{own}:Still") != before


def test_comments_and_docstrings_are_no_other_code(tmp_path: Path) -> None:
    codes = []
    texts = ('return "a"', '"""What."""\n\n    return "a"  # why', 'return "b"', '"c".join(x)', '"d".join(x)')
    for k, text in enumerate(texts):
        (tmp_path / str(k)).mkdir()
        (tmp_path / str(k) / "module.py").write_text(f"def f(x):\n    {text}\n", encoding="utf-8")
        codes.append(code_of_parts(tmp_path / str(k))["."])
    assert codes[0] == codes[1]
    assert len({*codes}) == 4


@pytest.mark.parametrize(
    ("name", "failure"), [("Broken", "RuntimeError: no idea"), ("Quits", "SystemExit: enough")]
)
def test_what_an_estimator_raises_is_its_own_failure(own: str, name: str, failure: str) -> None:
    row = play(task(f"{own}:{name}"))
    assert (row["failure"], row["settled"], row["diverged"], row["errors"]) == (failure, None, True, [])
    assert "in step" in row["traceback"]
    assert play(task(f"{own}:Bare"))["failure"] is None  # its model is no attribute of its class


@pytest.mark.parametrize("format", tables.FORMATS)
def test_tables_are_tidy_and_read_back(tmp_path: Path, format: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow")
    rows = [play(task()), crashed(task("HysteresisEKF"))]
    written = table.write(rows, tmp_path, format)
    read = tables.read_table(tmp_path, table.RUNS, COLUMNS)
    pd.testing.assert_frame_equal(read, written)
    assert read["failure"][1] == "the process died"
    assert pd.isna(read["failure"][0])
    periods = tables.read_table(tmp_path, table.PERIODS, table.PERIOD_COLUMNS)
    assert periods["error"].to_list() == rows[0]["errors"]


@pytest.mark.slow
def test_a_process_that_dies_is_a_failure_and_the_rest_goes_on(own: str, tmp_path: Path) -> None:
    asked = plan(f"{own}:Still", f"{own}:Dies", f"{own}:Broken", seeds=1)
    rows = played(asked.tasks(), tmp_path, table.over_cores(2))
    assert [row["failure"] for row in rows] == 2 * [None, None, "the process died", "RuntimeError: no idea"]
    document = table.describe(rows, asked, {})
    assert (len(document["failures"]), len(document["tracebacks"])) == (4, 1)
    assert document["all_failed"] == [f"{own}:Dies", f"{own}:Broken"]
    assert table.costs([f"{own}:Dies"], asked.given) == {f"{own}:Dies": {}}


def test_a_document_sums_up(own: str, tmp_path: Path) -> None:
    ekf, still = "HysteresisEKF(offset=True)", f"{own}:Still"
    asked = plan(ekf, still, stages=("paper", "duhem"), seeds=3)
    rows = list(map(play, asked.tasks()))
    document = table.describe(rows, asked, {})
    json.dumps(document, allow_nan=False)
    assert document["runs"] == len(rows) == 36
    cell = next(c for c in document["cells"] if c["estimator"] == ekf)
    same = {"stage": "paper", "scenario": "cold-start", "estimator": ekf}
    mine = [row["settled"] / row["amplitude"] for row in rows if same.items() <= row.items()]
    assert cell["settled"][0] == pytest.approx(np.median(mine), rel=1e-3)
    over = {row["estimator"]: row for row in document["overview"]}
    assert over[ekf]["settled"][0] < over[still]["settled"][0]
    assert document["needs"][0]["order"][0]["estimator"] == ekf
    write_html({**document, **MACHINE}, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert (page.count("<table>"), page.count("data:image/png")) == (2 + 4, 4)


def write_log(path: Path, seed: int) -> None:
    u = pz.signals.triangle(30.0, 5.0, 10.0, 2000.0).values
    x = pz.PaperStage(2000.0, seed=seed).run(u)
    x[100:110] = np.nan
    pz.Record.from_arrays(u, x, 2000.0).write(path)


def test_recorded_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("fleet").mkdir()
    for seed, name in enumerate("ab"):
        write_log(Path(f"fleet/{name}.csv"), seed)
    Path("fleet/c.csv").write_text("no numbers", encoding="utf-8")
    logs = recorded.logs_of("fleet")
    assert logs == [f"log:fleet/{name}.csv" for name in "abc"] == recorded.logs_of("fleet/*.csv")
    asked = plan("HysteresisRLS", "PrandtlIshlinskiiRLS", scenarios=tuple(logs), seeds=3)
    tasks = asked.tasks()
    assert len({each.key for each in tasks}) == 9  # whatever the seeds
    rows = list(map(play, tasks))
    assert [row["failure"] is None for row in rows] == [True] * 6 + [False] * 3
    for linear, derivative, plays in (rows[:3], rows[3:6]):
        assert 0.0 < plays["settled"] < derivative["settled"] < 0.5 * linear["settled"]
    document = table.describe(rows, asked, {})
    write_html({**document, **MACHINE}, "logs.html")  # which has no stage to speak of
    asked = _plan(Runs(logs="fleet"))
    assert "HysteresisRLS" in asked.estimators
    assert "AdaptiveFeedforward" not in asked.estimators  # it needs a stage
    assert "drives a stage" in play(Task(logs[0], "AdaptiveFeedforward", 0))["failure"]
    write_log(Path("fleet/a.csv"), 7)
    recorded.digest.cache_clear()
    assert asked.tasks()[0].key != tasks[0].key
    with pytest.raises(FileNotFoundError, match="nowhere"):
        recorded.logs_of("nowhere")


def read(path: str | Path) -> Any:
    return json.loads(Path(path).read_text(encoding="utf-8"))


@pytest.mark.slow
def test_command_end_to_end(own: str) -> None:
    asked: list[object] = ["-s", "cold-start", "--scenario", "noise", "--quick", "--only", "HysteresisEKF"]
    asked += ["-e", f"{own}:Broken", "--seeds", 2, "--table", "csv", "--jobs", 1]
    result = bench(*asked, "--json", "a.json", "--figures", "figures")
    assert result.exit_code == 1, result.output  # one estimator has failed in all its runs
    assert "12 of 12 runs" in result.stderr
    assert "in step" in result.stdout  # the traceback of one's own estimator
    assert len(list(Path("figures").iterdir())) == 4
    folder = Path("bench-results-quick")
    document = read(folder / "table.json")
    assert document == read("a.json")
    assert len(tables.read_table(folder, table.RUNS, COLUMNS)) == 12

    again = bench(*asked, "--json", "-")
    assert "12 of 12 runs" in again.stderr.splitlines()[1]  # nothing was run again
    assert json.loads(again.stdout)["cells"] == document["cells"]

    result = bench("compare", folder, folder, "--json", "c.json")
    assert result.exit_code == 0, result.output
    assert set(read("c.json")["counts"]) == {"same"}
    assert read("c.json")["pairs"] == 12
    shutil.copytree(folder, "other")
    document["conditions"]["rest"] = 9.0
    Path("other/table.json").write_text(json.dumps(document), encoding="utf-8")
    for other, words in (("nowhere", "no table.json"), ("other", "and 9.0 in B")):
        result = bench("compare", folder, other)
        assert result.exit_code == 1
        assert words in said(result)

    for each in document["estimators"].values():
        each["step_us"] = 3.2364  # around which alone Matplotlib leaves no width, and warns
    figures.cost(document).savefig("cost.png")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("-e", "NoSuch"), "choose one of"),
        (("-e", "./mine.py:Mine"), "mine:Mine"),
        (("--stage", "best"), "choose one of"),
        (("--json", "nowhere/a.json"), "there is no folder"),
        (("--quick", "paper"), "after paper, if it has them"),
    ],
)
def test_command_refuses_wrong_words(own: str, arguments: tuple[str, ...], words: str) -> None:
    result = bench(*arguments)
    assert result.exit_code == 2
    assert words in said(result)
    assert not Path("bench-results").exists()


def test_slow_estimators_run_on_fewer_seeds_and_the_first_stage() -> None:
    asked = plan("HysteresisEKF", "FilterPyUKF", stages=("paper", *STRANGERS), seeds=3, slow_seeds=2)
    tasks = asked.tasks()
    assert len(tasks) == 2 * 3 * 4 * 2 + 2 * 2
    slow = [each for each in tasks if each.estimator == "FilterPyUKF"]
    assert {(each.given["stage"], each.seed) for each in slow} == {("paper", 0), ("paper", 1)}
    for wrong, words in (({"scenarios": ("nowhere",)}, "nowhere"), ({"stages": ("best",)}, "best")):
        with pytest.raises(ValueError, match=words):
            plan("HysteresisEKF", **wrong)


def test_tuning_finds_settings_on_other_seeds(own: str, tmp_path: Path) -> None:
    texts = ["HysteresisEKF(offset=True)", "HysteresisRLS(memory=0.4)", f"{own}:Still", "HysteresisRLS"]
    chosen = tuning.tune(texts, 2, SMALL, lambda tasks: played(tasks, tmp_path, table.over_cores(1)))
    ekf, rls = chosen
    assert all("offset=True" in trial["estimator"] for trial in ekf["trials"])
    assert min(ekf["trials"], key=lambda trial: trial["score"])["estimator"] == ekf["chosen"]
    assert rls["default"] == "HysteresisRLS"
    with pytest.raises(ValueError, match="power of two"):
        tuning.draws(texts[0], 3)


def test_a_store_keeps_the_first_row_of_each_key_and_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "new" / "runs.sqlite"
    one, again, two = ({"key": key, "value": k} for k, key in enumerate("aab"))
    with opened(path) as file, opened(path) as other:
        assert [append(file, one), append(other, again)] == [True, False]
    with opened(path) as file:
        assert append(file, two)
        assert [row_of(file, key) for key in ("b", "no", "a")] == [two, None, one]
    assert kept(path) == 2
    path.write_text("no rows" * 1000)
    with pytest.raises(OSError, match=r"runs\.sqlite: file is not a database"), opened(path):
        pass


APPEND = """
import sys
from pathlib import Path

from piezoest.bench.store import append, opened, row_of

path, name = Path(sys.argv[1]), sys.argv[2]
keys = [f"{name}{k}" for k in range(500)]
with opened(path) as file:
    print("open", flush=True)
    sys.stdin.readline()
    for k, key in enumerate(keys):
        assert append(file, {"key": key, "text": name * (k % 997)})
    for k, key in enumerate(keys):
        assert row_of(file, key) == {"key": key, "text": name * (k % 997)}
"""


@pytest.mark.slow
def test_two_processes_append_to_one_store(tmp_path: Path) -> None:
    path = tmp_path / "runs.sqlite"
    command = [sys.executable, "-c", APPEND, str(path)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    workers = [subprocess.Popen([*command, name], **pipes) for name in "xy"]  # type: ignore[call-overload]
    for worker in workers:
        worker.stdout.readline()
    for worker in workers:
        worker.stdin.write("\n")
        worker.stdin.flush()
    assert [worker.communicate() and worker.returncode for worker in workers] == [0, 0]
    assert kept(path) == 1000
