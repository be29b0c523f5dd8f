"""Logs in formats other than text: what is found in them, and what is said of damaged ones."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from piezoest.records import Record, read_record, stream_record
from tests.logs import DISPLACEMENT, LOG, RATE, TIME, VOLTAGE, N, check, write_hdf5

# One sample of the displacement has no number.
NAMES = {**LOG, "displacement_um": np.where(np.arange(N) == 7, np.nan, DISPLACEMENT)}


def write_parquet(file: Path, columns: dict[str, Any], units: dict[str, str] | None = None) -> None:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    fields = [
        pa.field(
            name, pa.array(values).type, metadata={"unit": units[name]} if units and name in units else None
        )
        for name, values in columns.items()
    ]
    table = pa.table([pa.array(values) for values in columns.values()], schema=pa.schema(fields))
    pq.write_table(table, file, row_group_size=16)


def write_mat_73(file: Path, columns: dict[str, Any]) -> None:
    """As MATLAB does: HDF5 behind a block of text, row vectors as columns."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(file, "w", userblock_size=512) as root:
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
STREAMED = [name for name in WRITERS if name not in ("log.mat", "log.npz")]


@pytest.fixture(params=WRITERS)
def log(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    file = tmp_path / request.param
    WRITERS[request.param](file, NAMES)
    return file


def test_plain_log(log: Path) -> None:
    record = read_record(log)
    check(record)
    assert record.skipped == 1
    assert record.notes == ("1 sample is without usable numbers: skipped, the timing is kept",)


def test_columns_and_units(log: Path) -> None:
    named = {"time": "a", "voltage": "b", "displacement": "c"}
    WRITERS[log.name](log, dict(zip("abc", (1e3 * TIME, VOLTAGE / 20.0, 1e3 * DISPLACEMENT), strict=True)))
    units = {"time": "ms", "voltage": "20 V", "displacement": "nm"}
    record = read_record(log, columns=named, units=units)
    check(record)
    assert "displacement: converted to µm (factor 0.001)" in record.notes
    # A sample rate stands in for the column of time.
    check(read_record(log, columns={"voltage": "b", "displacement": "c"}, units=units, sample_rate=RATE))


def test_unknown_column_lists_those_that_exist(log: Path) -> None:
    for named in ({"voltage": "nope"}, {"displacement": "4"}):
        with pytest.raises(ValueError, match="no column") as caught:
            read_record(log, columns=named)
        for name in (log.name, *NAMES):
            assert name in str(caught.value)


def test_truncated_file_empty_one_and_one_of_another_format(log: Path) -> None:
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


def test_file_without_numbers_or_with_too_few(log: Path) -> None:
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
    matrix = np.column_stack([TIME, VOLTAGE, DISPLACEMENT])
    matrix = np.ascontiguousarray(matrix.T) if turned else matrix
    np.save(tmp_path / "log.npy", matrix)
    record = read_record(tmp_path / "log.npy")
    check(record)
    assert "columns without names: taken as time = 1, voltage = 2, displacement = 3" in record.notes[0]
    named = {"time": "1", "voltage": "3", "displacement": "2"}
    np.testing.assert_array_equal(read_record(tmp_path / "log.npy", columns=named).voltage, DISPLACEMENT)
    savemat(tmp_path / "log.mat", {"data": matrix})
    check(read_record(tmp_path / "log.mat"))
    write_hdf5(tmp_path / "log.h5", {"data": matrix, "other": np.zeros(3)})
    named = {"time": "data:1", "voltage": "data:2", "displacement": "data:3"}
    check(read_record(tmp_path / "log.h5", columns=named))
    with pytest.raises(ValueError, match=r"there are the columns data:1, data:2, data:3, other"):
        read_record(tmp_path / "log.h5")
    np.save(tmp_path / "two.npy", matrix[:2] if turned else matrix[:, :2])
    with pytest.raises(ValueError, match="2 columns without a header, 3 are needed"):
        read_record(tmp_path / "two.npy")


def test_units_that_the_file_states(tmp_path: Path) -> None:
    columns = {"t": 1e3 * TIME, "u": VOLTAGE, "x": 1e3 * DISPLACEMENT}
    write_parquet(tmp_path / "log.parquet", columns, {"t": "ms", "u": "V", "x": "nm"})
    h5py = pytest.importorskip("h5py")
    write_hdf5(tmp_path / "log.h5", columns)
    with h5py.File(tmp_path / "log.h5", "r+") as root:
        for name, unit in (("t", "ms"), ("u", np.bytes_("V")), ("x", "nm")):
            root[name].attrs["units"] = unit
    for name in ("log.parquet", "log.h5"):
        record = read_record(tmp_path / name)
        check(record)
        assert "column 'x [nm]': converted to µm (factor 0.001)" in record.notes


def test_times_of_day(tmp_path: Path) -> None:
    start = np.datetime64("2026-03-01T12:00:00", "ns")
    stamps = start + (1e9 * TIME).round().astype("timedelta64[ns]")
    write_parquet(tmp_path / "log.parquet", {**NAMES, "time_s": stamps.astype("datetime64[ns]")})
    # Nanoseconds since 1970 have no room in a float64.
    np.testing.assert_allclose(read_record(tmp_path / "log.parquet").time, TIME, atol=1e-12)


@pytest.mark.parametrize("name", STREAMED)
@pytest.mark.parametrize("rows", [1, 7, 16, 1000])
def test_streamed_equals_read(tmp_path: Path, name: str, rows: int) -> None:
    WRITERS[name](tmp_path / name, NAMES)
    record = read_record(tmp_path / name)
    stream = stream_record(tmp_path / name, rows=rows)
    for attribute in ("time", "voltage", "displacement"):
        together = np.concatenate([getattr(block, attribute) for block in stream])
        np.testing.assert_array_equal(together, getattr(record, attribute))
    assert (stream.sample_rate, stream.count()) == (record.sample_rate, N)
    assert max(block.voltage.size for block in stream) <= rows


@pytest.mark.parametrize("name", ["a.parquet", "a.pq", "a.h5", "a.hdf5", "a.mat", "A.NPY", "a.npz"])
def test_written_and_read_again_to_the_bit(tmp_path: Path, name: str) -> None:
    record = Record.from_arrays(VOLTAGE / 3.0, NAMES["displacement_um"] / 7.0, RATE)
    record.write(tmp_path / name)
    assert [file.name for file in tmp_path.iterdir()] == [name]
    again = read_record(tmp_path / name)
    for attribute in ("voltage", "displacement"):
        np.testing.assert_array_equal(getattr(again, attribute), getattr(record, attribute))
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
