"""Files whose names, units or missing values were once taken for something else."""

from pathlib import Path

import numpy as np
import pytest

from piezoest.records import read_record, read_reference
from tests.logs import ROWS, table

TABLE = table("{ms:.1f} {nm:.2f} {mv:.1f}")


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        pytest.param(
            f"# t[ms] x[nm] u[mV]\n# run 3\n# 2025-11-12 10:11\n{TABLE}", {}, id="names above other comments"
        ),
        pytest.param(
            "Zeit [s] Spannung [V] Weg [nm] Soll Temp Kraft\n"
            + table("{t:.4f} {u:.4f} {nm:.3f} 1,5 21,5 1,25").replace(".", ","),
            {},
            id="decimal commas between blanks",
        ),
        pytest.param(
            "Run 12\nTime;Voltage;Position;Force\nms;V;nm;N\n" + table("{ms:.1f};{u:.1f};{nm:.2f};1.5"),
            {},
            id="a unit that is not known",
        ),
        pytest.param(
            "Time_ms_ Position_nm_ Drive_mV_\n" + TABLE,
            {"time": "Time", "displacement": "Position", "voltage": "Drive"},
            id="names of MATLAB",
        ),
        pytest.param(
            "t [ms],x [㎚],u [mV]\n" + TABLE.replace(" ", ",") + "\n" + 40 * "\0",
            {},
            id="zeros after a loss of power",
        ),
        pytest.param(
            "# column 1: t [ms]\n# column 2: x [nm]\n# column 3: u [mV]\n" + TABLE, {}, id="a comment each"
        ),
        pytest.param(f"# t[ms] x[nm] u[mV] -- by hand\n{TABLE}", {}, id="names among other words"),
        pytest.param("time-ms;position-nm;drive-mV\n" + TABLE, {"voltage": "drive"}, id="parted otherwise"),
        pytest.param(
            "time (ms)\tPosition (Âµm)\tvoltage (mV)\n" + table("{ms:.1f}\t{x:.5f}\t{mv:.1f}"),
            {},
            id="wrong encoding",
        ),
        pytest.param("0,1,2\n" + table("{t:.4f},{u:.4f},{x:.5f}"), {}, id="counted"),
        pytest.param(
            "time,voltage,displacement\n" + table("0 days 00:00:{t:09.6f},{u:.4f},{x:.5f}"),
            {},
            id="durations",
        ),
        pytest.param(
            "time,voltage,displacement\n" + table("2026/1/2 9:05:{t:06.3f} UTC,{u:.4f},{x:.5f}"),
            {},
            id="a zone",
        ),
        pytest.param(
            "# Units: ms, nm, mV\ntime,displacement,voltage\n" + TABLE.replace(" ", ","),
            {},
            id="line of units",
        ),
        pytest.param(
            '"t","u","x"\n' + table('"{k}",{t},{u},{x}'),
            {},
            id="numbers of rows from R",
        ),
        pytest.param(
            "Time [ ms ],Error [mm],Output [mV],Position [nanometer]\n"
            + table("{ms:.1f},0.5,{mv:.1f},{nm:.2f}"),
            {"voltage": "Output"},
            id="a name of two quantities",
        ),
    ],
)
def test_names_and_units_are_found(tmp_path: Path, text: str, columns: dict[str, str]) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    record = read_record(path, columns=columns)
    assert record.sample_rate == pytest.approx(1000.0)
    np.testing.assert_allclose(record.voltage[:60], [row[1] for row in ROWS])
    np.testing.assert_allclose(record.displacement[:60], [row[2] for row in ROWS])


def test_a_row_that_begins_with_an_error_of_a_spreadsheet_is_no_comment(tmp_path: Path) -> None:
    lines = [f"{u:.1f},{x:.3f}" for _, u, x in ROWS]
    lines[20], lines[21] = "#N/A,4.6", "51.0,#DIV/0!"
    path = tmp_path / "log.csv"
    comments = ["#NAME0 = Voltage", "#NA = 0.5", "#NVALUES 60"]
    path.write_text("\n".join([*comments, "voltage_V,displacement_um", *lines]), encoding="utf-8")
    record = read_record(path, sample_rate=1000.0)
    assert len(record) == len(ROWS)
    assert np.isnan([record.voltage[20], record.displacement[21]]).all()


def test_a_rate_beside_other_numbers_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = table("{u:.1f},{x:.3f}")
    path.write_text(
        f"Scope 12\nSample rate: 10 kHz, 2 channels\nvoltage_V,displacement_um\n{rows}", encoding="utf-8"
    )
    assert read_record(path).sample_rate == 10e3


@pytest.mark.parametrize(
    "stated",
    ["Sample rate: 50,000 Hz", "Sample rate,1,000", "Sample rate (Hz): 50 000", "fs = 1\nfs unit = kHz"],
)
def test_a_rate_that_is_cut_at_its_comma_is_not_taken(tmp_path: Path, stated: str) -> None:
    path = tmp_path / "log.csv"
    rows = table("{u:.1f},{x:.3f}")
    path.write_text(f"Scope 12\n{stated}\nvoltage_V,displacement_um\n{rows}", encoding="utf-8")
    with pytest.raises(ValueError, match="sample rate"):
        read_record(path)


def test_more_columns_than_are_wanted_need_numbers(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(table("{t:.3f},{u:.1f},{x:.3f},{x:.3f}"), encoding="utf-8")
    with pytest.raises(ValueError, match="name voltage and displacement by their numbers"):
        read_record(path, sample_rate=1000.0)
    read_record(path)
    path.write_text(table("{t:.3f},{u:.1f}"), encoding="utf-8")
    assert read_reference(path, sample_rate=1000.0).values[0] == ROWS[0][1]


@pytest.mark.parametrize(
    ("header", "form", "columns", "message"),
    [
        ("t [s],u [V],x [counts]", "{t},{u},{x}", {"displacement": "x [counts]"}, "no unit of displacement"),
        ("t [s],u [V],x [0.1 µm]", "{t},{u},{x}", {"displacement": "x [0.1 µm]"}, "no unit of displacement"),
        ("t,u,x_nm_raw", "{t},{u},{x}", {"displacement": "x_nm_raw"}, "no unit of displacement"),
        ("t,u,x [10^-9 m]", "{t},{u},{x}", {"displacement": "x [10^-9 m]"}, "no unit of displacement"),
        ("# x in nm\nt,u,x", "{t},{u},{x}", {}, "beside the columns stands '# x in nm'"),
        ("t,u,x,,u,x", "{t},{u},{x},,{u},{x}", {}, "give the number of the one that is, 2 or 5"),
        ("t [s],u [V],Error [nm]", "{t},{u},{x}", {}, "no column for displacement"),
        ("# t, position, amplifier", "{t},{x},{u}", {}, "no column for voltage"),
        (",0,1,2", "0,{t},{u},{x}", {}, "no column for time"),
        ("t,u,x", "{k}000000,{u},{x}", {}, "such as 'ns' or '100 ns': units={'time': 'ns'}"),
        ("t,u,x", "{day:.12f},{u},{x}", {}, "such as 'days' or '100 ns': units={'time': 'days'}"),
    ],
)
def test_what_is_not_sure_is_refused(
    tmp_path: Path, header: str, form: str, columns: dict[str, str], message: str
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f"{header}\n{table(form)}", encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        read_record(path, columns=columns)


def test_the_first_column_without_a_name_must_rise_as_time_does(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(table("{u:.4f},{x:.5f},{x:.5f}"), encoding="utf-8")
    with pytest.raises(ValueError, match="does not rise as time does"):
        read_record(path, sample_rate=1000.0)


@pytest.mark.parametrize(("stated", "rate"), [("# fs = 1000,5 Hz", 1000.5), ("# fs: 2,5 kHz", 2500.0)])
def test_a_rate_is_written_as_the_rows_are(tmp_path: Path, stated: str, rate: float) -> None:
    path = tmp_path / "log.xls"  # a text, in spite of its name
    rows = [f"{u:.1f};{x:.3f}".replace(".", ",") for _, u, x in ROWS]
    path.write_text("\n".join([stated, "voltage_V;displacement_um", *rows]), encoding="utf-8")
    assert read_record(path).sample_rate == rate
    path.write_text("\n".join(["# fs = 1.000 Hz", "voltage_V;displacement_um", *rows]), encoding="utf-8")
    with pytest.raises(ValueError, match="sample rate"):
        read_record(path)


@pytest.mark.parametrize("stated", ["Sample Interval,0.5,ms", "Sample rate;2;kHz", "fs: 2 kHz"])
def test_a_rate_with_its_unit_in_a_cell_of_its_own(tmp_path: Path, stated: str) -> None:
    path = tmp_path / "log.csv"
    rows = table("{u:.1f},{x:.3f}")
    path.write_text(f"Scope 12\n{stated}\nvoltage_V,displacement_um\n{rows}", encoding="utf-8")
    assert read_record(path).sample_rate == 2000.0


def test_names_and_units_beside_arrays(tmp_path: Path) -> None:
    t, u, x = np.transpose(ROWS)
    path = tmp_path / "log.npz"
    np.savez(path, data=np.column_stack([t, x, u]), columns=["t", "x", "u"])
    record = read_record(path)
    np.testing.assert_allclose(record.voltage, u)
    np.testing.assert_allclose(record.displacement, x)
    np.savez(path, t=t, u=u, x=1e3 * x, x_unit="nm")
    np.testing.assert_allclose(read_record(path).displacement, x)


def test_a_rate_beside_its_unit(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["voltage"], file["position"] = ([row[k] for row in ROWS] for k in (1, 2))
        file["sample_rate"] = 2.0
        file["sample_rate"].attrs["unit"] = "kHz"
        file["position"].attrs["scale_factor"], file["position"].attrs["add_offset"] = 2.0, 1.0
    record = read_record(path)
    assert record.sample_rate == 2000.0
    np.testing.assert_allclose(record.displacement, [2.0 * row[2] + 1.0 for row in ROWS])
    with h5py.File(path, "a") as file:
        file["sample_rate"].attrs["unit"] = "1/min"
    with pytest.raises(ValueError, match="sample rate"):
        read_record(path)


@pytest.mark.parametrize(("text", "kind"), [('{"t": 0.0, "u": 1.0}\n', "JSON"), ("<html><table>\n", "HTML")])
def test_a_text_that_is_no_table(tmp_path: Path, text: str, kind: str) -> None:
    path = tmp_path / "log.xls"
    path.write_text(50 * text, encoding="utf-8")
    with pytest.raises(ValueError, match=f"this is {kind}.*save the log as CSV"):
        read_record(path)


def test_names_and_units_in_attributes_of_a_matrix(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    t, u, x = np.transpose(ROWS)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["data"] = np.column_stack([1e3 * t, 1e3 * x, u])
        file["data"].attrs["columns"] = ["time", "position", "voltage"]
        file["data"].attrs["Units"] = ["ms", "nm", "V"]
    record = read_record(tmp_path / "log.h5")
    assert record.sample_rate == pytest.approx(1000.0)
    np.testing.assert_allclose(record.voltage, u)
    np.testing.assert_allclose(record.displacement, x)
