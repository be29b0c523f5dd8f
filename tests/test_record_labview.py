"""LabVIEW's logs: .lvm with its headers, and TDMS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from piezoest.records import Record, read_record, stream_record

N = 60
RATE = 1000.0
TIME = np.arange(N) / RATE
VOLTAGE = np.round(10.0 * np.sin(0.5 * np.arange(N)), 6)
DISPLACEMENT = np.round(1.5 * VOLTAGE + 3.0, 6)
FILE_HEADER = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\t{name}
Decimal_Separator\t{decimal}
Multi_Headings\tYes
X_Columns\t{x_columns}
Time_Pref\tRelative
Operator\tAda
Date\t2026/11/22
Time\t10:00:00,0
***Start_Special***
Channels\t99
***End_Special***
***End_of_Header***\t
"""
SEGMENT = """\t
Channels\t2\t\t
Samples\t{samples}\t{samples}\t
Date\t2026/11/22\t2026/11/22\t
Time\t10:00:{second:012.9f}\t10:00:{second:012.9f}\t
Y_Unit_Label\tVolts\tum\t
X_Dimension\tTime\tTime\t
X0\t{x_0}\t{x_0}\t
Delta_X\t0.001\t{second_step}\t
***End_of_Header***\t\t\t
{names}
"""


def lvm(
    path: Path,
    segments: tuple[tuple[slice, float, float], ...] = ((slice(0, N), 0.0, 0.0),),
    *,
    decimal: str = ".",
    separator: str = "\t",
    x_columns: str = "One",
    names: str = "X_Value\tDrive\tPosition\tComment",
    second_step: str = "0.001",
    dated: bool = True,
) -> Path:
    """Write a .lvm file of segments: rows, X of the first row, seconds of the clock."""
    word = {"\t": "Tab", ";": "Semicolon"}[separator]
    content = FILE_HEADER.format(name=word, decimal=decimal, x_columns=x_columns)
    for part, x_0, second in segments:
        count = len(range(N)[part])
        content += SEGMENT.format(samples=count, second=second, x_0=x_0, names=names, second_step=second_step)
        for k, (u, x) in enumerate(zip(VOLTAGE[part], DISPLACEMENT[part], strict=True)):
            t = f"{x_0 + k / RATE:.6f}"
            row = {"No": ["", f"{u:.6f}", f"{x:.6f}"], "Multi": [t, f"{u:.6f}", t, f"{x:.6f}"]}
            cells = row.get(x_columns, [t, f"{u:.6f}", f"{x:.6f}"])
            content += "\t".join(cells) + ("\tbegins" if k == 0 and "Comment" in names else "") + "\n"
    if not dated:
        content = "\n".join(line for line in content.split("\n") if not line.startswith(("Date", "Time\t")))
    path.write_text(content.replace(".", decimal).replace("\t", separator), encoding="utf-8")
    return path


def check(record: Record) -> None:
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)
    np.testing.assert_array_equal(record.voltage, VOLTAGE)
    np.testing.assert_array_equal(record.displacement, DISPLACEMENT)
    assert record.sample_rate == pytest.approx(RATE)


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("separator", ["\t", ";"])
@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
def test_lvm(tmp_path: Path, decimal: str, separator: str, x_columns: str) -> None:
    names = "X_Value\tDrive\tX_Value\tPosition\tComment" if x_columns == "Multi" else None
    more = {} if names is None else {"names": names}
    file = lvm(tmp_path / "log.lvm", decimal=decimal, separator=separator, x_columns=x_columns, **more)  # type: ignore[arg-type]
    record = read_record(file)
    check(record)
    assert record.notes == ()


PARTS = (slice(0, 20), slice(20, 45), slice(45, N))


@pytest.mark.parametrize("rows", [1, 7, 1000])
@pytest.mark.parametrize(
    "starts",
    [
        [(0.0, 0.0), (0.020, 0.0), (0.045, 0.0)],  # time goes on
        [(0.0, 0.0), (0.0, 0.020), (0.0, 0.045)],  # time begins anew, the clock says when
    ],
)
@pytest.mark.parametrize("x_columns", ["One", "No"])
def test_lvm_of_several_segments(
    tmp_path: Path,
    starts: list[tuple[float, float]],
    rows: int,
    x_columns: str,
) -> None:
    segments = tuple((part, *start) for part, start in zip(PARTS, starts, strict=True))
    file = lvm(tmp_path / "log.lvm", segments, x_columns=x_columns)
    check(read_record(file))
    stream = stream_record(file, rows=rows)
    np.testing.assert_array_equal(np.concatenate([block.voltage for block in stream]), VOLTAGE)
    assert stream.count() == N
    assert stream_record(file, sample_rate=RATE).count() == N


# ---------------------------------------------------------------- TDMS


def tdms(path: Path, **changes: object) -> Path:
    """Write a file of two segments; `changes` are properties of the second channel."""
    nptdms = pytest.importorskip("nptdms")
    waveform = {"wf_increment": 1.0 / RATE}
    with nptdms.TdmsWriter(str(path)) as writer:
        for part in (slice(0, 20), slice(20, N)):
            u = nptdms.ChannelObject("run", "drive", 1e3 * VOLTAGE[part], {**waveform, "unit_string": "mV"})
            x = nptdms.ChannelObject(
                "run", "gauge", DISPLACEMENT[part], {**waveform, "unit_string": "um", **changes}
            )
            words = nptdms.ChannelObject("notes", "words", ["a", "b"])
            writer.write_segment([u, x, words])
    return path


def test_tdms(tmp_path: Path) -> None:
    file = tdms(tmp_path / "log.tdms")
    record = read_record(file)
    np.testing.assert_allclose(record.voltage, VOLTAGE, atol=1e-12)
    np.testing.assert_array_equal(record.displacement, DISPLACEMENT)
    np.testing.assert_allclose(record.time, TIME, atol=1e-12)
    assert record.notes[0] == "sample rate of 1000 Hz as the file states it"
    with pytest.raises(ValueError, match="there are the columns run/drive, run/gauge"):
        read_record(file, columns={"voltage": "nope"})
    with pytest.raises(ValueError, match="no column for time"):
        read_record(tdms(file, wf_increment=0.5))
    assert read_record(file, sample_rate=50.0).sample_rate == 50.0
