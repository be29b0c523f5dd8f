"""LabVIEW's logs: .lvm with its headers, and TDMS."""

from pathlib import Path

import numpy as np
import pytest

from piezoest.records import read_record, stream_record
from tests.logs import DISPLACEMENT, RATE, VOLTAGE, N, check, write_tdms

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
Delta_X\t0.01\t0.01\t
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
) -> Path:
    """Write a .lvm file of segments: rows, X of the first row, seconds of the clock."""
    word = {"\t": "Tab", ";": "Semicolon"}[separator]
    content = FILE_HEADER.format(name=word, decimal=decimal, x_columns=x_columns)
    for part, x_0, second in segments:
        count = len(range(N)[part])
        content += SEGMENT.format(samples=count, second=second, x_0=x_0, names=names)
        for k, (u, x) in enumerate(zip(VOLTAGE[part], DISPLACEMENT[part], strict=True)):
            t = f"{x_0 + k / RATE:.6f}"
            row = {"No": ["", f"{u:.6f}", f"{x:.6f}"], "Multi": [t, f"{u:.6f}", t, f"{x:.6f}"]}
            cells = row.get(x_columns, [t, f"{u:.6f}", f"{x:.6f}"])
            content += "\t".join(cells) + ("\tbegins" if k == 0 and "Comment" in names else "") + "\n"
    path.write_text(content.replace(".", decimal).replace("\t", separator), encoding="utf-8")
    return path


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
        [(0.0, 0.0), (0.20, 0.0), (0.45, 0.0)],  # time goes on
        [(0.0, 0.0), (0.0, 0.20), (0.0, 0.45)],  # time begins anew, the clock says when
    ],
)
@pytest.mark.parametrize("x_columns", ["One", "No"])
def test_lvm_of_several_segments(
    tmp_path: Path, starts: list[tuple[float, float]], rows: int, x_columns: str
) -> None:
    segments = tuple((part, *start) for part, start in zip(PARTS, starts, strict=True))
    file = lvm(tmp_path / "log.lvm", segments, x_columns=x_columns)
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
