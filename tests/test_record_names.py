"""What titles, header lines and cells say, as instruments, spreadsheets and programs write them."""

import bz2
import lzma
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from piezoest.records import Record, read_record
from tests.logs import ROWS, write_sheets

T, U, X = np.transpose(ROWS)
LINES = [f"{t:.4f},{u},{x}" for t, u, x in ROWS]
NM = [f"{t:.4f},{u},{1e3 * x}" for t, u, x in ROWS]
TWO = [f"{t:.4f},{u / 20.0},{u},{x}" for t, u, x in ROWS]


def written(folder: Path, lines: list[str], name: str = "log.csv") -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "header",
    [
        "t [s],x [µm],xm [µm],u [V]",
        "Time (s),Position (um),Actual (um),Voltage (V)",
        "Time (s),Position (um),Capacitive sensor (um),Voltage (V)",
        "Time (s),Vin (V),Vout (V),Position (um)",
        "t [s],u [V],u_piezo [V],x [um]",
        "t,u,u_out,x",
    ],
)
def test_what_may_only_be_commanded_is_asked_for(tmp_path: Path, header: str) -> None:
    with pytest.raises(ValueError, match=r"could all be the (voltage|displacement): name the one"):
        read_record(written(tmp_path, [header, *TWO]))


@pytest.mark.parametrize(
    "header",
    [
        "time_s,voltage/10 (V),x_um",
        "time_s,U (×20) [V],x_um",
        "time_s,u_V,10 x position (um)",
        "t_s,1/20 u [V],x_um",
    ],
)
def test_a_factor_in_a_name_is_asked_for(tmp_path: Path, header: str) -> None:
    with pytest.raises(ValueError, match="states a factor"):
        read_record(written(tmp_path, [header, *LINES]))


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["# amplifier gain: 20 V/V", "time_s,voltage_V,x_um"], "gain: 20 V/V' is not used"),
        (["# sensor 10 µm/V", "time_s,voltage_V,x_um"], "10 µm/V' is not used"),
        (["time_s,voltage_monitor_V,x_um"], "if the stage has another voltage"),
        (["time_s,voltage_V,x_um,z_um"], "taken as the displacement, and not z_um"),
    ],
)
def test_what_may_be_scaled_or_another_one_is_said(tmp_path: Path, lines: list[str], said: str) -> None:
    rows = [f"{line},7.0" if lines[-1].count(",") == 3 else line for line in LINES]
    record = read_record(written(tmp_path, [*lines, *rows]))
    assert any(said in each for each in record.notes), record.notes
    assert np.allclose(record.voltage, U)


def test_notes_on_one_column_are_one_sentence(tmp_path: Path) -> None:
    path = written(tmp_path, ["t_s,u_V,x,z_um", *(f"{line},7.0" for line in NM)])
    notes = read_record(path, units={"displacement": "nm"}).notes
    said = "column 'x': taken as the displacement, and not z_um, displacement: converted to µm (factor 0.001)"
    assert said in notes


@pytest.mark.parametrize(
    "lines",
    [
        ["Time,Voltage,Displacement", "s,V,nm", "run 1,piezo drive,capacitive"],
        ["A,B,C", "Time,Voltage,Displacement", "s,V,nm"],
        ["Time,Voltage,Displacement", "s,V,nm", "DT_DOUBLE,DT_DOUBLE,DT_DOUBLE"],
        ["time,voltage,position", ",Type: double,Type: double", "s,Units: V,Units: nm", ",Sync: a,Sync: a"],
        ["Time,Piezo,Stage", "s,Voltage (V),Position (nm)"],
        ["My experiment,,", "Date,12.11.2025,", ",,", ",,", "time_s,voltage_V,position_nm"],
        ["time_s,voltage_V,position_nm", ",,", ",,"],
        ["Время [с],Напряжение [В],Перемещение [нм]"],
    ],
)  # fmt: skip
def test_headers_of_several_lines(tmp_path: Path, lines: list[str]) -> None:
    if lines[0].startswith("Time,Piezo"):
        with pytest.raises(ValueError, match="no column for time"):
            read_record(written(tmp_path, [*lines, *NM]))
        lines = [lines[0], lines[1].replace("s,", ",", 1)]
    record = read_record(written(tmp_path, [*lines, *NM]))
    assert record.sample_rate == pytest.approx(1000.0)
    assert len(record) == len(ROWS)
    assert np.allclose(record.displacement, X)


@pytest.mark.parametrize("below", [[",50.0,6.0"], [",50.0,6.0", ",1.0,2.0"], [",,"] * 30])
def test_means_and_empty_cells_below_are_no_rows(tmp_path: Path, below: list[str]) -> None:
    record = read_record(written(tmp_path, ["time_s,voltage_V,x_um", *LINES, *below]))
    assert len(record) == len(ROWS)


def test_means_below_a_sheet_and_a_column_of_remarks(tmp_path: Path) -> None:
    header = ("time_s", "voltage_V", "x_um")
    below = write_sheets(tmp_path / "means.xlsx", Log=[header, *ROWS, (None, 50.0, 6.0)])
    record = read_record(below)
    assert len(record) == len(ROWS)
    assert f"row {len(ROWS) + 2} has no first cell" in record.notes[0]
    remarks = ((["start"] if k == 0 else [None]) + [*row] for k, row in enumerate(ROWS))
    path = write_sheets(tmp_path / "remarks.xlsx", Log=[("remark", *header), *remarks])
    assert len(read_record(path)) == len(ROWS)


@pytest.mark.parametrize(
    "header", ["Time (s),Dev1/ai0 (V),Dev1/ai1 (um)", "t_s,u_V,Axis 1 x (um)", "t_s,CH2_V,x_um"]
)
def test_names_of_channels_are_no_factors(tmp_path: Path, header: str) -> None:
    assert np.allclose(read_record(written(tmp_path, [header, *LINES])).displacement, X)


def test_units_behind_the_numbers(tmp_path: Path) -> None:
    rows = [f"{t:.4f} sec,{u} V,{1e3 * x} nm" for t, u, x in ROWS]
    record = read_record(written(tmp_path, ["Time,Voltage,Displacement", *rows]))
    assert np.allclose(record.displacement, X)
    rows[50] = rows[50].replace(" nm", " um")
    with pytest.raises(ValueError, match="line 52"):
        read_record(written(tmp_path, ["Time,Voltage,Displacement", *rows]))


@pytest.mark.parametrize(
    "word", ["#N/D", "#VALEUR!", "#¡VALOR!", "######", "1.#QNAN0", "-1.#IND00", "∞", "OVER", "***"]
)
@pytest.mark.parametrize("column", [0, 1])
def test_words_for_no_number(tmp_path: Path, word: str, column: int) -> None:
    rows = [[f"{u}", f"{x}"] for _, u, x in ROWS]
    rows[40][column] = word
    lines = ["voltage_V,x_um", *(",".join(row) for row in rows)]
    record = read_record(written(tmp_path, lines), sample_rate=1000.0)
    values = (record.voltage, record.displacement)[column]
    assert np.flatnonzero(np.isnan(values)).tolist() == [40]
    assert len(record) == len(ROWS)


def test_rows_in_another_order_and_a_change_of_the_rate_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="falls from row to row: put the rows in the order"):
        read_record(written(tmp_path, ["time_s,voltage_V,x_um", *LINES[::-1]]))
    half = len(ROWS) // 2
    times = np.concatenate([np.arange(half), half + 2.0 * np.arange(len(ROWS) - half)]) * 1e-3
    rows = [f"{t:.4f},{u},{x}" for t, (_, u, x) in zip(times, ROWS, strict=True)]
    with pytest.raises(ValueError, match="the sample rate changes, cut the log there"):
        read_record(written(tmp_path, ["time_s,voltage_V,x_um", *rows]))


@pytest.mark.parametrize("pack", [bz2.compress, lzma.compress])
def test_packed_texts(tmp_path: Path, pack: Callable[[bytes], bytes]) -> None:
    path = tmp_path / "log.csv.packed"
    path.write_bytes(pack("\n".join(["time_s,voltage_V,x_um", *LINES]).encode()))
    assert len(read_record(path)) == len(ROWS)
    whole = pack(b"time_s,voltage_V,x_um\n" + b"0,1,2\n" * 999)
    for damaged in (whole[:-20], whole[:30] + bytes(20) + whole[50:]):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="cannot be unpacked"):
            read_record(path)


def test_comments_of_blanks_between_rows(tmp_path: Path) -> None:
    rows = [line.replace(",", " ") for line in LINES]
    record = read_record(
        written(tmp_path, ["time_s voltage_V x_um", *rows[:50], "#   ", "#", "# 1 2", *rows[50:]])
    )
    assert len(record) == len(ROWS)
    assert any("'# 1 2' stands between rows" in each for each in record.notes)


def test_arrays_of_simulink_and_julia(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    t, u, x = T, U, X
    path = tmp_path / "log.jld2"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"], file["voltage"], file["displacement"] = t, u.reshape(1, 1, -1), x.reshape(-1, 1, 1)
    assert np.allclose(read_record(path).displacement, x)


def test_a_record_shows_what_it_holds_and_arrays_are_no_files() -> None:
    record = Record.from_arrays([0.0, 1.0, 2.0], [np.nan] * 3, 1000.0)
    assert repr(record).startswith(
        "Record(3 samples at 1000 Hz, 0 to 2 V, no µm, source='record', skipped=3, "
    )
    assert record == record
    assert len({record, replace(record)}) == 2
    with pytest.raises(ValueError, match=r"got ndarray: use Record\.from_arrays"):
        read_record(np.zeros(5))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="voltage needs at least 2"):
        Record.from_arrays([], [], 1000.0)
