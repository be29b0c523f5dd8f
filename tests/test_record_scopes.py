"""CSV files of oscilloscopes, which measure volts: which channel is what, and of which unit, is asked for."""

from pathlib import Path

import numpy as np
import pytest

from piezoest.records import read_record

N = 60
RATE = 500.0
TIME = np.arange(N) / RATE - 0.02
VOLTAGE = np.round(5.0 + 4.0 * np.sin(np.arange(N) / 9.0), 4)
SENSOR = np.round(0.5 * VOLTAGE, 4)
SCALE = 2.0  # [µm/V]

ROWS = [f"{t:.6e},{u},{x}" for t, u, x in zip(TIME, VOLTAGE, SENSOR, strict=True)]
SEQUENCE = [f"{k},{u},{x}" for k, (u, x) in enumerate(zip(VOLTAGE, SENSOR, strict=True))]
NAMES = "time [s],voltage [V],position [um]"
BARE = [f"{u},{x}" for u, x in zip(VOLTAGE, SENSOR, strict=True)]
TEKTRONIX = [
    "Model,MSO2024", "", "Horizontal Units,S,", "Sample Interval,2e-03,", f"Record Length,{N},",
    "Gating,0.0% to 100.0%,", "Vertical Units,V,V", "Label,,", "TIME,CH1,CH2",
]  # fmt: skip
SIGLENT = [
    f"Record Length,Analog:{N}", "Vertical Units,CH1:V,CH2:V", "Horizontal Units,s", "Source,CH1,CH2",
    "Second,Volt,Volt",
]  # fmt: skip
BESIDE = [
    f"Record Length,{N},", "Sample Interval,2e-3,", ",,", "Source,CH{},", "Vertical Units,V,",
    "Horizontal Units,s,", *[",,"] * (N - 6),
]  # fmt: skip


def beside(channel: int, values: np.ndarray) -> list[str]:
    lines = (line.format(channel) for line in BESIDE)
    return [f"{line},{t:017.12f},{v:10.5f}," for line, t, v in zip(lines, TIME, values, strict=True)]


TWO_BESIDE = [a + b for a, b in zip(beside(1, VOLTAGE), beside(2, SENSOR), strict=True)]
QUOTED = [
    f'"{a[:13]}",{N},"Points",{row}' for a, row in zip(["Record Length", *[""] * N], ROWS, strict=False)
]


def written(folder: Path, lines: list[str], end: str = "\n") -> Path:
    file = folder / "log.csv"
    file.write_bytes(end.join(lines).encode())
    return file


@pytest.mark.parametrize(
    ("lines", "channels"),
    [
        (["X,CH1,CH2,Start,Increment,", "Sequence,Volt,Volt,0.0,2e-3,", *(f"{r}," for r in SEQUENCE)], "CH"),
        (["X,CH1,CH2,Start,Increment", "Sequence,Volt,Volt,0.0,2e-3", *(f"{r},," for r in SEQUENCE)], "CH"),
        (["CH1(V),CH2(V),t0 = -2e-02, tInc = 2e-03,", *(f"{row},," for row in BARE)], "CH"),
        (["CH1V,CH2V,t0 =-2e-02, tInc = 2e-03,", *BARE], "CH"),
        (["x-axis,1,2", "second,Volt,Volt", *ROWS], ""),
        ([*TEKTRONIX, *ROWS], "CH"),
        ([*SIGLENT, *ROWS], "CH"),
        (TWO_BESIDE, "CH"),
        (QUOTED, "CH"),
    ],
    ids=["rigol", "rigol, padded", "rigol, increment", "rigol, V", "keysight", "tektronix", "siglent",
         "tektronix, beside", "tektronix, quoted"],
)  # fmt: skip
def test_channels_in_volts_are_asked_for(tmp_path: Path, lines: list[str], channels: str) -> None:
    file = written(tmp_path, [*lines, ""], "\r\n")
    named = {"voltage": f"{channels}1", "displacement": f"{channels}2"}
    with pytest.raises(ValueError, match="could all be the voltage, and none is a displacement") as caught:
        read_record(file)
    assert str(named) in str(caught.value)
    with pytest.raises(ValueError, match="no unit of displacement"):
        read_record(file, columns=named)
    record = read_record(file, columns=named, units={"displacement": f"{SCALE} um"})
    assert record.sample_rate == pytest.approx(RATE)
    np.testing.assert_allclose(record.voltage, VOLTAGE)
    np.testing.assert_allclose(record.displacement, SCALE * SENSOR)
    assert any("1 in it is taken as 2 µm" in note for note in record.notes)


def test_one_channel_beside_its_lines_is_no_log(tmp_path: Path) -> None:
    file = written(tmp_path, beside(1, VOLTAGE))
    with pytest.raises(ValueError, match="no column for displacement found"):
        read_record(file)


def test_a_sensor_in_millivolts_is_said(tmp_path: Path) -> None:
    file = written(tmp_path, ["Time,Channel A,Channel B", "(s),(V),(mV)", "", *ROWS])
    named = {"voltage": "Channel A", "displacement": "Channel B"}
    record = read_record(file, columns=named, units={"displacement": "2 nm"})
    np.testing.assert_allclose(record.displacement, 2e-3 * SENSOR)
    assert "column 'Channel B [mV]': 1 in it is taken as 0.002 µm" in record.notes


def test_a_stated_rate_that_time_does_not_have_is_said(tmp_path: Path) -> None:
    for rate, said in ((500, 0), (1000, 1)):
        record = read_record(written(tmp_path, [f"Sample rate,{rate} Hz", "", NAMES, *ROWS]))
        assert record.sample_rate == pytest.approx(RATE)
        assert sum("is ignored: time has 500 Hz" in note for note in record.notes) == said
    file = written(tmp_path, ["Sample rate,10 kHz", "", "voltage [V],position [um]", *BARE])
    assert read_record(file).sample_rate == 10_000.0


def test_columns_that_are_called_start_and_increment_are_no_mark_of_a_scope(tmp_path: Path) -> None:
    rows = [f"{row},1,2" for row in ROWS]
    assert len(read_record(written(tmp_path, [f"{NAMES},Start,Increment", *rows]))) == N


def test_an_increment_above_the_rows_is_no_time_unless_it_is_rigols(tmp_path: Path) -> None:
    lines = ["Voltage step,0.5", "Increment,0.5", "voltage [V],position [um]", *BARE]
    with pytest.raises(ValueError, match="sample rate"):
        read_record(written(tmp_path, lines))


def test_a_length_padded_by_a_spreadsheet_is_a_line_as_any_other(tmp_path: Path) -> None:
    record = read_record(written(tmp_path, [f"Record Length,{N},,,,", NAMES, *ROWS]))
    np.testing.assert_array_equal(record.displacement, SENSOR)
