"""One small log, what its record must hold, and files of it as other programs write them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest.records import Record

N = 60
RATE = 100.0
TIME = np.arange(N) / RATE
# What a text with six digits holds to the bit.
VOLTAGE = np.round(10.0 * np.sin(0.5 * np.arange(N)), 6)
DISPLACEMENT = np.round(1.5 * VOLTAGE + 3.0, 6)
LOG = {"time_s": TIME, "voltage_V": VOLTAGE, "displacement_um": DISPLACEMENT}


def check(record: Record) -> None:
    """The samples of the log, a displacement without a number apart."""
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)
    np.testing.assert_allclose(record.voltage, VOLTAGE, atol=1e-12)
    known = np.isfinite(record.displacement)
    assert np.count_nonzero(~known) == record.skipped
    np.testing.assert_allclose(record.displacement[known], DISPLACEMENT[known], atol=1e-12)
    assert record.sample_rate == pytest.approx(RATE)


def write_hdf5(path: Path, columns: Mapping[str, Any] = LOG, **attributes: Any) -> None:
    with pytest.importorskip("h5py").File(path, "w") as root:
        for name, values in columns.items():
            root[name] = values
        root.attrs.update(attributes)


def write_sheets(path: Path, **tables: Sequence[Sequence[Any]]) -> Path:
    pytest.importorskip("python_calamine")
    book = pytest.importorskip("openpyxl").Workbook()
    book.remove(book.active)
    for name, rows in tables.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    book.save(path)
    return path


def write_tdms(path: Path, **changes: object) -> Path:
    """A file of two segments; `changes` are properties of the second channel."""
    nptdms = pytest.importorskip("nptdms")
    rate = {"wf_increment": 1.0 / RATE}
    with nptdms.TdmsWriter(str(path)) as writer:
        for part in (slice(0, 20), slice(20, N)):
            u = nptdms.ChannelObject("run", "drive", 1e3 * VOLTAGE[part], {**rate, "unit_string": "mV"})
            gauge = {**rate, "unit_string": "um", **changes}
            x = nptdms.ChannelObject("run", "gauge", DISPLACEMENT[part], gauge)
            writer.write_segment([u, x, nptdms.ChannelObject("notes", "words", ["a", "b"])])
    return path


FILE_HEAD = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\t{name}\nDecimal_Separator\t{decimal}\n"
    "Multi_Headings\tYes\nX_Columns\t{x_columns}\nTime_Pref\tRelative\nDate\t2026/11/22\nTime\t10:00:00,0\n"
    "***Start_Special***\nChannels\t99\n***End_Special***\n***End_of_Header***\t\n"
)
SEGMENT_HEAD = (
    "\t\nChannels\t2\t\t\nSamples\t{samples}\t{samples}\t\nDate\t2026/11/22\t2026/11/22\t\n"
    "Time\t10:00:{second:012.9f}\t10:00:{second:012.9f}\t\nY_Unit_Label\tVolts\tum\t\n"
    "X_Dimension\tTime\tTime\t\nX0\t{x_0}\t{x_0}\t\nDelta_X\t0.01\t0.01\t\n***End_of_Header***\t\t\t\n"
)


def write_lvm(
    path: Path,
    segments: tuple[tuple[slice, float, float], ...] = ((slice(0, N), 0.0, 0.0),),
    *,
    decimal: str = ".",
    separator: str = "\t",
    x_columns: str = "One",
) -> Path:
    """Write a .lvm file of segments: rows, X of the first row, seconds of the clock."""
    word = {"\t": "Tab", ";": "Semicolon"}[separator]
    content = FILE_HEAD.format(name=word, decimal=decimal, x_columns=x_columns)
    again = "\tX_Value" if x_columns == "Multi" else ""
    for part, x_0, second in segments:
        content += SEGMENT_HEAD.format(samples=len(range(N)[part]), second=second, x_0=x_0)
        content += f"X_Value\tDrive{again}\tPosition\tComment\n"
        for k, (u, x) in enumerate(zip(VOLTAGE[part], DISPLACEMENT[part], strict=True)):
            t = "" if x_columns == "No" else f"{x_0 + k / RATE:.6f}"
            cells = [t, f"{u:.6f}", t, f"{x:.6f}"] if again else [t, f"{u:.6f}", f"{x:.6f}"]
            content += "\t".join(cells) + ("\tbegins" if k == 0 else "") + "\n"
    path.write_text(content.replace(".", decimal).replace("\t", separator), encoding="utf-8")
    return path


ROWS = [(0.001 * k, 50.0 + k % 7, 4.6 + 0.01 * (k % 7)) for k in range(60)]


def table(row: str) -> str:
    """A line for each of the rows; `row` is a format of their number k, t [s], u [V] and x [µm].

    It may also use ms, mv and nm, the same in smaller units, and day, the time as a spreadsheet counts it.
    """
    return "\n".join(
        row.format(k=k, t=t, u=u, x=x, ms=1e3 * t, mv=1e3 * u, nm=1e3 * x, day=45_000.0 + t / 86_400.0)
        for k, (t, u, x) in enumerate(ROWS, 1)
    )
