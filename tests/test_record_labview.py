"""LabVIEW's logs: .lvm with its headers, and TDMS."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest.records import read_record, stream_record
from tests.logs import RATE, VOLTAGE, N, check, write_lvm, write_tdms


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("separator", ["\t", ";"])
@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
def test_lvm(tmp_path: Path, decimal: str, separator: str, x_columns: str) -> None:
    record = read_record(
        write_lvm(tmp_path / "log.lvm", decimal=decimal, separator=separator, x_columns=x_columns)
    )
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
def test_lvm_of_several_segments(tmp_path: Path, starts: Any, rows: int, x_columns: str) -> None:
    segments = tuple((part, *start) for part, start in zip(PARTS, starts, strict=True))
    file = write_lvm(tmp_path / "log.lvm", segments, x_columns=x_columns)
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
