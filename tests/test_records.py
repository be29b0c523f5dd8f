"""Recorded logs: what is recognised, what is refused, and in which words."""

import os
from pathlib import Path

import numpy as np
import pytest

from piezoest.records import Record, read_record, read_reference, write_columns
from tests.logs import DISPLACEMENT, RATE, TIME, VOLTAGE, N, check

HEADER = "time_s,voltage_V,displacement_um"


def log(folder: Path, header: str = HEADER, **changes: str) -> Path:
    """Write a good log; `changes` replaces whole lines: line5="..."."""
    lines = [header] if header else []
    lines += [f"{t:.3f},{u:.6f},{x:.6f}" for t, u, x in zip(TIME, VOLTAGE, DISPLACEMENT, strict=True)]
    for name, text in changes.items():
        lines[int(name.removeprefix("line")) - 1] = text
    file = folder / "log.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize(
    "header",
    [HEADER, "t,u,x", "Time (s),Voltage (V),Position (µm)", "Time [s], Drive [V], Gauge [um]",
     "# a comment\nt/s,u/V,x/µm", '"time","voltage","displacement"', "t_s,channel 1 (V),channel 2 (um)",
     "\ufefftime_s,u_V,x_um", ""],
)  # fmt: skip
def test_headers_that_are_recognised(tmp_path: Path, header: str) -> None:
    check(read_record(log(tmp_path, header)))


@pytest.mark.parametrize("separator", [";", "\t", "|", "  "])
def test_other_delimiters_with_decimal_comma(tmp_path: Path, separator: str) -> None:
    file = log(tmp_path)
    file.write_text(file.read_text().replace(",", separator).replace(".", ","))
    check(read_record(file))


def test_columns_by_name_and_number(tmp_path: Path) -> None:
    file = log(tmp_path, "a,b_V,c")
    check(read_record(file, columns={"time": 1, "voltage": "b", "displacement": "3"}))  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="columns must be a mapping"):
        read_record(file, columns="voltage=2")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "line", ["0.080,nan,1.0", "0.080,1.0,", "0.080,,", "0.080", "0.080,inf,1.0", ",,", "", "0.08, N/A ,1"]
)
def test_rows_without_numbers_are_kept_as_nan_and_counted(tmp_path: Path, line: str) -> None:
    record = read_record(log(tmp_path, line10=line))
    assert record.skipped == 1
    assert np.flatnonzero(~record.usable).tolist() == [8]
    assert any("1 sample is without usable numbers" in note for note in record.notes)
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)


@pytest.mark.parametrize("share", [0.09, 0.2, 0.4])
def test_rows_lost_all_over_a_log_are_missing_samples(tmp_path: Path, share: float) -> None:
    t = np.arange(4000) / 1000.0
    kept = np.random.default_rng(0).random(4000) > share
    kept[[0, -1]] = True
    file = tmp_path / "lost.csv"
    np.savetxt(file, np.column_stack([t, np.sin(t), t])[kept], header="t,u,x", delimiter=",", comments="")
    record = read_record(file)
    assert len(record) == 4000
    assert record.skipped == np.count_nonzero(~kept)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"line7": "0.050,text,1.0"}, ["log.csv, line 7", "column 'voltage_V'", "'text' is not a number"]),
        ({"line9": "0.060,1,1", "line20": "0.170,1,1"}, ["line 9", "does not increase", "2 rows", "digits"]),
        ({"line9": "0.001,1,1"}, ["line 9", "time does not increase"]),
        ({"line2": "1700000000.005,1,1"}, ["line 3", "after 1700000000.005 s"]),
        ({"line12": "0.1045,1,1"}, ["line 12", "unevenly", "0.01 s is usual"]),
        ({"line12": "0,100,1,5,1,5"}, ["line 12", "6 fields", "3"]),
        ({"line2": "s,V,kg"}, ["line 2", "not a number"]),
        ({"line12": '0.100,"0.1,0.1'}, ["quotation mark"]),
        ({"line61": "9.0,1,1"}, ["line 61", "time jumps by", "missing in all"]),
        ({"line1": "time_s,current_A,displacement_um"}, ["no column for voltage", "time_s, current_A"]),
        ({"line1": "time_s,voltage_V,gauge_V"}, ["gauge_V", "such as µm"]),
        ({"line1": "t,u,x,position"}, ["columns x, position could all be the displacement"]),
    ],
)
def test_refusals_name_place_and_reason(tmp_path: Path, changes: dict[str, str], words: list[str]) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        read_record(log(tmp_path, **changes))
    assert [word for word in words if word not in str(caught.value)] == []


@pytest.mark.parametrize("written_twice", [False, True])
def test_a_repeated_time_stamp_is_read_and_said(tmp_path: Path, written_twice: bool) -> None:
    file = log(tmp_path)
    lines = file.read_text().splitlines()
    if written_twice:
        lines.insert(8, lines[7])
    else:
        lines[8] = lines[7].partition(",")[0] + "," + lines[8].partition(",")[2]
    file.write_text("\n".join(lines))
    record = read_record(file)
    check(record)
    (note,) = record.notes
    assert "the first in line 9" in note
    assert record.skipped == 0


def test_what_had_to_be_assumed_is_noted(tmp_path: Path) -> None:
    for line, words in (("0.080,1,1", "unit taken as"), ("0.0808,1,1", "uneven")):
        assert any(words in note for note in read_record(log(tmp_path, "t,u,x", line10=line)).notes)
    assert not read_record(log(tmp_path), sample_rate=RATE).notes
    (note,) = read_record(log(tmp_path), sample_rate=5.0 * RATE).notes
    assert "ignored" in note


def test_files_without_a_log(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    contents = {
        "": "is empty",
        "\n# only this\n": "is empty",
        "t,u,x\n": "no rows below the header",
        "t,u,x\n0,0,0\n": "1 row",
        "t,u,x\n" + "nan,nan,nan\n" * 200: "only",
        "\n".join(map(str, range(100))): "1 column ",
        "t,u,x\n" + "".join(f"{t},1.5,nan\n" for t in range(50)): "no number in column 'x'",
        "Dear colleague,\nhere are\nthe data\n": "no column for",
        "PK\x03\x04\0\0\0\0": "not a text file",
    }
    for text, words in contents.items():
        file.write_text(text)
        with pytest.raises(ValueError, match=words):
            read_record(file)
    with pytest.raises(FileNotFoundError):
        read_record(tmp_path / "none.csv")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.csv")
        with pytest.raises(ValueError, match=r"pipe\.csv: a log is read more than once"):
            read_record(tmp_path / "pipe.csv")


def test_round_trip(tmp_path: Path) -> None:
    voltage = VOLTAGE.copy()
    voltage[3] = np.inf
    record = Record.from_arrays(voltage, DISPLACEMENT, RATE)
    assert "1 sample" in record.notes[0]
    assert record.duration == pytest.approx(N / RATE)
    record.write(tmp_path / "out.csv")
    again = read_record(tmp_path / "out.csv")
    voltage[3] = np.nan
    np.testing.assert_allclose(again.voltage, voltage, rtol=1e-8)
    assert again.skipped == 1
    with pytest.raises(ValueError, match="displacement must be as long as the voltage"):
        Record.from_arrays(VOLTAGE, DISPLACEMENT[:-1], RATE)
    for time in (TIME[::-1], 2.0 * TIME):
        with pytest.raises(ValueError, match="time has steps of"):
            Record(time, VOLTAGE, DISPLACEMENT, RATE)


def test_reference(tmp_path: Path) -> None:
    file = tmp_path / "r.csv"
    write_columns(file, {"time_s": TIME, "reference_um": DISPLACEMENT, "displacement_um": VOLTAGE})
    signal = read_reference(file)
    np.testing.assert_allclose(signal.values, DISPLACEMENT, rtol=1e-8)
    assert signal.sample_rate == pytest.approx(RATE)
    np.testing.assert_allclose(read_reference(file, units={"reference": "nm"}).values * 1e3, DISPLACEMENT)
    np.testing.assert_allclose(read_reference(file, column="displacement_um").values, VOLTAGE, atol=1e-7)
    write_columns(file, {"time_s": np.delete(TIME, 20), "reference_um": np.delete(DISPLACEMENT, 20)})
    with pytest.raises(ValueError, match="line 22: time jumps here"):
        read_reference(file)
    file.write_text("r_um\n" + "\n".join(["1"] * 20 + ["nan"] + ["1"] * 20))
    with pytest.raises(ValueError, match="line 22: no number"):
        read_reference(file, sample_rate=10.0)
