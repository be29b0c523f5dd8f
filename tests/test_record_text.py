"""Text logs as instruments and spreadsheets write them: marks in numbers, time stamps, packed files."""

import datetime
import gzip
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest.records import read_record, read_reference, stream_record

N = 80
RATE = 200.0
TIME = np.arange(N) / RATE
VOLTAGE = np.round(1500.0 * np.sin(np.arange(N) / 9.0), 3)
DISPLACEMENT = np.round(2.5 * VOLTAGE, 3)
START = np.datetime64("2026-11-22T10:00:00", "ns")
STAMPS = [str(START + np.timedelta64(round(1e9 * t), "ns")) for t in TIME]


def write(
    path: Path, separator: str, rows: Sequence[tuple[str, ...]], header: str = "t,u,x", above: str = ""
) -> Path:
    """Rows below a header, or below lines as they are."""
    lines = [above or header.replace(",", separator), *(separator.join(row) for row in rows)]
    path.write_text("\n".join(line for line in lines if line) + "\n", encoding="utf-8")
    return path


def rows_of(write_number: Callable[[float], str]) -> list[tuple[str, ...]]:
    columns = (TIME, VOLTAGE, DISPLACEMENT)
    return [tuple(map(write_number, row)) for row in zip(*columns, strict=True)]


def check(path: Path) -> None:
    record = read_record(path)
    np.testing.assert_allclose(record.time - record.time[0], TIME, atol=1e-12)
    np.testing.assert_array_equal(record.voltage, VOLTAGE)
    np.testing.assert_array_equal(record.displacement, DISPLACEMENT)
    assert record.sample_rate == pytest.approx(RATE)


def check_thousandths(path: Path) -> None:
    """Check a file with times in ms, voltages in mV and displacements in nm."""
    record = read_record(path)
    assert record.sample_rate == pytest.approx(1e3 * RATE)
    np.testing.assert_allclose(record.voltage, 1e-3 * VOLTAGE)
    np.testing.assert_allclose(record.displacement, 1e-3 * DISPLACEMENT)


PREAMBLE = "Oscilloscope DSO-X\nDate,2026-11-01\nSample rate,1000\n\n"


@pytest.mark.parametrize(
    "above",
    [
        PREAMBLE + "t,u,x",
        PREAMBLE + "time,voltage,displacement\ns,V,um",
        "Instrument: Scope 3000\ntime,voltage,displacement\ns,V,um",
        "Scope of the laboratory\nt (s),u (volts),position (micrometers)",
        "time,voltage,displacement\n[s],[V],",
        "s,V,um\ntime,voltage,displacement",
        "SCOPE-A,1234,Waveform\nSegment,TrigTime,Since\ntime,voltage,displacement",
        "% from MATLAB\n  % t u x",
    ],
)
def test_lines_of_an_instrument_above_the_rows(tmp_path: Path, above: str) -> None:
    check(write(tmp_path / "log.csv", ",", rows_of(str), above=above))


@pytest.mark.parametrize(
    ("separator", "above"),
    [
        (",", "time,voltage,displacement\nms,mV,nm"),
        (" ", "# t[ms] U[mV] x[nm]"),
        (" ", "# date\n# t (ms)  U (mV)  x (nm)"),
        (" ", "# t U x\n# ms mV nm"),
        (" ", "# t [ms], U [mV], x [nm]"),
        (" ", "t (ms)  drive voltage (mV)  x (nm)"),
        (" ", '# a 5" stage\n# t[ms] U[mV] x[nm]'),
        (" ", "t{ms} U{mV} x<nm>"),
        (" ", "t U x\n# ms mV nm"),
    ],
)
def test_names_and_units_above_the_rows(tmp_path: Path, separator: str, above: str) -> None:
    check_thousandths(write(tmp_path / "log.txt", separator, rows_of(str), above=above))


COMMENTS = (
    "# measured by me", "# t x y", "# a b c", "# 1 2 3", "# fs = 10", "# voltage and position",
)  # fmt: skip


@pytest.mark.parametrize("comment", COMMENTS)
def test_a_comment_that_names_no_columns_is_none(tmp_path: Path, comment: str) -> None:
    file = write(tmp_path / "log.txt", " ", rows_of(str), above=comment)
    check(file)
    assert "columns without names" in read_record(file).notes[0]


@pytest.mark.parametrize("other", ["r[nm]", "temperature[K]"])
def test_names_in_a_comment_with_one_column_more(tmp_path: Path, other: str) -> None:
    rows = [("7.5", *row) for row in rows_of(str)]
    check_thousandths(write(tmp_path / "log.txt", " ", rows, above=f"# {other} t[ms] U[mV] x[nm]"))


def test_two_voltages_in_a_comment_are_asked_for(tmp_path: Path) -> None:
    file = write(tmp_path / "log.txt", " ", rows_of(str), above="# set[V] monitor[V] x[um]")
    with pytest.raises(ValueError, match="could all be the voltage"):
        read_record(file, sample_rate=10.0)


GCS = """# REM E-727
# SEPARATOR = 44
# DIM = 2
# SAMPLE_TIME = 0.005
#
# NAME1 = Actual Position of Axis 1
# NAME0 = Output Voltage of channel 1
# END_HEADER"""


@pytest.mark.parametrize(
    "above",
    [
        GCS,
        "# fs = 200 Hz\nu,x",
        "% Sample rate [kHz]: 0.2\n% u [V], x [um]",
        "# dt = 5 ms\nvoltage,position of stage",
    ],
)
def test_sample_rate_in_a_comment(tmp_path: Path, above: str) -> None:
    file = write(tmp_path / "log.csv", ",", [row[1:] for row in rows_of(str)], above=above)
    check(file)
    assert "as the file states it" in read_record(file).notes[0]


def test_rows_below_other_lines_without_a_header_go_by_number(tmp_path: Path) -> None:
    file = write(tmp_path / "log.csv", ",", rows_of(str), above="Scope\nDate,2026-11-01")
    with pytest.raises(ValueError, match="1, 2, 3"):
        read_record(file)
    record = read_record(file, columns={"time": "1", "voltage": "2", "displacement": "3"})
    np.testing.assert_array_equal(record.voltage, VOLTAGE)


def german(value: float) -> str:
    return f"{value:,.3f}".translate(str.maketrans(",.", ".,"))


@pytest.mark.parametrize(
    ("separator", "write_number"),
    [
        (",", lambda value: f'"{value:,.3f}"'),
        (";", lambda value: f"{value:,.3f}"),
        ("\t", lambda value: f"{value:,.3f}"),
        (";", german),
        (",", lambda value: f'"{german(value)}"'),
        (";", lambda value: f"{value:,.3f}".replace(",", " ")),
        (",", lambda value: f"{value:,.3f}".replace(",", "\N{NARROW NO-BREAK SPACE}")),
        (";", lambda value: german(value).replace(".", "'")),
    ],
)
@pytest.mark.parametrize("header", ["t,u,x", ""])
def test_separators_of_thousands(tmp_path: Path, separator: str, write_number: Any, header: str) -> None:
    check(write(tmp_path / "log.csv", separator, rows_of(write_number), header))


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("mark", [".", ","])
def test_whole_numbers_beside_groups_of_three_are_refused(tmp_path: Path, separator: str, mark: str) -> None:
    rows = [(str(k), f"{60 + k}", f"{13 * k * k + 400:,}".replace(",", mark)) for k in range(N)]
    with pytest.raises(ValueError, match="thousands"):
        read_record(write(tmp_path / "log.csv", separator, rows))


def test_groups_of_three_that_appear_late_are_refused(tmp_path: Path) -> None:
    rows = [(str(k), "60", str(k % 990)) for k in range(10_100)]
    file = write(tmp_path / "log.csv", ";", rows)
    assert not any("comma" in note for note in read_record(file).notes)
    rows[10_050] = ("10050", "60", "1,234")
    with pytest.raises(ValueError, match="'1,234' beside '0'"):
        read_record(write(file, ";", rows))


def test_a_comma_that_only_may_be_for_decimals_is_said(tmp_path: Path) -> None:
    rows = [(str(k), "60", f"{1234 + k:,}") for k in range(N)]
    assert any("'1,234'" in note for note in read_record(write(tmp_path / "log.csv", ";", rows)).notes)
    rows[9] = ("9", "60", "1,5")
    assert not any("'1,234'" in note for note in read_record(write(tmp_path / "log.csv", ";", rows)).notes)


def test_a_mark_that_appears_late_is_no_number(tmp_path: Path) -> None:
    # 1,234 would be 1234 or 1.234, and the rows before say nothing of it.
    rows = [(f"{k / 10:.1f}", "1.5", "1") for k in range(10_100)]
    rows[10_040] = ("1004.0", "1,234.5", "1 234")  # of which there is no doubt
    assert read_record(write(tmp_path / "log.csv", ";", rows)).voltage[10_040] == 1234.5
    rows[10_050] = ("1005.0", "1,234", "1")
    with pytest.raises(ValueError, match="line 10052, column 'u': '1,234' is not a number"):
        read_record(write(tmp_path / "log.csv", ";", rows))


def day_first(stamp: str) -> str:
    day, time = stamp.split("T")
    return ".".join(part.lstrip("0") for part in reversed(day.split("-"))) + " " + time.replace(".", ",")


@pytest.mark.parametrize(
    "write_stamp",
    [
        lambda text_: text_,
        lambda text_: text_.replace("T", " ")[:-6],
        lambda text_: text_ + "Z",
        lambda text_: text_[:-3] + "+01:00",
        lambda text_: text_[:-3].replace(".", ",") + "-0530",
        lambda text_: text_.replace("-", "/"),
        day_first,
        lambda text_: text_.partition("T")[2],
        lambda text_: f"11/22/2026 {text_[11:-6]} AM",
        lambda text_: f"22/11/2026 {text_[11:-6]}",
        lambda text_: f"{text_[11:-6]}am",
        lambda text_: f"22-Nov-2026 {text_[11:-6]}",
        lambda text_: f"22 november 2026 {text_[11:-6]}",
        lambda text_: f"Nov 22, 2026 {text_[11:-6]}",
        lambda text_: f"Sun Nov 22 {text_[11:-6]} 2026",
        lambda text_: text_.replace("-", "").replace(":", ""),
        lambda text_: f"11/22/26 {text_[11:-6]}",
        lambda text_: f"22.11.26 {text_[11:-6]}",
        lambda text_: text_[11:23].replace(".", ":"),
        lambda text_: text_[14:],
        lambda text_: text_[15:],
    ],
)
@pytest.mark.parametrize("header", ["t_ms,u,x", "When,u,x", ""])
def test_time_stamps(tmp_path: Path, write_stamp: Callable[[str], str], header: str) -> None:
    rows = [
        (write_stamp(t), f"{u:.3f}", f"{x:.3f}")
        for t, u, x in zip(STAMPS, VOLTAGE, DISPLACEMENT, strict=True)
    ]
    file = write(tmp_path / "log.csv", ";", rows, header)
    check(file)
    assert not any("'t" in note for note in read_record(file).notes)


@pytest.mark.parametrize(
    ("start", "written"),
    [
        ("2026-11-22T23:59:59.8", "%H:%M:%S.%f"),
        ("2026-11-22T23:59:59.8", "%I:%M:%S.%f %p"),
        ("2026-11-22T11:59:59.8", "%m/%d/%Y %I:%M:%S.%f %p"),
        ("2026-11-22T10:59:59.8", "%M:%S.%f"),
    ],
)
def test_time_goes_on_where_the_clock_begins_anew(tmp_path: Path, start: str, written: str) -> None:
    stamps = [(datetime.datetime.fromisoformat(start) + datetime.timedelta(seconds=t)) for t in TIME]
    rows = [(stamp.strftime(written), *row[1:]) for stamp, row in zip(stamps, rows_of(str), strict=True)]
    file = write(tmp_path / "log.csv", ",", rows)
    check(file)
    assert any("line 42: the clock" in note for note in read_record(file).notes) == ("/" not in written)
    stream = stream_record(file, rows=7)
    np.testing.assert_allclose(np.concatenate([block.time for block in stream]), TIME, atol=1e-12)
    write(file, ",", rows[:30] + rows[:30])
    with pytest.raises(ValueError, match="does not increase"):
        read_record(file)


@pytest.mark.parametrize("separator", [",", " "])
@pytest.mark.parametrize("footer", ["End of file", "\nMean: 1 2 3\nMax,4,5,6", "t,u,x", "\x1a", "-----"])
def test_a_footer_is_left_out_and_said(tmp_path: Path, separator: str, footer: str) -> None:
    rows = rows_of(str)
    file = write(tmp_path / "log.txt", separator, [*rows, (footer,)])
    check(file)
    stream = stream_record(file, sample_rate=RATE, rows=7)
    assert sum(block.time.size for block in stream) == stream.count() == N
    for notes in (stream.notes, read_record(file).notes):
        assert sum(" is no row" in note for note in notes) == 1
    # Whole numbers in it say nothing of the marks in rows.
    write(file, separator, [*((t, "1.125", "2.250") for t, *_ in rows), ("Mean:", "1", "2")])
    assert len(read_record(file)) == N
    # A row behind it: the log is torn there, and does not end.
    write(file, separator, [*rows[:40], (footer,), *rows[40:]])
    with pytest.raises(ValueError, match=r"is not a number|fields"):
        read_record(file)


def test_a_long_footer_in_a_file_of_several_blocks(tmp_path: Path) -> None:
    rows = [(f"{k / 10:.1f}", "1.5", "1.25") for k in range(1160)]
    file = write(tmp_path / "log.csv", ",", [*rows, ("mean", "1.5", "1.25"), *[("-" * 20,)] * 19])
    assert len(file.read_text()) > 1 << 14 > len(file.read_text()) - 400  # the first block ends within
    assert len(read_record(file)) == sum(block.time.size for block in stream_record(file, rows=1)) == 1160
    write(file, ",", [*rows, *[("end",)] * 21])
    with pytest.raises(ValueError, match="'end' is not a number"):
        read_record(file)


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1"]
)
def test_encodings_and_packed_text(tmp_path: Path, encoding: str) -> None:
    lines = ["t_s;u_V;Weg [µm]", *(";".join(row) for row in rows_of(lambda value: f"{value:.3f}"))]
    plain, packed = tmp_path / "log.csv", tmp_path / "log.csv.gz"
    plain.write_bytes("\r\n".join(lines).encode(encoding))
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    check(plain)
    check(packed)
    stream = stream_record(packed, rows=7)
    np.testing.assert_array_equal(np.concatenate([block.voltage for block in stream]), VOLTAGE)
    assert read_reference(packed, column="Weg").sample_rate == pytest.approx(RATE)
    packed.write_bytes(packed.read_bytes()[:-30])
    with pytest.raises(ValueError, match=r"log\.csv\.gz: cannot be unpacked"):
        read_record(packed)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
# The second is a cell that pandas does not read, which sends its whole block the careful way.
@pytest.mark.parametrize("word", ["", "none "])
def test_every_bit_of_a_number_and_what_stands_between(tmp_path: Path, separator: str, word: str) -> None:
    numbers = np.random.default_rng(0).normal(0.0, 1.0, (3000, 3)) * [1.0, 1e-3, 1e6]
    numbers[:, 0] = np.arange(3000) / RATE
    rows = [tuple(map(repr, row)) for row in numbers.tolist()]
    rows[100] = (rows[100][0], word, "N/A")
    rows[200] = (rows[200][0], " 1e400 ", "-inf")
    rows[300] = (rows[300][0], '"2.5"', "NaN")
    file = write(tmp_path / "log.csv", separator, rows)
    lines = file.read_text().splitlines()
    lines[2000:2000] = ["# the amplifier was off", "", ""]
    file.write_text("\n".join(lines) + "\n\n# end\n")
    record = read_record(file)
    # Blank rows are lost samples unless time goes on without them.
    assert len(record) == 3000
    assert record.skipped == 3
    wanted = numbers.copy()
    wanted[100, 1:] = wanted[200, 1:] = wanted[300, 2] = np.nan
    wanted[300, 1] = 2.5
    np.testing.assert_array_equal(record.voltage, wanted[:, 1])
    np.testing.assert_array_equal(record.displacement, wanted[:, 2])
    for size in (1, 50, 4000):
        stream = stream_record(file, rows=size)
        np.testing.assert_array_equal(np.concatenate([block.voltage for block in stream]), record.voltage)
        assert (stream.sample_rate, stream.count()) == (record.sample_rate, 3000)
    rows[2500] = (rows[2500][0], "text", "1")
    with pytest.raises(ValueError, match="line 2502, column 'u': 'text' is not a number"):
        read_record(write(file, separator, rows))


@pytest.mark.parametrize(("unit", "per_second"), [("ms", 10**3), ("µs", 10**6), ("ns", 10**9)])
def test_time_stamps_since_1970_have_the_unit_of_their_size(
    tmp_path: Path, unit: str, per_second: int
) -> None:
    """They were taken as seconds, and the sample rate was a thousandth or less."""
    stamps = [str(1_764_400_000 * per_second + round(t * per_second)) for t in TIME]
    numbers = [(str(u), str(x)) for u, x in zip(VOLTAGE, DISPLACEMENT, strict=True)]
    rows = [(stamp, *pair) for stamp, pair in zip(stamps, numbers, strict=True)]
    for header in ("timestamp,u,x", ""):
        log = stream_record(write(tmp_path / "log.csv", ",", rows, header))
        assert log.sample_rate == pytest.approx(RATE)
        assert any(f"taken as {unit} since 1970" in note for note in log.notes)
    assert read_record(tmp_path / "log.csv", units={"time": "s"}).sample_rate < RATE / 900.0
