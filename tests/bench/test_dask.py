"""Campaigns on Dask: a real scheduler and workers in processes of their own, on this machine only."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from piezoest.bench import executors, table
from piezoest.bench.store import played
from tests.bench.shared import SMALL, own_module

distributed = pytest.importorskip("distributed")

# Says which process ran it; a cluster's workers have the environment they were started with.
OWN = """
import os

class Noted:
    model = None

    def __init__(self, sample_rate, initial_model):
        self.model = initial_model
        with open(os.environ["NOTES"], "a") as file:
            file.write(f"{os.getpid()}\\n")

    def step(self, u, x):
        pass
"""


@pytest.mark.slow
def test_a_worker_killed_half_way_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Where the workers do not look: the module has to be sent to them.
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("NOTES", str(home / "unused.txt"))
    estimators = (f"{own_module(home, monkeypatch, OWN)}:Noted", "HysteresisRLS")
    scenarios = ("cold-start", "two-tone")
    plan = table.Plan(estimators=estimators, scenarios=scenarios, stages=("paper",), seeds=8, given=SMALL)
    tasks = plan.tasks()
    said, killed, notes = [], [], tmp_path / "notes.txt"

    def kill_one_half_way(done: int, of: int) -> None:
        said.append((done, of))
        if done == len(tasks) // 2:  # one that has worked: the last to begin with an estimator
            killed.append(int(notes.read_text().split()[-1]))
            os.kill(killed[0], signal.SIGKILL)

    env = {"NOTES": str(notes)}
    with distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None, env=env) as cluster:
        execute = table.over_dask(cluster.scheduler_address, estimators=estimators)
        rows = played(tasks, home, execute, kill_one_half_way)
    assert said == [(k, len(tasks)) for k in range(len(tasks) + 1)]
    assert [(row["key"], row["failure"]) for row in rows] == [(task.key, None) for task in tasks]
    assert {int(line) for line in notes.read_text().split()} > set(killed)
    assert rows == played(tasks, tmp_path / "here", table.over_cores(1))


@pytest.mark.slow
def test_local_by_default(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "piezoest", "bench", "--quick", "--only", "HysteresisRLS"]
    command += ["-s", "noise", "--dask", "--jobs", "1", "--table", "csv", "-o", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "2 of 2 runs" in done.stderr
    assert (tmp_path / "table.json").exists()


def test_without_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match=r"pip install 'piezoest\[dask\]'"):
        list(executors.on_dask(abs, [1]))
