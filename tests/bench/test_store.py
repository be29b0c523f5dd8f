"""Where rows are kept: each under its key, whoever else appends, and whatever ends the writing."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from piezoest.bench.store import Row, Store


def test_store_keeps_each_key_once_and_goes_on_after_a_torn_line(tmp_path: Path) -> None:
    path = tmp_path / "new" / "runs.jsonl"
    with Store(path) as store:
        assert store.append({"key": "a", "value": 1})
        assert not store.append({"key": "a", "value": 2})
        assert store.append({"key": "b", "value": 3})
    with path.open("ab") as file:
        file.write(b'{"key": "c", "val')
    with Store(path) as store:
        assert len(store) == 2
        assert "c" not in store
        assert store.append({"key": "c", "value": 4})
    with path.open("ab") as file:
        file.write(b'{"key": "a", "value": 5}\n[]\n')
    with Store(path) as store:
        assert [row["value"] for row in store.rows(["c", "no", "a", "b"])] == [4, 1, 3]


def test_rows_of_two_stores_are_kept_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "runs.jsonl"
    encode = json.dumps
    with Store(path) as one, Store(path) as other:

        def between(row: Row, **options: Any) -> str:
            # The other appends while this one is about to.
            monkeypatch.setattr("piezoest.bench.store.json.dumps", encode)
            assert other.append({"key": "other", "value": 1})
            return encode(row, **options)

        monkeypatch.setattr("piezoest.bench.store.json.dumps", between)
        assert one.append({"key": "one", "value": 2})
        assert [row["value"] for row in one.rows(["one"])] == [2]
        assert [row["value"] for row in other.rows(["other"])] == [1]


APPEND = """
import sys
from pathlib import Path

from piezoest.bench.store import Store

path, name = Path(sys.argv[1]), sys.argv[2]
keys = [f"{name}{k}" for k in range(4000)]
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
    path = tmp_path / "runs.jsonl"
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
        assert len(store) == 8000
        assert len(path.read_bytes().split(b"\n")) >= 8001


def test_a_row_that_does_not_fit_on_the_disk_counts_for_nothing(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    path = tmp_path / "runs.jsonl"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with Store(path) as store:
        store.append({"key": "a"})
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
        try:
            with pytest.raises(OSError, match=r"runs\.jsonl"):
                store.append({"key": "b", "text": "x" * 200})
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert "b" not in store
        assert store.append({"key": "b", "text": "y"})
    with Store(path) as store:
        assert list(store.rows("ab")) == [{"key": "a"}, {"key": "b", "text": "y"}]
