"""Where rows are kept: each under its key, whoever else appends, and whatever ends the writing."""

import subprocess
import sys
from pathlib import Path

import pytest

from piezoest.bench.store import Store


def test_a_store_keeps_the_first_row_of_each_key_and_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "new" / "runs.sqlite"
    with Store(path) as store, Store(path) as other:
        assert store.append({"key": "a", "value": 1})
        assert not other.append({"key": "a", "value": 2})
        assert other.append({"key": "b", "value": 3})
    with Store(path) as store:
        assert len(store) == 2
        assert "c" not in store
        assert store.append({"key": "c", "value": 4})
        assert [row["value"] for row in store.rows(["c", "no", "a", "b"])] == [4, 1, 3]


def test_a_file_that_is_no_store_is_named(tmp_path: Path) -> None:
    path = tmp_path / "runs.sqlite"
    path.write_text("no rows" * 1000)
    with pytest.raises(OSError, match=r"runs\.sqlite: file is not a database"), Store(path):
        pass


APPEND = """
import sys
from pathlib import Path

from piezoest.bench.store import Store

path, name = Path(sys.argv[1]), sys.argv[2]
keys = [f"{name}{k}" for k in range(500)]
with Store(path) as store:
    print("open", flush=True)
    sys.stdin.readline()
    for k, key in enumerate(keys):
        assert store.append({"key": key, "text": name * (k % 997)})
    rows = list(store.rows(keys))
assert [row["key"] for row in rows] == keys
assert all(row["text"] == name * (k % 997) for k, row in enumerate(rows))
"""


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
    with Store(path) as store:
        assert len(store) == 1000
