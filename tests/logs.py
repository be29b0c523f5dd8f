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
    waveform = {"wf_increment": 1.0 / RATE}
    with nptdms.TdmsWriter(str(path)) as writer:
        for part in (slice(0, 20), slice(20, N)):
            u = nptdms.ChannelObject("run", "drive", 1e3 * VOLTAGE[part], {**waveform, "unit_string": "mV"})
            x = nptdms.ChannelObject(
                "run", "gauge", DISPLACEMENT[part], {**waveform, "unit_string": "um", **changes}
            )
            writer.write_segment([u, x, nptdms.ChannelObject("notes", "words", ["a", "b"])])
    return path
