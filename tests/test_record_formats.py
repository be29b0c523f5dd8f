"""Logs in formats other than text, in tables, arrays and blocks: the same bits, and what is refused."""

import re
import sys
import tracemalloc
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from piezoest.records import Record, RecordStream, as_record, read_record, stream_record, write_columns
from tests import logs
from tests.logs import DISPLACEMENT, LOG, RATE, TIME, VOLTAGE, N, check, write_hdf5

# One sample of the displacement has no number.
NAMES = {**LOG, "displacement_um": np.where(np.arange(N) == 7, np.nan, DISPLACEMENT)}
STAMPS = [datetime(2026, 11, 22, 10) + timedelta(seconds=t) for t in TIME.tolist()]


def write_parquet(file: Path, columns: dict[str, Any], units: dict[str, str] | None = None) -> None:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    arrays = {name: pa.array(values) for name, values in columns.items()}
    notes = {name: {"unit": unit} for name, unit in (units or {}).items()}
    fields = [pa.field(name, array.type, metadata=notes.get(name)) for name, array in arrays.items()]
    pq.write_table(pa.table(list(arrays.values()), schema=pa.schema(fields)), file, row_group_size=16)


def write_mat_73(file: Path, columns: dict[str, Any]) -> None:
    """As MATLAB does: HDF5 behind a block of text, row vectors as columns."""
    with pytest.importorskip("h5py").File(file, "w", userblock_size=512) as root:
        for name, values in columns.items():
            root[name] = np.asarray(values)[:, None]
        root["comment"] = np.frombuffer("made for a test".encode("utf-16-le"), np.uint16)
        root["comment"].attrs["MATLAB_class"] = np.bytes_("char")
    with file.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + b"\0" * 8 + b"\x00\x02IM")


def write_npy(file: Path, columns: dict[str, Any]) -> None:
    np.save(file, np.rec.fromarrays(list(columns.values()), [(name, np.float64) for name in columns]))


WRITERS: dict[str, Callable[[Path, dict[str, Any]], None]] = {
    "log.parquet": write_parquet,
    "log.h5": write_hdf5,
    "log.mat": savemat,
    "log73.mat": write_mat_73,
    "log.npy": write_npy,
    "log.npz": lambda file, columns: np.savez_compressed(file, **columns),
}


@pytest.fixture(params=WRITERS)
def log(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    file = tmp_path / request.param
    WRITERS[request.param](file, NAMES)
    return file


def test_plain_log_as_a_whole_and_in_blocks(log: Path) -> None:
    record = read_record(log)
    check(record)
    assert record.skipped == 1
    assert record.notes == ("1 sample is without usable numbers: skipped, the timing is kept",)
    for rows in (1, 7, 16, 1000) if log.name not in ("log.mat", "log.npz") else ():
        stream = stream_record(log, rows=rows)
        for found, name in zip(joined(stream), ("time", "voltage", "displacement"), strict=True):
            np.testing.assert_array_equal(found, getattr(record, name))
        assert (stream.sample_rate, stream.count()) == (record.sample_rate, N)
        assert max(block.voltage.size for block in stream) <= rows


def test_columns_and_units(log: Path) -> None:
    columns = {"a": 1e3 * TIME, "b": VOLTAGE / 20.0, "c": 1e3 * DISPLACEMENT}
    WRITERS[log.name](log, columns)
    named = {"voltage": "b", "displacement": "c"}
    units = {"time": "ms", "voltage": "20 V", "displacement": "nm"}
    record = read_record(log, columns={"time": "a", **named}, units=units)
    check(record)
    assert "displacement: converted to µm (factor 0.001)" in record.notes
    # A sample rate stands in for the column of time.
    check(read_record(log, columns=named, units=units, sample_rate=RATE))


def test_unknown_columns_truncated_files_and_those_without_a_log_are_refused(log: Path) -> None:
    for named in ({"voltage": "nope"}, {"displacement": "4"}):
        with pytest.raises(ValueError, match="no column") as caught:
            read_record(log, columns=named)
        assert [name for name in (log.name, *NAMES) if name not in str(caught.value)] == []
    raw = log.read_bytes()
    for content, words in (
        *((raw[: int(part * len(raw))], log.name) for part in (0.3, 0.6, 0.95)),
        (b"", "the file is empty"),
        (b"time_s,voltage_V,displacement_um\n" * 40, rf"{log.name}.*(this is no|cannot be read)"),
    ):
        log.write_bytes(content)
        with pytest.raises(ValueError, match=words):
            read_record(log)
    with pytest.raises(FileNotFoundError):
        read_record(log.with_name("none" + log.suffix))
    WRITERS[log.name](log, {key: values[:5] for key, values in NAMES.items()})
    with pytest.raises(ValueError, match="only 5 usable rows"):
        read_record(log)
    if log.suffix == ".npy":
        np.save(log, np.array(["a", "b"]))
    else:
        WRITERS[log.name](log, {"words": np.array([b"a", b"b"])})
    with pytest.raises(ValueError, match=r"no .*of numbers"):
        read_record(log)


@pytest.mark.parametrize("key", ["fs", "Fs", "sample_rate"])
@pytest.mark.parametrize("name", ["log.h5", "log.mat", "log73.mat", "log.npz"])
def test_sample_rate_in_the_file(tmp_path: Path, name: str, key: str) -> None:
    columns = {"u": VOLTAGE, "x": DISPLACEMENT, key: np.array([RATE])}
    WRITERS[name](tmp_path / name, columns)
    record = read_record(tmp_path / name)
    check(record)
    assert "sample rate of 100 Hz as the file states it" in record.notes
    # One that is given comes first, and so does a column of time.
    assert read_record(tmp_path / name, sample_rate=50.0).sample_rate == 50.0
    WRITERS[name](tmp_path / name, {**columns, "t": 2.0 * TIME})
    assert read_record(tmp_path / name).sample_rate == pytest.approx(50.0)


@pytest.mark.parametrize("turned", [False, True])
def test_matrix_without_names(tmp_path: Path, turned: bool) -> None:
    npy, mat, h5 = (tmp_path / f"log.{ending}" for ending in ("npy", "mat", "h5"))
    columns = np.column_stack([TIME, VOLTAGE, DISPLACEMENT])
    matrix = np.ascontiguousarray(columns.T) if turned else columns
    np.save(npy, matrix)
    record = read_record(npy)
    check(record)
    assert "columns without names: taken as time = 1, voltage = 2, displacement = 3" in record.notes[0]
    named = {"time": "1", "voltage": "3", "displacement": "2"}
    np.testing.assert_array_equal(read_record(npy, columns=named).voltage, DISPLACEMENT)
    savemat(mat, {"data": matrix})
    check(read_record(mat))
    write_hdf5(h5, {"data": matrix, "other": np.zeros(3)})
    check(read_record(h5, columns={"time": "data:1", "voltage": "data:2", "displacement": "data:3"}))
    with pytest.raises(ValueError, match=r"there are the columns data:1, data:2, data:3, other"):
        read_record(h5)
    np.save(npy, matrix[:2] if turned else matrix[:, :2])
    with pytest.raises(ValueError, match="2 columns without a header, 3 are needed"):
        read_record(npy)


def test_units_that_the_file_states_and_times_of_day(tmp_path: Path) -> None:
    columns = {"t": 1e3 * TIME, "u": VOLTAGE, "x": 1e3 * DISPLACEMENT}
    write_parquet(tmp_path / "log.parquet", columns, {"t": "ms", "u": "V", "x": "nm"})
    write_hdf5(tmp_path / "log.h5", columns)
    with pytest.importorskip("h5py").File(tmp_path / "log.h5", "r+") as root:
        for name, unit in (("t", "ms"), ("u", np.bytes_("V")), ("x", "nm")):
            root[name].attrs["units"] = unit
    for name in ("log.parquet", "log.h5"):
        record = read_record(tmp_path / name)
        check(record)
        assert "column 'x [nm]': converted to µm (factor 0.001)" in record.notes
    stamps = np.datetime64("2026-03-01T12:00:00", "ns") + (1e9 * TIME).round().astype("timedelta64[ns]")
    write_parquet(tmp_path / "log.parquet", {**NAMES, "time_s": stamps})
    # Nanoseconds since 1970 have no room in a float64.
    np.testing.assert_allclose(read_record(tmp_path / "log.parquet").time, TIME, atol=1e-12)


@pytest.mark.parametrize("name", ["a.parquet", "a.pq", "a.h5", "a.hdf5", "a.mat", "A.NPY", "a.npz"])
def test_written_and_read_again_to_the_bit(tmp_path: Path, name: str) -> None:
    record = Record.from_arrays(VOLTAGE / 3.0, NAMES["displacement_um"] / 7.0, RATE)
    record.write(tmp_path / name)
    assert [file.name for file in tmp_path.iterdir()] == [name]
    again = read_record(tmp_path / name)
    np.testing.assert_array_equal(again.voltage, record.voltage)
    np.testing.assert_array_equal(again.displacement, record.displacement)
    np.testing.assert_allclose(again.time, TIME, atol=1e-12)
    assert again.sample_rate == pytest.approx(RATE)
    assert again.skipped == 1


@pytest.mark.parametrize(
    ("file", "start", "package"),
    [("log.parquet", b"", "pyarrow"), ("log.h5", b"", "h5py"), ("a.xlsx", b"PK\x03\x04", "python_calamine"),
     ("a.tdms", b"TDSm", "nptdms")],
)  # fmt: skip
def test_missing_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, start: bytes, package: str
) -> None:
    """Of a file that is read, or, where it has no content yet, written."""
    if start:
        (tmp_path / file).write_bytes(start + bytes(200))
    monkeypatch.setitem(sys.modules, package, None)
    record = Record.from_arrays(VOLTAGE, DISPLACEMENT, RATE)
    with pytest.raises(ImportError, match=rf"needs {package}, .* pip install 'piezoest\[formats\]'"):
        (read_record if start else record.write)(tmp_path / file)
    assert len(list(tmp_path.iterdir())) == bool(start)


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
    file, rng = tmp_path / "log.npy", np.random.default_rng(seed)
    index = np.sort(rng.choice(300, 300 - gaps * 4, replace=False))
    time = 3.0 + (index + jitter * rng.uniform(-1.0, 1.0, index.size)) / 1000.0
    u = np.sin(index / 9.0)
    time[rng.choice(index.size, timeless, replace=False)] = np.nan
    u[rng.choice(index.size, 5, replace=False)] = np.nan
    np.save(file, np.column_stack([time, u, index]))
    try:
        record = read_record(file)
    except ValueError as error:
        # Too much is missing, or too uneven: then it is so in blocks too.
        with pytest.raises(ValueError, match=re.escape(str(error)[-30:])):
            joined(stream_record(file, rows=rows))
        return
    stream = stream_record(file, rows=rows)
    for found, wanted in zip(joined(stream), (record.time, record.voltage, record.displacement), strict=True):
        np.testing.assert_array_equal(found, wanted)
    assert (stream.sample_rate, stream.count()) == (record.sample_rate, len(record))
    # Rows with a time are where their time says.
    known = np.flatnonzero(np.isfinite(record.displacement))
    moved = record.displacement[known] - record.displacement[known[0]]
    assert np.mean(moved == known - known[0]) > (0.8 if timeless else 0.999)


def test_stream_of_too_few_rows_says_so_at_its_end(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("\n".join(["t;u;x", *(f"0,{k:04d};{k % 7},5;{k}" for k in range(8))]))
    with pytest.raises(ValueError, match="only 8 usable rows"):
        list(stream_record(file))
    with pytest.raises(ValueError, match="rows must be a whole number of at least 1"):
        stream_record(file, rows=0)


@pytest.mark.parametrize("kind", ["csv", "npy", "parquet", "h5"])
@pytest.mark.slow_but_first
def test_memory_does_not_grow_with_the_file(tmp_path: Path, kind: str) -> None:
    if kind in ("h5", "parquet"):
        pytest.importorskip("h5py" if kind == "h5" else "pyarrow")
    n = 150_000 if kind == "csv" else 1_000_000
    time = np.arange(n) / 50_000.0
    columns = {"time_s": time, "voltage_V": np.sin(time), "displacement_um": np.cos(time)}
    file = tmp_path / f"log.{kind}"
    write_columns(file, columns)
    stream_record(file, rows=2000)  # what loads on first use does not count
    tracemalloc.start()
    try:
        stream = stream_record(file, rows=2000, sample_rate=50_000.0)
        total = sum(float(block.voltage.sum()) for block in stream)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert total == pytest.approx(float(columns["voltage_V"].sum()), rel=1e-6)
    assert peak < (3_000_000 if kind == "csv" else 24 * n / 10)


def cells(time: list[Any]) -> list[list[Any]]:
    values = [list(row) for row in zip(time, VOLTAGE.tolist(), (1e3 * DISPLACEMENT).tolist(), strict=True)]
    return [["t", "drive_V", "gauge (nm)"], *values]


@pytest.mark.parametrize("time", [TIME.tolist(), STAMPS, [stamp.time() for stamp in STAMPS]])
def test_spreadsheet(tmp_path: Path, time: list[Any]) -> None:
    check(read_record(logs.write_sheets(tmp_path / "log.xlsx", log=cells(time))))


def test_the_first_sheet_with_numbers_is_read(tmp_path: Path) -> None:
    table = [["Log of 22 November"], [], *cells(TIME.tolist())]
    first: dict[str, Any] = {"empty": [], "words": [["operator", "Ada"]]}
    file = logs.write_sheets(tmp_path / "log.xlsx", **first, log=[[None, *row] for row in table], other=table)
    check(read_record(file))
    nameless = table[3:]
    check(read_record(logs.write_sheets(file, log=[["t", "drive", "gauge"], ["s", "V", "nm"], *nameless])))
    assert len(read_record(logs.write_sheets(file, log=nameless), units={"displacement": "nm"})) == N
    with pytest.raises(ValueError, match="cannot be streamed: a spreadsheet is read as a whole"):
        stream_record(file)


def test_cells_without_numbers(tmp_path: Path) -> None:
    table = cells(TIME.tolist())
    table[8][1], table[9][2], table[10][1] = None, "N/A", " "
    record = read_record(logs.write_sheets(tmp_path / "log.xlsx", log=table))
    assert np.flatnonzero(~record.usable).tolist() == [7, 8, 9]
    table[12][1] = "off"
    with pytest.raises(ValueError, match=r"row 13, column 'drive_V': 'off' is not a number"):
        read_record(logs.write_sheets(tmp_path / "log.xlsx", log=table))


def test_frame_of_pandas() -> None:
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({"u_mV": 1e3 * VOLTAGE, "x": DISPLACEMENT})
    stamped = frame.set_index(pd.DatetimeIndex(STAMPS))
    for index in (
        stamped.index,
        pd.DatetimeIndex(STAMPS, tz="Europe/Berlin"),
        pd.to_timedelta(TIME, unit="s"),
        pd.Index(1e3 * TIME, name="Time [ms]"),
    ):
        check(Record.from_frame(frame.set_index(index)))
        check(Record.from_frame(frame.set_index(index).reset_index()))
    check(Record.from_frame(frame, sample_rate=RATE))
    twice = stamped.assign(t=TIME)
    for wrong, words in (
        (frame.set_index(pd.Index(TIME)), "frame: no column for time found; there are the columns u_mV, x"),
        (frame.assign(t=TIME, x=DISPLACEMENT + 0j), "column 'x'"),
        (twice, "columns index, t could all be the time"),
    ):
        with pytest.raises(ValueError, match=words):
            Record.from_frame(wrong)
    named = {"time": "index", "voltage": "u_mV", "displacement": "x"}
    check(Record.from_frame(twice, columns=named))


def test_frame_of_polars() -> None:
    pl = pytest.importorskip("polars")
    frame = pl.DataFrame({"u": VOLTAGE, "x_nm": 1e3 * DISPLACEMENT})
    for time in (
        pl.Series("t", TIME),
        pl.Series("When", STAMPS),
        pl.Series("when", STAMPS, pl.Datetime("ns", "UTC")),
        pl.Series("t_ms", 1e3 * TIME),
    ):
        check(Record.from_frame(frame.with_columns(time)))
    with pytest.raises(ValueError, match=r"pass frame\.collect\(\)"):
        Record.from_frame(frame.lazy())


def test_as_record_takes_what_holds_a_log(tmp_path: Path) -> None:
    pd = pytest.importorskip("pandas")
    record = Record.from_arrays(VOLTAGE, DISPLACEMENT, RATE)
    record.write(tmp_path / "log.npy")
    assert as_record(record) is record
    check(as_record(tmp_path / "log.npy"))
    options: Any = {"columns": {"voltage": "voltage_V"}, "units": {"displacement": "um"}}
    check(as_record(str(tmp_path / "log.npy"), **options))
    check(as_record(pd.DataFrame({"u": VOLTAGE, "x": DISPLACEMENT}), sample_rate=RATE))
    check(as_record(VOLTAGE, DISPLACEMENT, sample_rate=RATE))
    check(as_record(VOLTAGE.tolist(), pd.Series(DISPLACEMENT), sample_rate=RATE))


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("separator", ["\t", ";"])
@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
def test_lvm(tmp_path: Path, decimal: str, separator: str, x_columns: str) -> None:
    form: Any = {"decimal": decimal, "separator": separator, "x_columns": x_columns}
    record = read_record(logs.write_lvm(tmp_path / "log.lvm", **form))
    check(record)
    assert record.notes == ()


@pytest.mark.parametrize("goes_on", [True, False])
@pytest.mark.parametrize("x_columns", ["One", "No"])
def test_lvm_of_several_segments(tmp_path: Path, goes_on: bool, x_columns: str) -> None:
    """Time goes on, or begins anew and the clock says when."""
    parts = ((slice(0, 20), 0.0), (slice(20, 45), 0.2), (slice(45, N), 0.45))
    segments = tuple((part, t * goes_on, t * (not goes_on)) for part, t in parts)
    file = logs.write_lvm(tmp_path / "log.lvm", segments, x_columns=x_columns)
    check(read_record(file))
    for size in (1, 7, 1000):
        stream = stream_record(file, rows=size)
        np.testing.assert_array_equal(np.concatenate([block.voltage for block in stream]), VOLTAGE)
        assert stream.count() == N
    assert stream_record(file, sample_rate=RATE).count() == N


def test_tdms(tmp_path: Path) -> None:
    file = logs.write_tdms(tmp_path / "log.tdms")
    record = read_record(file)
    check(record)
    assert record.notes[0] == "sample rate of 100 Hz as the file states it"
    with pytest.raises(ValueError, match="there are the columns run/drive, run/gauge"):
        read_record(file, columns={"voltage": "nope"})
    with pytest.raises(ValueError, match="different sample rates, 2 Hz and 100 Hz"):
        read_record(logs.write_tdms(file, wf_increment=0.5))
    assert read_record(file, sample_rate=50.0).sample_rate == 50.0
