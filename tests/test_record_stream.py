"""Logs in blocks: the same bits as in memory, whatever the blocks, and little memory."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from piezoest.records import RecordStream, read_record, stream_record, write_columns

RATE = 1000.0


def joined(stream: RecordStream) -> list[np.ndarray]:
    return [np.concatenate(parts) for parts in zip(*stream, strict=True)]


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 10_000),
    rows=st.integers(1, 90),
    gaps=st.integers(0, 6),
    timeless=st.integers(0, 20),
    jitter=st.sampled_from([0.0, 0.1]),
)
def test_any_blocks_are_the_log(
    tmp_path: Path, seed: int, rows: int, gaps: int, timeless: int, jitter: float
) -> None:
    rng = np.random.default_rng(seed)
    n = 300
    index = np.sort(rng.choice(n, n - gaps * 4, replace=False))
    time = 3.0 + (index + jitter * rng.uniform(-1.0, 1.0, index.size)) / RATE
    u = np.sin(index / 9.0)
    x = index.astype(float)
    time[rng.choice(index.size, timeless, replace=False)] = np.nan
    u[rng.choice(index.size, 5, replace=False)] = np.nan
    np.save(tmp_path / "log.npy", np.column_stack([time, u, x]))
    try:
        record = read_record(tmp_path / "log.npy")
    except ValueError as error:
        # Too much is missing, or too uneven: then it is so in blocks too.
        with pytest.raises(ValueError, match=str(error)[-30:].replace("(", r"\(").replace(")", r"\)")):
            joined(stream_record(tmp_path / "log.npy", rows=rows))
        return
    stream = stream_record(tmp_path / "log.npy", rows=rows)
    for found, wanted in zip(joined(stream), (record.time, record.voltage, record.displacement), strict=True):
        np.testing.assert_array_equal(found, wanted)
    assert (stream.sample_rate, stream.count()) == (record.sample_rate, len(record))
    # Rows with a time are where their time says.
    known = np.isfinite(record.displacement)
    where = record.displacement[known] - record.displacement[known][0]
    exact = np.flatnonzero(known) - np.flatnonzero(known)[0]
    assert np.mean(where == exact) > (0.8 if timeless else 0.999)


def test_stream_of_too_few_rows_says_so_at_its_end(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("\n".join(["t;u;x", *(f"0,{k:04d};{k % 7},5;{k}" for k in range(8))]))
    with pytest.raises(ValueError, match="only 8 usable rows"):
        list(stream_record(file))
    with pytest.raises(ValueError, match="rows must be a whole number of at least 1"):
        stream_record(file, rows=0)
    file.write_text("t;u;x\n")
    with pytest.raises(ValueError, match="no rows below the header"):
        stream_record(file)


@pytest.mark.parametrize("kind", ["csv", "npy", "parquet", "h5"])
@pytest.mark.slow_but_first
def test_memory_does_not_grow_with_the_file(tmp_path: Path, kind: str) -> None:
    n = 300_000 if kind == "csv" else 1_000_000
    time = np.arange(n) / 50_000.0
    columns = {"time_s": time, "voltage_V": np.sin(time), "displacement_um": np.cos(time)}
    file = tmp_path / f"log.{kind}"
    if kind in ("h5", "parquet"):
        pytest.importorskip("h5py" if kind == "h5" else "pyarrow")
    write_columns(file, columns)
    size = 24 * n
    del columns, time
    stream_record(file, rows=2000)  # what loads on first use does not count
    tracemalloc.start()
    try:
        stream = stream_record(file, rows=2000, sample_rate=50_000.0)
        total = sum(float(block.voltage.sum()) for block in stream)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert total == pytest.approx(float(np.sin(np.arange(n) / 50_000.0).sum()), rel=1e-6)
    assert peak < (3_000_000 if kind == "csv" else size / 10)
