"""Files whose names, units or missing values were once taken for something else."""

from pathlib import Path

import numpy as np
import pytest

from piezoest.records import read_record, read_reference

ROWS = [(0.001 * k, 50.0 + k % 7, 4.6 + 0.01 * (k % 7)) for k in range(60)]
TABLE = "\n".join(f"{1e3 * t:.1f} {1e3 * x:.2f} {1e3 * u:.1f}" for t, u, x in ROWS)


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        pytest.param(
            f"# t[ms] x[nm] u[mV]\n# run 3\n# 2025-11-12 10:11\n{TABLE}", {}, id="names above other comments"
        ),
        pytest.param(
            "Zeit [s] Spannung [V] Weg [nm] Soll Temp Kraft\n"
            + "\n".join(f"{t:.4f} {u:.4f} {1e3 * x:.3f} 1,5 21,5 1,25".replace(".", ",") for t, u, x in ROWS),
            {},
            id="decimal commas between blanks",
        ),
        pytest.param(
            "Run 12\nTime;Voltage;Position;Force\nms;V;nm;N\n"
            + "\n".join(f"{1e3 * t:.1f};{u:.1f};{1e3 * x:.2f};1.5" for t, u, x in ROWS),
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
    rows = "\n".join(f"{u:.1f},{x:.3f}" for _, u, x in ROWS)
    path.write_text(
        f"Scope 12\nSample rate: 10 kHz, 2 channels\nvoltage_V,displacement_um\n{rows}", encoding="utf-8"
    )
    assert read_record(path).sample_rate == 10e3


@pytest.mark.parametrize("stated", ["Sample rate: 50,000 Hz", "Sample rate,1,000"])
def test_a_rate_that_is_cut_at_its_comma_is_not_taken(tmp_path: Path, stated: str) -> None:
    path = tmp_path / "log.csv"
    rows = "\n".join(f"{u:.1f},{x:.3f}" for _, u, x in ROWS)
    path.write_text(f"Scope 12\n{stated}\nvoltage_V,displacement_um\n{rows}", encoding="utf-8")
    with pytest.raises(ValueError, match="sample rate"):
        read_record(path)


def test_more_columns_than_are_wanted_need_numbers(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(f"{t:.3f},{u:.1f},{x:.3f},{x:.3f}" for t, u, x in ROWS), encoding="utf-8")
    with pytest.raises(ValueError, match="name voltage and displacement by their numbers"):
        read_record(path, sample_rate=1000.0)
    read_record(path)
    path.write_text("\n".join(f"{t:.3f},{u:.1f}" for t, u, _ in ROWS), encoding="utf-8")
    assert read_reference(path, sample_rate=1000.0).values[0] == ROWS[0][1]
