"""Logs in blocks: the same bits as in memory, whatever the blocks, and little memory."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import piezoest as pz
from piezoest.records import Record, RecordStream, read_record, stream_record, write_columns

RATE = 1000.0


def joined(stream: RecordStream) -> list[np.ndarray]:
    return [np.concatenate(parts) for parts in zip(*stream, strict=True)]


def same(stream: RecordStream, record: Record) -> None:
    for found, wanted in zip(joined(stream), (record.time, record.voltage, record.displacement), strict=True):
        np.testing.assert_array_equal(found, wanted)
    assert stream.sample_rate == record.sample_rate
    assert stream.count() == len(record)


def swing(samples: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, voltage and displacement of a stage with hysteresis, some of it missing."""
    time = np.arange(samples) / RATE
    voltage = 20.0 * np.sin(2.0 * np.pi * 5.0 * time) * (1.0 + 0.3 * np.sin(2.0 * np.pi * 0.7 * time))
    displacement = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(voltage, allow_jumps=True)
    displacement += np.random.default_rng(0).normal(0.0, 1e-3, samples)
    displacement[1234:1240] = np.nan
    return time, voltage, displacement


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 10_000),
    rows=st.integers(1, 90),
    gaps=st.integers(0, 6),
    timeless=st.integers(0, 20),
    jitter=st.sampled_from([0.0, 0.1]),
)
def test_any_blocks_give_the_same_samples(
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
    same(stream_record(tmp_path / "log.npy", rows=rows), record)
    # Rows with a time are where their time says.
    known = np.isfinite(record.displacement)
    where = record.displacement[known] - record.displacement[known][0]
    exact = np.flatnonzero(known) - np.flatnonzero(known)[0]
    assert np.mean(where == exact) > (0.8 if timeless else 0.999)


@pytest.mark.parametrize(("rows", "kind"), [(1, "npy"), (13, "csv"), (400, "npy")])
@pytest.mark.parametrize("estimator", [lambda: pz.HysteresisRLS(RATE), lambda: pz.PrandtlIshlinskiiRLS(RATE)])
def test_estimators_end_in_the_same_bits(tmp_path: Path, rows: int, kind: str, estimator: object) -> None:
    assert callable(estimator)
    time, voltage, displacement = swing()
    file = tmp_path / f"log.{kind}"
    if kind == "csv":
        write_columns(file, {"time_s": time, "voltage_V": voltage, "displacement_um": displacement})
    else:
        np.save(file, np.column_stack([time, voltage, displacement]))
    record = read_record(file)
    whole, parts = estimator(), estimator()
    whole.run(record.voltage, record.displacement)
    stream = stream_record(file, rows=rows)
    for block in stream:
        parts.run(block.voltage, block.displacement)
    assert stream.sample_rate == record.sample_rate
    assert parts.to_dict() == whole.to_dict()
    assert parts.status == whole.status


def text(file: Path, lines: list[str]) -> Path:
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def rows_of_text(count: int = 200) -> list[str]:
    return ["t;u;x", *(f"0,{k:04d};{k % 7},5;{k}" for k in range(count))]


@pytest.mark.parametrize("rows", [1, 3, 50, 1000])
def test_text_with_all_its_habits(tmp_path: Path, rows: int) -> None:
    lines = rows_of_text()
    lines[30] = "0,0029;n/a;29"
    lines[31] = "# the amplifier was off"
    lines[60] = ""
    lines[90] = "0,0089;;"
    lines[120] = "0,0119; 1e400 ;119"
    lines += ["", "  ", "# end"]
    file = text(tmp_path / "log.csv", lines)
    record = read_record(file)
    assert len(record) == 200
    assert np.flatnonzero(~record.usable).tolist() == [29, 30, 59, 89, 119]
    np.testing.assert_array_equal(record.displacement[[0, 28, 58, 199]], [0.0, 28.0, 58.0, 199.0])
    same(stream_record(file, rows=rows), record)


def test_stream_of_too_few_rows_says_so_at_its_end(tmp_path: Path) -> None:
    file = text(tmp_path / "log.csv", rows_of_text(8))
    stream = stream_record(file)
    with pytest.raises(ValueError, match="only 8 usable rows"):
        list(stream)
    with pytest.raises(ValueError, match="rows must be a whole number of at least 1"):
        stream_record(file, rows=0)
    with pytest.raises(ValueError, match="no rows below the header"):
        stream_record(text(tmp_path / "head.csv", ["t;u;x"]))


@pytest.mark.parametrize("kind", ["csv", "npy", "parquet", "h5"])
def test_memory_does_not_grow_with_the_file(tmp_path: Path, kind: str) -> None:
    n = 300_000 if kind == "csv" else 1_000_000
    time = np.arange(n) / 50_000.0
    columns = {"time_s": time, "voltage_V": np.sin(time), "displacement_um": np.cos(time)}
    file = tmp_path / f"log.{kind}"
    if kind == "csv":
        write_columns(file, columns)
    elif kind == "npy":
        np.save(file, np.column_stack(list(columns.values())))
    elif kind == "h5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(file, "w") as root:
            for name, values in columns.items():
                root[name] = values
    else:
        pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
        pq.write_table(pa.table(columns), file)
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
