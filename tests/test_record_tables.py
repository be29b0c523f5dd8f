"""Logs from spreadsheets, DataFrames, arrays and LabVIEW, and the one that comes with the package."""

import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest.records import Record, as_record, read_record, stream_record
from tests.logs import DISPLACEMENT, RATE, TIME, VOLTAGE, N, check, write_lvm, write_sheets, write_tdms

START = datetime.datetime(2026, 11, 22, 10)
STAMPS = [START + datetime.timedelta(seconds=t) for t in TIME.tolist()]


def rows(time: list[Any], header: tuple[str, ...] = ("t", "drive_V", "gauge (nm)")) -> list[list[Any]]:
    values = [list(row) for row in zip(time, VOLTAGE.tolist(), (1e3 * DISPLACEMENT).tolist(), strict=True)]
    return [list(header), *values]


@pytest.mark.parametrize("time", [TIME.tolist(), STAMPS, [stamp.time() for stamp in STAMPS]])
def test_spreadsheet(tmp_path: Path, time: list[Any]) -> None:
    check(read_record(write_sheets(tmp_path / "log.xlsx", log=rows(time))))


def test_the_first_sheet_with_numbers_is_read(tmp_path: Path) -> None:
    table = [["Log of 22 November"], [], *rows(TIME.tolist())]
    empty_column = [[None, *row] for row in table]
    sheets: dict[str, Any] = {
        "empty": [],
        "words": [["operator", "Ada"]],
        "log": empty_column,
        "other": table,
    }
    file = write_sheets(tmp_path / "log.xlsx", **sheets)
    check(read_record(file))
    nameless = rows(TIME.tolist())[1:]
    check(read_record(write_sheets(file, log=[["t", "drive", "gauge"], ["s", "V", "nm"], *nameless])))
    assert len(read_record(write_sheets(file, log=nameless), units={"displacement": "nm"})) == N
    with pytest.raises(ValueError, match="cannot be streamed: a spreadsheet is read as a whole"):
        stream_record(file)


def test_cells_without_numbers(tmp_path: Path) -> None:
    table = rows(TIME.tolist())
    table[8][1], table[9][2], table[10][1] = None, "N/A", " "
    record = read_record(write_sheets(tmp_path / "log.xlsx", log=table))
    assert np.flatnonzero(~record.usable).tolist() == [7, 8, 9]
    table[12][1] = "off"
    with pytest.raises(ValueError, match=r"row 13, column 'drive_V': 'off' is not a number"):
        read_record(write_sheets(tmp_path / "log.xlsx", log=table))


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
    with pytest.raises(ValueError, match="column 'x'"):
        Record.from_frame(frame.assign(t=TIME, x=DISPLACEMENT + 0j))
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


def test_as_record_takes_what_holds_a_log(tmp_path: Path) -> None:
    pd = pytest.importorskip("pandas")
    record = Record.from_arrays(VOLTAGE, DISPLACEMENT, RATE)
    record.write(tmp_path / "log.npy")
    assert as_record(record) is record
    check(as_record(tmp_path / "log.npy"))
    given: Any = {"columns": {"voltage": "voltage_V"}, "units": {"displacement": "um"}}
    check(as_record(str(tmp_path / "log.npy"), **given))
    check(as_record(pd.DataFrame({"u": VOLTAGE, "x": DISPLACEMENT}), sample_rate=RATE))
    check(as_record(VOLTAGE, DISPLACEMENT, sample_rate=RATE))
    check(as_record(VOLTAGE.tolist(), pd.Series(DISPLACEMENT), sample_rate=RATE))


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("separator", ["\t", ";"])
@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
def test_lvm(tmp_path: Path, decimal: str, separator: str, x_columns: str) -> None:
    record = read_record(
        write_lvm(tmp_path / "log.lvm", decimal=decimal, separator=separator, x_columns=x_columns)
    )
    check(record)
    assert record.notes == ()


PARTS = (slice(0, 20), slice(20, 45), slice(45, N))


@pytest.mark.parametrize("rows", [1, 7, 1000])
@pytest.mark.parametrize(
    "starts",
    [
        [(0.0, 0.0), (0.20, 0.0), (0.45, 0.0)],  # time goes on
        [(0.0, 0.0), (0.0, 0.20), (0.0, 0.45)],  # time begins anew, the clock says when
    ],
)
@pytest.mark.parametrize("x_columns", ["One", "No"])
def test_lvm_of_several_segments(tmp_path: Path, starts: Any, rows: int, x_columns: str) -> None:
    segments = tuple((part, *start) for part, start in zip(PARTS, starts, strict=True))
    file = write_lvm(tmp_path / "log.lvm", segments, x_columns=x_columns)
    check(read_record(file))
    stream = stream_record(file, rows=rows)
    np.testing.assert_array_equal(np.concatenate([block.voltage for block in stream]), VOLTAGE)
    assert stream.count() == N
    assert stream_record(file, sample_rate=RATE).count() == N


def test_write_tdms(tmp_path: Path) -> None:
    file = write_tdms(tmp_path / "log.tdms")
    record = read_record(file)
    check(record)
    assert record.notes[0] == "sample rate of 100 Hz as the file states it"
    with pytest.raises(ValueError, match="there are the columns run/drive, run/gauge"):
        read_record(file, columns={"voltage": "nope"})
    with pytest.raises(ValueError, match="different sample rates, 2 Hz and 100 Hz"):
        read_record(write_tdms(file, wf_increment=0.5))
    assert read_record(file, sample_rate=50.0).sample_rate == 50.0
