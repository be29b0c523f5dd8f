"""Logs from spreadsheets, DataFrames and arrays, and the one that comes with the package."""

from __future__ import annotations

import datetime
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.records import Record, as_record, example_log, read_record, stream_record

N = 60
RATE = 200.0
TIME = np.arange(N) / RATE
VOLTAGE = 10.0 * np.sin(0.5 * np.arange(N))
DISPLACEMENT = 1.5 * VOLTAGE + 3.0
START = datetime.datetime(2026, 11, 22, 10)
STAMPS = [START + datetime.timedelta(seconds=t) for t in TIME.tolist()]


def check(record: Record) -> None:
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)
    np.testing.assert_allclose(record.voltage, VOLTAGE, atol=1e-12)
    np.testing.assert_allclose(record.displacement, DISPLACEMENT, atol=1e-12)
    assert record.sample_rate == pytest.approx(RATE)


# ---------------------------------------------------------------- spreadsheets


def sheets(path: Path, **tables: list[list[Any]]) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in tables.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def rows(time: list[Any], header: tuple[str, ...] = ("t", "drive_V", "gauge (nm)")) -> list[list[Any]]:
    values = [list(row) for row in zip(time, VOLTAGE.tolist(), (1e3 * DISPLACEMENT).tolist(), strict=True)]
    return [list(header), *values]


@pytest.mark.parametrize("time", [TIME.tolist(), STAMPS, [stamp.time() for stamp in STAMPS]])
def test_spreadsheet(tmp_path: Path, time: list[Any]) -> None:
    check(read_record(sheets(tmp_path / "log.xlsx", log=rows(time))))


def test_the_first_sheet_with_numbers_is_read(tmp_path: Path) -> None:
    table = [["Log of 22 November"], [], *rows(TIME.tolist())]
    empty_column = [[None, *row] for row in table]
    file = sheets(tmp_path / "log.xlsx", empty=[], words=[["operator", "Ada"]], log=empty_column, other=table)
    check(read_record(file))
    nameless = rows(TIME.tolist())[1:]
    assert len(read_record(sheets(file, log=nameless), units={"displacement": "nm"})) == N
    with pytest.raises(ValueError, match="cannot be streamed: a spreadsheet is read as a whole"):
        stream_record(file)


def test_cells_without_numbers(tmp_path: Path) -> None:
    table = rows(TIME.tolist())
    table[8][1], table[9][2], table[10][1] = None, "N/A", " "
    record = read_record(sheets(tmp_path / "log.xlsx", log=table))
    assert np.flatnonzero(~record.usable).tolist() == [7, 8, 9]
    table[12][1] = "off"
    with pytest.raises(ValueError, match=r"row 13, column 'drive_V': 'off' is not a number"):
        read_record(sheets(tmp_path / "log.xlsx", log=table))


def test_spreadsheets_that_hold_no_log(tmp_path: Path) -> None:
    file = tmp_path / "log.xlsx"
    words: list[list[Any]] = [["t", "u", "x"], ["a", "b", "c"]]
    for table in ([], words):
        with pytest.raises(ValueError, match="no sheet has a table of numbers"):
            read_record(sheets(file, log=table))
    with pytest.raises(ValueError, match="no column 'nope' for voltage; there are the columns t, drive_V"):
        read_record(sheets(file, log=rows(TIME.tolist())), columns={"voltage": "nope"})
    doubled = sheets(file, log=rows(TIME.tolist(), ("t", "x", "x")))
    with pytest.raises(ValueError, match="2 columns are called 'x': name the one for voltage by its number"):
        read_record(doubled, columns={"voltage": "x"})
    check(read_record(doubled, columns={"voltage": "2", "displacement": "3"}, units={"displacement": "nm"}))
    file.write_text("t,u,x\n" * 20)
    with pytest.raises(ValueError, match="this is no spreadsheet file, although its name ends"):
        read_record(file)


@pytest.mark.parametrize(
    ("name", "start", "package"),
    [("a.xlsx", b"PK\x03\x04", "python_calamine"), ("a.tdms", b"TDSm", "nptdms")],
)
def test_missing_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, start: bytes, package: str
) -> None:
    (tmp_path / name).write_bytes(start + bytes(200))
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=rf"needs {package}, .* pip install 'piezoest\[formats\]'"):
        read_record(tmp_path / name)


# ---------------------------------------------------------------- DataFrames


def test_frame_of_pandas() -> None:
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({"u_mV": 1e3 * VOLTAGE, "x": DISPLACEMENT})
    indices = {
        "stamps": pd.DatetimeIndex(STAMPS),
        "zone": pd.DatetimeIndex(STAMPS, tz="Europe/Berlin"),
        "durations": pd.to_timedelta(TIME, unit="s"),
        "named": pd.Index(1e3 * TIME, name="Time [ms]"),
    }
    for index in indices.values():
        check(Record.from_frame(frame.set_index(index)))
        check(Record.from_frame(frame.set_index(index).reset_index()))
    with pytest.raises(ValueError, match="frame: no column for time found; there are the columns u_mV, x"):
        Record.from_frame(frame.set_index(pd.Index(TIME)))
    check(Record.from_frame(frame, sample_rate=RATE))
    named = {"time": "index", "voltage": "1", "displacement": "x"}
    twice = frame.assign(t=TIME).set_index(indices["stamps"])
    with pytest.raises(ValueError, match="columns index, t could all be the time"):
        Record.from_frame(twice)
    check(Record.from_frame(twice, columns={**named, "voltage": "u_mV"}))


def test_frame_of_polars() -> None:
    pl = pytest.importorskip("polars")
    frame = pl.DataFrame({"u": VOLTAGE, "x_nm": 1e3 * DISPLACEMENT})
    for time in (
        pl.Series("t", TIME),
        pl.Series("When", STAMPS),
        pl.Series("when", STAMPS, pl.Datetime("ns", "UTC")),
    ):
        check(Record.from_frame(frame.with_columns(time)))
    check(Record.from_frame(frame.with_columns(pl.Series("t_ms", 1e3 * TIME))))
    with pytest.raises(ValueError, match=r"pass frame\.collect\(\)"):
        Record.from_frame(frame.lazy())


def test_missing_and_foreign_values_of_frames() -> None:
    pd, pl = pytest.importorskip("pandas"), pytest.importorskip("polars")
    holes: list[Any] = VOLTAGE.tolist()
    holes[7] = None
    for frame in (
        pd.DataFrame({"t": TIME, "u": holes, "x": DISPLACEMENT}),
        pd.DataFrame({"t": TIME, "u": pd.array(holes, "Float64"), "x": DISPLACEMENT}),
        pl.DataFrame({"t": TIME, "u": holes, "x": DISPLACEMENT}),
    ):
        record = Record.from_frame(frame)
        assert np.flatnonzero(~record.usable).tolist() == [7]
        assert record.skipped == 1
    for frame in (
        pd.DataFrame({"t": TIME, "u": ["a"] * N, "x": TIME}),
        pl.DataFrame({"t": TIME, "u": ["a"] * N, "x": TIME}),
    ):
        with pytest.raises(ValueError, match="frame, row 1, column 'u': 'a' is not a number"):
            Record.from_frame(frame)


def test_frames_with_odd_columns() -> None:
    pd = pytest.importorskip("pandas")
    matrix = np.column_stack([TIME, VOLTAGE, DISPLACEMENT])
    check(Record.from_frame(pd.DataFrame(matrix)))
    check(
        Record.from_frame(
            pd.DataFrame(
                matrix, columns=pd.MultiIndex.from_tuples([("log", "t"), ("log", "u"), ("log", "x")])
            ),
            columns={"time": "log/t", "voltage": "log/u", "displacement": "log/x"},
        )
    )
    doubled = pd.DataFrame(matrix, columns=["t", "u", "u"])
    with pytest.raises(ValueError, match="could all be the voltage"):
        Record.from_frame(doubled)
    check(Record.from_frame(doubled, columns={"voltage": "2", "displacement": "3"}))
    for empty, words in (
        (pd.DataFrame(), "no columns"),
        (pd.DataFrame({"t": [], "u": [], "x": []}), "no rows"),
    ):
        with pytest.raises(ValueError, match=words):
            Record.from_frame(empty)
    for none in (matrix, None, pd.Series(TIME), {"t": TIME}):
        with pytest.raises(ValueError, match="frame must be a DataFrame of pandas or Polars, got"):
            Record.from_frame(none)


# ---------------------------------------------------------------- whatever holds a log


def test_as_record_takes_what_holds_a_log(tmp_path: Path) -> None:
    pd = pytest.importorskip("pandas")
    record = Record.from_arrays(VOLTAGE, DISPLACEMENT, RATE)
    record.write(tmp_path / "log.npy")
    assert as_record(record) is record
    check(as_record(tmp_path / "log.npy"))
    check(
        as_record(str(tmp_path / "log.npy"), columns={"voltage": "voltage_V"}, units={"displacement": "um"})
    )
    check(as_record(pd.DataFrame({"u": VOLTAGE, "x": DISPLACEMENT}), sample_rate=RATE))
    check(as_record(VOLTAGE, DISPLACEMENT, sample_rate=RATE))
    check(as_record(VOLTAGE.tolist(), pd.Series(DISPLACEMENT), sample_rate=RATE))


@pytest.mark.parametrize(
    ("data", "given", "words"),
    [
        ((VOLTAGE,), {"sample_rate": RATE}, r"one array of shape \(60,\) and no displacement"),
        ((5,), {}, "got int"),
        (({"u": VOLTAGE},), {}, "got dict"),
        ((VOLTAGE, DISPLACEMENT), {}, "sample_rate must be given"),
        ((VOLTAGE, DISPLACEMENT[:-1]), {"sample_rate": RATE}, r"displacement must have shape \(60,\)"),
        ((VOLTAGE[:, None], DISPLACEMENT), {"sample_rate": RATE}, "voltage must have shape"),
        ((VOLTAGE, DISPLACEMENT), {"sample_rate": RATE, "units": {}}, "units does not go with this"),
        (("log.csv", DISPLACEMENT), {}, "displacement does not go with this: a file has its own"),
        ((Record.from_arrays(VOLTAGE, DISPLACEMENT, RATE),), {"sample_rate": 1.0}, "a Record has its own"),
    ],
)
def test_as_record_refuses(data: tuple[Any, ...], given: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        as_record(*data, **given)


def test_the_example_comes_with_licence_and_origin() -> None:
    path = pz.records.example_log()
    assert path.stat().st_size < 1_000_000
    assert "MIT License" in (path.parent / "LICENSE").read_text(encoding="utf-8")
    assert "yan9a/DiscreteBacklashOperator" in (path.parent / "README.md").read_text(encoding="utf-8")
    record = as_record(example_log())
    assert len(record) == 14_155
    assert record.sample_rate == pytest.approx(200.0)
    assert record.notes == ()
    assert stream_record(path, rows=1000).count() == 14_155
