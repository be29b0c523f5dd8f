"""What is written is there whole, or as it was before: on a full disk, and where the process is killed."""

import contextlib
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from piezoest._files import save_figure
from piezoest.bench import origin, table, tables
from piezoest.export.generated import CCode
from piezoest.export.tables import Table
from piezoest.models import AmplitudeProfile
from piezoest.records import write_columns
from piezoest.report.page import Page

resource = pytest.importorskip("resource", reason="without limits no disk is full")

SIZE = 5000


@contextlib.contextmanager
def full_disk(room: int = 2000) -> Iterator[None]:
    """No file may become longer than so many bytes; Python ignores the signal, and the write fails."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(SIZE)


def log(path: Path, seed: int) -> None:
    values = noise(seed)
    write_columns(path, {"time_s": np.arange(SIZE) / 1e3, "voltage_V": values, "displacement_um": -values})


def page(path: Path, seed: int) -> None:
    written = Page("title", "about")
    written.footer(f"{seed}" * SIZE)
    written.write(path)


def figure(path: Path, seed: int) -> None:
    drawn = Figure()
    drawn.subplots().plot(noise(seed))
    save_figure(drawn, path)


def rows(path: Path, seed: int) -> None:
    periods = [{"key": "run", "seed": seed, "period": k, "error": 0.1 * k} for k in range(SIZE)]
    tables.write_table(tables.table_of(periods, table.PERIOD_COLUMNS), path)


def waveform(path: Path, seed: int) -> None:
    values = noise(seed)
    Table(1e3, values, values, (np.column_stack([values, values]),)).write(path.parent)


OUTPUTS: dict[str, Callable[[Path, int], Any]] = {
    **dict.fromkeys(("log.csv", "log.parquet", "log.h5", "log.mat", "log.npy"), log),
    "profile.json": lambda path, seed: AmplitudeProfile(
        np.arange(1.0, SIZE), np.full((SIZE - 1, 3), 0.1 * seed)).save(path),
    "page.html": page,
    "figure.png": figure,
    "controller.c": lambda path, seed: CCode(
        "controller", f"{seed}" * SIZE, f"{seed}" * SIZE, "double", False).write(path.parent),
    "waveform.csv": waveform,
    "put.json": lambda path, seed: origin.put(noise(seed).tolist(), path),
    **dict.fromkeys(("periods.csv", "periods.parquet"), rows),
}  # fmt: skip


@pytest.mark.parametrize("name", OUTPUTS)
def test_a_full_disk_leaves_the_old_file(tmp_path: Path, name: str) -> None:
    if name.endswith((".parquet", ".h5")):
        pytest.importorskip("pyarrow" if name.endswith(".parquet") else "h5py")
    path = tmp_path / name
    OUTPUTS[name](path, 1)
    before = content(tmp_path)
    assert len(before[name]) > 2000
    with full_disk(), pytest.raises(OSError, match=re.escape(str(tmp_path))):
        OUTPUTS[name](path, 2)
    assert content(tmp_path) == before
    OUTPUTS[name](path, 2)
    assert content(tmp_path)[name] != before[name]


KILLED = """
import os, signal, sys, numpy
from piezoest.records import write_columns
def half(file, *rest, **options):
    file.write("half a line")
    file.flush()
    os.kill(os.getpid(), signal.SIGKILL)
numpy.savetxt = half
write_columns(sys.argv[1], {"time_s": [0.0, 1.0], "voltage_V": [2.0, 3.0]})
"""


def test_a_kill_in_the_middle_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "voltage.csv"
    path.write_text("as it was", encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert path.read_text(encoding="utf-8") == "as it was"
