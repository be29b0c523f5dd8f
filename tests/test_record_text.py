"""Text logs as instruments write them: lines above, marks in numbers, time stamps, footers, oscilloscopes."""

import gzip
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
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


def write(
    path: Path, separator: str, rows: Sequence[tuple[str, ...]], header: str = "t,u,x", above: str = ""
) -> Path:
    """Rows below a header, or below lines as they are."""
    lines = [above or header.replace(",", separator), *(separator.join(row) for row in rows)]
    path.write_text("\n".join(line for line in lines if line) + "\n", encoding="utf-8")
    return path


def rows_of(write_number: Callable[[float], str] = str) -> list[tuple[str, ...]]:
    columns = (TIME, VOLTAGE, DISPLACEMENT)
    return [tuple(map(write_number, row)) for row in zip(*columns, strict=True)]


def clocked(start: str, form: str) -> list[tuple[str, ...]]:
    """Rows with time stamps as strftime writes them, and %L for milliseconds."""
    stamps = [datetime.fromisoformat(start) + timedelta(seconds=t) for t in TIME]
    texts = [each.strftime(form.replace("%L", f"{each.microsecond // 1000:03d}")) for each in stamps]
    return [(text, *row[1:]) for text, row in zip(texts, rows_of(), strict=True)]


def check(path: Path, scale: float = 1.0) -> tuple[str, ...]:
    """Check a file whose units are that large; returns the notes."""
    record = read_record(path)
    np.testing.assert_allclose(record.time - record.time[0], scale * TIME, atol=1e-12)
    np.testing.assert_array_equal(record.voltage, scale * VOLTAGE)
    np.testing.assert_array_equal(record.displacement, scale * DISPLACEMENT)
    assert record.sample_rate == pytest.approx(RATE / scale)
    return record.notes


def streamed(path: Path, rows: int, attribute: str = "voltage") -> Any:
    return np.concatenate([getattr(block, attribute) for block in stream_record(path, rows=rows)])


PREAMBLE = "Oscilloscope DSO-X\nDate,2026-11-01\nSample rate,1000\n\n"
NAMES = "time,voltage,displacement"


@pytest.mark.parametrize(
    "above",
    [PREAMBLE + "t,u,x", f"{PREAMBLE}{NAMES}\ns,V,um", f"Instrument: Scope 3000\n{NAMES}\ns,V,um",
     "Scope of the laboratory\nt (s),u (volts),position (micrometers)", f"{NAMES}\n[s],[V],",
     f"s,V,um\n{NAMES}", f"SCOPE-A,1234,Waveform\nSegment,TrigTime,Since\n{NAMES}",
     "% from MATLAB\n  % t u x"],
)  # fmt: skip
def test_lines_of_an_instrument_above_the_rows(tmp_path: Path, above: str) -> None:
    check(write(tmp_path / "log.csv", ",", rows_of(), above=above))


@pytest.mark.parametrize(
    "above",
    ["# t[ms] U[mV] x[nm]", "# date\n# t (ms)  U (mV)  x (nm)", "# t U x\n# ms mV nm",
     "# t [ms], U [mV], x [nm]", "t (ms)  drive voltage (mV)  x (nm)", '# a 5" stage\n# t[ms] U[mV] x[nm]',
     "t{ms} U{mV} x<nm>", "t U x\n# ms mV nm", f"{NAMES}\nms,mV,nm"],
)  # fmt: skip
def test_names_and_units_above_the_rows(tmp_path: Path, above: str) -> None:
    check(write(tmp_path / "log.txt", "," if above.startswith(NAMES) else " ", rows_of(), above=above), 1e-3)


@pytest.mark.parametrize("other", ["r[nm]", "temperature[K]"])
def test_names_in_a_comment_with_one_column_more(tmp_path: Path, other: str) -> None:
    rows = [("7.5", *row) for row in rows_of()]
    check(write(tmp_path / "log.txt", " ", rows, above=f"# {other} t[ms] U[mV] x[nm]"), 1e-3)


@pytest.mark.parametrize(
    "comment", ["measured by me", "t x y", "a b c", "1 2 3", "fs = 10", "voltage and position"]
)
def test_a_comment_that_names_no_columns_is_none(tmp_path: Path, comment: str) -> None:
    notes = check(write(tmp_path / "log.txt", " ", rows_of(), above=f"# {comment}"))
    assert "columns without names" in notes[0]


def test_what_the_lines_above_leave_open_is_asked_for(tmp_path: Path) -> None:
    file = write(tmp_path / "log.txt", " ", rows_of(), above="# set[V] monitor[V] x[um]")
    with pytest.raises(ValueError, match="could all be the voltage"):
        read_record(file, sample_rate=10.0)
    write(file, ",", rows_of(), above="Scope\nDate,2026-11-01")
    with pytest.raises(ValueError, match="1, 2, 3"):
        read_record(file)
    record = read_record(file, columns={"time": "1", "voltage": "2", "displacement": "3"})
    np.testing.assert_array_equal(record.voltage, VOLTAGE)


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
    [GCS, "# fs = 200 Hz\nu,x", "% Sample rate [kHz]: 0.2\n% u [V], x [um]",
     "# dt = 5 ms\nvoltage,position of stage"],
)  # fmt: skip
def test_sample_rate_in_a_comment(tmp_path: Path, above: str) -> None:
    notes = check(write(tmp_path / "log.csv", ",", [row[1:] for row in rows_of()], above=above))
    assert "as the file states it" in notes[0]


def grouped(value: float, mark: str = ",") -> str:
    return f"{value:,.3f}".replace(",", mark)


def german(value: float, mark: str = ".") -> str:
    return f"{value:,.3f}".translate(str.maketrans(",.", f"{mark},"))


@pytest.mark.parametrize(
    ("separator", "write_number"),
    [
        (",", lambda value: f'"{grouped(value)}"'),
        (";", grouped),
        ("\t", grouped),
        (";", german),
        (",", lambda value: f'"{german(value)}"'),
        (";", lambda value: grouped(value, " ")),
        (",", lambda value: grouped(value, "\N{NARROW NO-BREAK SPACE}")),
        (";", lambda value: german(value, "'")),
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


def test_a_comma_that_only_may_be_for_decimals_is_said(tmp_path: Path) -> None:
    rows = [(str(k), "60", f"{1234 + k:,}") for k in range(N)]
    for said in (True, False):
        notes = read_record(write(tmp_path / "log.csv", ";", rows)).notes
        assert any("'1,234'" in note for note in notes) == said
        rows[9] = ("9", "60", "1,5")


def test_marks_that_appear_late(tmp_path: Path) -> None:
    rows = [(str(k), "60", str(k % 990)) for k in range(10_100)]
    file = write(tmp_path / "log.csv", ";", rows)
    assert not any("comma" in note for note in read_record(file).notes)
    rows[10_050] = ("10050", "60", "1,234")
    with pytest.raises(ValueError, match="'1,234' beside '0'"):
        read_record(write(file, ";", rows))
    # 1,234 would be 1234 or 1.234, and the rows before say nothing of it.
    rows = [(f"{k / 10:.1f}", "1.5", "1") for k in range(10_100)]
    rows[10_040] = ("1004.0", "1,234.5", "1 234")  # of which there is no doubt
    assert read_record(write(file, ";", rows)).voltage[10_040] == 1234.5
    rows[10_050] = ("1005.0", "1,234", "1")
    with pytest.raises(ValueError, match="line 10052, column 'u': '1,234' is not a number"):
        read_record(write(file, ";", rows))


@pytest.mark.parametrize(
    "form",
    ["%Y-%m-%dT%H:%M:%S.%f000", "%Y-%m-%d %H:%M:%S.%L", "%Y-%m-%dT%H:%M:%S.%f000Z",
     "%Y-%m-%dT%H:%M:%S.%f+01:00", "%Y-%m-%dT%H:%M:%S,%f-0530", "%Y/%m/%dT%H:%M:%S.%f000",
     "%d.%m.%Y %H:%M:%S,%f000", "%H:%M:%S.%f000", "%m/%d/%Y %H:%M:%S.%L AM", "%d/%m/%Y %H:%M:%S.%L",
     "%H:%M:%S.%Lam", "%d-Nov-%Y %H:%M:%S.%L", "%d november %Y %H:%M:%S.%L", "Nov %d, %Y %H:%M:%S.%L",
     "Sun Nov %d %H:%M:%S.%L %Y", "%Y%m%dT%H%M%S.%f000", "%m/%d/%y %H:%M:%S.%L", "%d.%m.%y %H:%M:%S.%L",
     "%H:%M:%S:%L", "%M:%S.%f000", "0:%S.%f000"],
)  # fmt: skip
@pytest.mark.parametrize("header", ["t_ms,u,x", "When,u,x", ""])
def test_time_stamps(tmp_path: Path, form: str, header: str) -> None:
    notes = check(write(tmp_path / "log.csv", ";", clocked("2026-11-22T10:00:00", form), header))
    assert not any("'t" in note for note in notes)


@pytest.mark.parametrize(
    ("start", "form"),
    [
        ("2026-11-22T23:59:59.8", "%H:%M:%S.%f"),
        ("2026-11-22T23:59:59.8", "%I:%M:%S.%f %p"),
        ("2026-11-22T11:59:59.8", "%m/%d/%Y %I:%M:%S.%f %p"),
        ("2026-11-22T10:59:59.8", "%M:%S.%f"),
    ],
)
def test_time_goes_on_where_the_clock_begins_anew(tmp_path: Path, start: str, form: str) -> None:
    rows = clocked(start, form)
    file = write(tmp_path / "log.csv", ",", rows)
    assert any("line 42: the clock" in note for note in check(file)) == ("/" not in form)
    np.testing.assert_allclose(streamed(file, 7, "time"), TIME, atol=1e-12)
    with pytest.raises(ValueError, match="does not increase"):
        read_record(write(file, ",", rows[:30] + rows[:30]))


@pytest.mark.parametrize("separator", [",", " "])
@pytest.mark.parametrize("footer", ["End of file", "\nMean: 1 2 3\nMax,4,5,6", "t,u,x", "\x1a", "-----"])
def test_a_footer_is_left_out_and_said(tmp_path: Path, separator: str, footer: str) -> None:
    rows = rows_of()
    file = write(tmp_path / "log.txt", separator, [*rows, (footer,)])
    stream = stream_record(file, sample_rate=RATE, rows=7)
    assert sum(block.time.size for block in stream) == stream.count() == N
    for notes in (stream.notes, check(file)):
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
    assert len(read_record(file)) == streamed(file, 1).size == 1160
    with pytest.raises(ValueError, match="'end' is not a number"):
        read_record(write(file, ",", [*rows, *[("end",)] * 21]))


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
    np.testing.assert_array_equal(streamed(packed, 7), VOLTAGE)
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
    for row, cells in ((100, (word, "N/A")), (200, (" 1e400 ", "-inf")), (300, ('"2.5"', "NaN"))):
        rows[row] = (rows[row][0], *cells)
    file = write(tmp_path / "log.csv", separator, rows)
    lines = file.read_text().splitlines()
    lines[2000:2000] = ["# the amplifier was off", "", ""]
    file.write_text("\n".join(lines) + "\n\n# end\n")
    record = read_record(file)
    # Blank rows are lost samples unless time goes on without them.
    assert (len(record), record.skipped) == (3000, 3)
    numbers[100, 1:] = numbers[200, 1:] = numbers[300, 2] = np.nan
    numbers[300, 1] = 2.5
    np.testing.assert_array_equal(record.voltage, numbers[:, 1])
    np.testing.assert_array_equal(record.displacement, numbers[:, 2])
    for size in (7, 50, 4000):
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
    stamps = [str(1_764_400_000 * per_second + round(t * per_second)) for t in TIME]
    rows = [(stamp, *row[1:]) for stamp, row in zip(stamps, rows_of(), strict=True)]
    for header in ("timestamp,u,x", ""):
        log = stream_record(write(tmp_path / "log.csv", ",", rows, header))
        assert log.sample_rate == pytest.approx(RATE)
        assert any(f"taken as {unit} since 1970" in note for note in log.notes)
    assert read_record(tmp_path / "log.csv", units={"time": "s"}).sample_rate < RATE / 900.0


# Files of oscilloscopes, which measure volts: which channel is what, and of which unit, is asked for.
BARE = [f"{u},{x}" for u, x in zip(VOLTAGE, DISPLACEMENT, strict=True)]
ROWS = [f"{t:.6e},{row}" for t, row in zip(TIME - 0.02, BARE, strict=True)]
SEQUENCE = [f"{k},{row}" for k, row in enumerate(BARE)]
WITH_UNITS = "time [s],voltage [V],position [um]"
TEKTRONIX = [
    "Model,MSO2024", "", "Horizontal Units,S,", "Sample Interval,5e-03,", f"Record Length,{N},",
    "Gating,0.0% to 100.0%,", "Vertical Units,V,V", "Label,,", "TIME,CH1,CH2",
]  # fmt: skip
SIGLENT = [
    f"Record Length,Analog:{N}", "Vertical Units,CH1:V,CH2:V", "Horizontal Units,s", "Source,CH1,CH2",
    "Second,Volt,Volt",
]  # fmt: skip
BESIDE = [
    f"Record Length,{N},", "Sample Interval,5e-3,", ",,", "Source,CH{},", "Vertical Units,V,",
    "Horizontal Units,s,", *[",,"] * (N - 6),
]  # fmt: skip


def beside(channel: int, values: np.ndarray) -> list[str]:
    lines = (line.format(channel) for line in BESIDE)
    return [f"{line},{t:017.12f},{v:10.5f}," for line, t, v in zip(lines, TIME - 0.02, values, strict=True)]


LOGS = {
    "rigol": ["X,CH1,CH2,Start,Increment,", "Sequence,Volt,Volt,0.0,5e-3,", *(f"{r}," for r in SEQUENCE)],
    "rigol, padded": ["X,CH1,CH2,Start,Increment", "Sequence,Volt,Volt,0.0,5e-3",
                      *(f"{row},," for row in SEQUENCE)],
    "rigol, increment": ["CH1(V),CH2(V),t0 = -2e-02, tInc = 5e-03,", *(f"{row},," for row in BARE)],
    "rigol, V": ["CH1V,CH2V,t0 =-2e-02, tInc = 5e-03,", *BARE],
    "keysight": ["x-axis,1,2", "second,Volt,Volt", *ROWS],
    "tektronix": [*TEKTRONIX, *ROWS],
    "siglent": [*SIGLENT, *ROWS],
    "tektronix, beside": [a + b for a, b in zip(beside(1, VOLTAGE), beside(2, DISPLACEMENT), strict=True)],
    "tektronix, quoted": [f'"{name}",{N},"Points",{row}'
                          for name, row in zip(["Record Length", *[""] * N], ROWS, strict=False)],
}  # fmt: skip


def written(folder: Path, lines: list[str], end: str = "\n") -> Path:
    file = folder / "log.csv"
    file.write_bytes(end.join(lines).encode())
    return file


@pytest.mark.parametrize("scope", LOGS)
def test_channels_in_volts_are_asked_for(tmp_path: Path, scope: str) -> None:
    file = written(tmp_path, [*LOGS[scope], ""], "\r\n")
    channels = "" if scope == "keysight" else "CH"
    named = {"voltage": f"{channels}1", "displacement": f"{channels}2"}
    with pytest.raises(ValueError, match="could all be the voltage, and none is a displacement") as caught:
        read_record(file)
    assert str(named) in str(caught.value)
    with pytest.raises(ValueError, match="no unit of displacement"):
        read_record(file, columns=named)
    record = read_record(file, columns=named, units={"displacement": "2 um"})
    assert record.sample_rate == pytest.approx(RATE)
    np.testing.assert_allclose(record.voltage, VOLTAGE)
    np.testing.assert_allclose(record.displacement, 2.0 * DISPLACEMENT)
    assert any("1 in it is taken as 2 µm" in note for note in record.notes)


def test_a_sensor_in_millivolts_is_said(tmp_path: Path) -> None:
    file = written(tmp_path, ["Time,Channel A,Channel B", "(s),(V),(mV)", "", *ROWS])
    named = {"voltage": "Channel A", "displacement": "Channel B"}
    record = read_record(file, columns=named, units={"displacement": "2 nm"})
    np.testing.assert_allclose(record.displacement, 2e-3 * DISPLACEMENT)
    assert "column 'Channel B [mV]': 1 in it is taken as 0.002 µm" in record.notes


def test_a_stated_rate_that_time_does_not_have_is_said(tmp_path: Path) -> None:
    for rate, said in ((200, 0), (1000, 1)):
        record = read_record(written(tmp_path, [f"Sample rate,{rate} Hz", "", WITH_UNITS, *ROWS]))
        assert record.sample_rate == pytest.approx(RATE)
        assert sum("is ignored: time has 200 Hz" in note for note in record.notes) == said
    file = written(tmp_path, ["Sample rate,10 kHz", "", "voltage [V],position [um]", *BARE])
    assert read_record(file).sample_rate == 10_000.0


def test_what_only_looks_like_a_scopes_file_is_none(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no column for displacement found"):
        read_record(written(tmp_path, beside(1, VOLTAGE)))  # one channel alone
    named = [f"{WITH_UNITS},Start,Increment", *(f"{row},1,2" for row in ROWS)]
    for lines in (named, [f"Record Length,{N},,,,", WITH_UNITS, *ROWS]):
        np.testing.assert_array_equal(read_record(written(tmp_path, lines)).displacement, DISPLACEMENT)
    lines = ["Voltage step,0.5", "Increment,0.5", "voltage [V],position [um]", *BARE]
    with pytest.raises(ValueError, match="sample rate"):
        read_record(written(tmp_path, lines))
