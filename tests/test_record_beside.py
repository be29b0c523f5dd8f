"""What stands beside columns: units, names, sample rates and fill values, in files of all formats."""

import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest import Record
from piezoest.records import read_record
from tests.logs import ROWS, table

T, U, X = np.transpose(ROWS)
NM = 1e3 * X


def is_right(record: Record) -> bool:
    """Whether it is the record of `ROWS`."""
    assert record.sample_rate == pytest.approx(1000.0)
    return np.allclose(record.voltage, U) and np.allclose(record.displacement, X)


@pytest.mark.parametrize("fs", [550.0, 650.0, 700.0, 970.0])
@pytest.mark.parametrize("cut", [np.floor, np.rint])
def test_times_of_few_digits_are_even(tmp_path: Path, fs: float, cut: Any) -> None:
    path = tmp_path / "log.csv"
    rows = (f"{cut(1e3 * k / fs) / 1e3:.3f},{50 + k % 7},{4 + k % 7}" for k in range(2000))
    path.write_text("time_s,u_V,x_um\n" + "\n".join(rows), encoding="utf-8")
    record = read_record(path)
    assert record.sample_rate == pytest.approx(fs, rel=1e-3)
    assert len(record) == 2000
    assert "taken as even" in record.notes[-1]


@pytest.mark.parametrize("fs", [680.0, 850.0, 950.0])
def test_few_digits_beside_missing_rows_are_asked_for(tmp_path: Path, fs: float) -> None:
    path = tmp_path / "log.csv"
    kept = np.flatnonzero(np.random.default_rng(1).random(2000) > 0.02)
    rows = (f"{k / fs:.3f},{50 + k % 7},{4 + k % 7}" for k in kept)
    path.write_text("time_s,u_V,x_um\n" + "\n".join(rows), encoding="utf-8")
    with pytest.raises(ValueError, match="too few digits; give the sample rate"):
        read_record(path)


@pytest.mark.parametrize("missing", [np.arange(1000, 1012), np.random.default_rng(0).integers(1, 1999, 100)])
def test_rows_that_are_missing_are_not_a_matter_of_digits(tmp_path: Path, missing: Any) -> None:
    path = tmp_path / "log.csv"
    rows = (f"{k / 1e3:.3f},{50 + k % 7},{4 + k % 7}" for k in range(2000) if k not in missing)
    path.write_text("time_s,u_V,x_um\n" + "\n".join(rows), encoding="utf-8")
    record = read_record(path)
    assert record.sample_rate == 1000.0
    assert np.flatnonzero(np.isnan(record.voltage)).tolist() == np.unique(missing).tolist()


@pytest.mark.parametrize(
    ("head", "rate"),
    [
        ("# fs = 500 mHz", 0.5),
        ("# Abtastzeit: 2 ms", 500.0),
        ("# sampling frequency: 2 kS/s", 2000.0),
        ("# fs: 10 kHz\n# decimation: 10", None),
        ("# fs: 10 kHz\n# every 10th sample", None),
    ],
)
def test_a_rate_beside_the_columns(tmp_path: Path, head: str, rate: float | None) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f"{head}\nvoltage_V,displacement_um\n{table('{u:.1f},{x:.3f}')}", encoding="utf-8")
    if rate is not None:
        assert read_record(path).sample_rate == rate
        return
    with pytest.raises(ValueError, match="sample rate"):
        read_record(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# voltage in V, displacement in nm\ntime_s,voltage,displacement\n", "nm"),
        ("# Einheiten: s, V, nm\ntime_s,u,x,n\n", "nm"),
        ("# Position unit: nm\nTime (s),Voltage (V),Position\n", "nm"),
        ("Time,Setpoint,Input,Output\n", "Input, Output could all be"),
        ("time_s,voltage_V,position,position_actual\n", "position, position_actual could all be"),
        ("# t, sens, drive_cmd, n\n", "no column for voltage"),
        ("t_s,u_V,x (a.u.),n\n", "no unit of displacement"),
        ("t_s,u_V,sensor1,gap_um\n", "no column for displacement"),
    ],
)
def test_what_is_not_sure_is_asked(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "log.csv"
    more = ",1" * (text.splitlines()[-1].count(",") - 2)
    path.write_text(text + table("{t},{u},{x}" + more), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        read_record(path)


def test_a_column_that_counts_rows_is_not_time(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_text(table("{k} {t} {u} {x}"), encoding="utf-8")
    with pytest.raises(ValueError, match="the first counts the rows"):
        read_record(path)
    path.write_text("# fs = 1000\n" + table("{k} {u} {x}"), encoding="utf-8")
    assert is_right(read_record(path))


def test_a_row_with_a_cell_missing_between_blanks_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    lines = ["t_s u_V x_um", *table("{t:.4f} {u:.1f} {x:.3f}").splitlines()]
    lines[11] = lines[11].replace(" 53.0", "     ")
    path.write_text("\n".join(lines), encoding="utf-8")
    record = read_record(path)
    assert np.flatnonzero(np.isnan(record.voltage)).tolist() == [10]
    assert np.isnan(record.displacement[10])


@pytest.mark.parametrize(
    "stamp",
    ["22-11-2026 10:00:{0:06.3f}", "2026-11-22_10:00:{0:06.3f}", "[2026-11-22 10:00:{0:06.3f}]",
     "2026-11-22 10:00:{0:06.3f} CET", "20261122100000.{1:03d}", "63900000{1:03d}0000000"],
)  # fmt: skip
def test_clocks_of_other_kinds(tmp_path: Path, stamp: str) -> None:
    path = tmp_path / "log.csv"
    rows = (f"{stamp.format(k / 1e3, k)},{u},{x}" for k, (_, u, x) in enumerate(ROWS))
    path.write_text("time,voltage,displacement\n" + "\n".join(rows), encoding="utf-8")
    rate = read_record(path).sample_rate
    assert rate == pytest.approx(1.0 if stamp.startswith("639") else 1000.0, rel=1e-4)


def test_units_and_names_beside_arrays(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, data=np.column_stack([T, NM, U]), names="t, x, u", units=["s", "nm", "V"])
    assert is_right(read_record(path))
    np.savez(path, t=T, u=U, x=NM, displacement_unit=np.bytes_("nm"))
    with pytest.raises(ValueError, match="stands 'displacement_unit: nm'"):
        read_record(path)
    assert is_right(read_record(path, units={"displacement": "nm"}))
    np.savez(path, u=U, x=X, dt=1e-3)
    assert is_right(read_record(path))
    np.savez(path, u=U, x=X, fs=1e4, decimation=10)
    with pytest.raises(ValueError, match="only some samples were kept"):
        read_record(path)


def test_what_stands_beside_datasets(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")

    def read(attributes: dict[str, Any], **data: Any) -> Record:
        with h5py.File(tmp_path / "log.h5", "w") as file:
            file.attrs.update(attributes)
            for name, values in data.items():
                file[name] = values
                if isinstance(values, np.ndarray) and values.dtype == np.uint16:
                    file[name].attrs["MATLAB_class"] = np.bytes_("char")
        return read_record(tmp_path / "log.h5")

    matrix = np.column_stack([T, NM, U])
    assert is_right(read({"columns": "time, x, voltage"}, data=np.column_stack([T, X, U])))
    assert is_right(read({"columns": "time, x, voltage"}, data=matrix, data_units=["s", "nm", "V"]))
    text = np.array([list(map(ord, "nm"))], np.uint16)
    assert is_right(read({}, t=T, u=U, x=NM, x_unit=text))  # as MATLAB 7.3 writes text
    with pytest.raises(ValueError, match="displacement_unit: nm"):
        read({"displacement_unit": "nm"}, t=T, u=U, x=NM)
    with pytest.raises(ValueError, match="sample rates"):
        read({"fs": 1e4, "sample_rate": 1e3}, u=U, x=X)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"], file["u"], file["x"] = T, U, np.where(np.arange(T.size) == 3, -9999.0, X)
        file["x"].attrs["_FillValue"] = -9999.0
    assert np.flatnonzero(np.isnan(read_record(tmp_path / "log.h5").displacement)).tolist() == [3]
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"], file["u"], file["x"] = T, U, np.rint(NM).astype(np.int16)
        file["x"].attrs["scale"] = 1e-3
    with pytest.raises(ValueError, match="what 1 in it stands for"):
        read_record(tmp_path / "log.h5")


def test_frames_and_sheets(tmp_path: Path) -> None:
    pandas, openpyxl = pytest.importorskip("pandas"), pytest.importorskip("openpyxl")
    clock = [datetime.time(10, 0, 0, 1000 * k) for k in range(T.size)]
    assert is_right(Record.from_frame(pandas.DataFrame({"time": clock, "voltage": U, "displacement": X})))
    mixed = pandas.DataFrame({"time": pandas.Series([0, *clock[1:]], dtype=object), "u": U, "x": X})
    with pytest.raises(ValueError, match="several kinds of times"):
        Record.from_frame(mixed)
    frame = pandas.DataFrame({"time": T, "voltage": U, "displacement": NM})
    frame.attrs["units"] = {"displacement": "nm"}
    with pytest.raises(ValueError, match="beside the columns"):
        Record.from_frame(frame)
    book = openpyxl.Workbook()
    for row in (["s", "V", "nm"], ["Time", "Voltage", "Position"], *zip(T, U, NM, strict=True)):
        book.active.append(list(row))
    book.create_sheet("notes").append(["by hand"])
    book.save(tmp_path / "log.xlsx")
    record = read_record(tmp_path / "log.xlsx")
    assert is_right(record)
    assert "sheet 'Sheet' of 2 is read" in record.notes
