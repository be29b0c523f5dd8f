"""A recorded log, read from and written to CSV."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from piezoest._checks import WILDEST, FloatArray, array_1d, fraction, positive
from piezoest.records.table import read_table
from piezoest.records.timing import even_time, spread

if TYPE_CHECKING:
    from piezoest.signals import Signal

FEWEST_ROWS = 10


@dataclass(frozen=True, slots=True)
class Record:
    """A recorded log: voltage in, displacement out, evenly sampled.

    Parameters
    ----------
    time : array_like, shape (N,)
        [s].
    voltage, displacement : array_like, shape (N,)
        [V], [µm]; NaN where a sample is missing. Numbers that no stage can have, beyond 1e9, become NaN.
    sample_rate : float
        [Hz].
    source : str
        Where the record comes from, for messages and titles.
    skipped : int
        Samples that the log has no usable numbers for; they are NaN here, so that the timing stays.
    notes : tuple of str
        What had to be assumed or converted to read the log, in plain sentences.

    Raises
    ------
    ValueError
        If the arrays are not of one shape (N,), or the sample rate is not above zero.
    """

    time: FloatArray = field(repr=False)
    voltage: FloatArray = field(repr=False)
    displacement: FloatArray = field(repr=False)
    sample_rate: float
    source: str = "record"
    skipped: int = 0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("time", "voltage", "displacement"):
            values = array_1d(name, getattr(self, name), allow_nan=name != "time", minimum_length=2)
            object.__setattr__(self, name, values if name == "time" else _sane(values))
            if values.size != self.time.size:
                raise ValueError(
                    f"{name} must have shape ({self.time.size},) as time has, got ({values.size},)"
                )
        object.__setattr__(self, "sample_rate", positive("sample_rate", self.sample_rate))

    @classmethod
    def from_arrays(
        cls, voltage: Any, displacement: Any, sample_rate: float, source: str = "record"
    ) -> Record:
        """Make a record of arrays that start at time zero.

        Parameters
        ----------
        voltage, displacement : array_like, shape (N,)
            [V], [µm]; NaN where a sample is missing.
        sample_rate : float
            [Hz].
        source : str
            What to call it.

        Raises
        ------
        ValueError
            If the arrays are not of one shape (N,), or the sample rate is not above zero.
        """
        voltage = array_1d("voltage", voltage, allow_nan=True)
        time = np.arange(voltage.size) / positive("sample_rate", sample_rate)
        return cls(time, voltage, displacement, sample_rate, source)

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def duration(self) -> float:
        """Samples over sample rate [s]."""
        return len(self) / self.sample_rate

    @property
    def usable(self) -> Any:
        """Where both voltage and displacement are known, shape (N,), bool."""
        return np.isfinite(self.voltage) & np.isfinite(self.displacement)

    def split(self, part: float) -> tuple[Record, Record]:
        """Cut in two.

        Parameters
        ----------
        part : float
            Part of the samples that goes into the first record, between 0 and 1.

        Returns
        -------
        (Record, Record)
            Both keep their times; unusable samples are counted in each.

        Raises
        ------
        ValueError
            If `part` is out of its range or leaves one side with fewer than two samples.
        """
        cut = round(fraction("part", part) * len(self))
        return self._cut(slice(0, cut)), self._cut(slice(cut, None))

    def _cut(self, part: slice) -> Record:
        unusable = int(np.sum(~self.usable[part]))
        return Record(
            self.time[part],
            self.voltage[part],
            self.displacement[part],
            self.sample_rate,
            self.source,
            unusable,
            self.notes,
        )

    def write(self, path: str | Path) -> None:
        """Write as CSV with the columns time_s, voltage_V, displacement_um.

        Parameters
        ----------
        path : str or Path
            File to write; an existing one is replaced.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        columns = {"time_s": self.time, "voltage_V": self.voltage, "displacement_um": self.displacement}
        write_columns(path, columns)


def read_record(
    path: str | Path, *, columns: Mapping[str, str] | None = None, sample_rate: float | None = None
) -> Record:
    """Read a log from a CSV file.

    Parameters
    ----------
    path : str or Path
        Text file with one row per sample. Delimiter (comma, semicolon, tab, blank), decimal
        comma, header and units are recognised; lines that begin with # are comments.
    columns : mapping of str to str, optional
        Names of the columns of ``"time"``, ``"voltage"`` and ``"displacement"`` where they should not be
        guessed, or their numbers from 1: ``{"voltage": "drive_mV", "displacement": "3"}``.
        Units are read from the end of a name: ``drive_mV``, ``pos [nm]``, ``t (ms)``.
    sample_rate : float, optional
        [Hz]; if given, the rows are taken as evenly spaced and the column of time is ignored.

    Returns
    -------
    Record
        In s, V and µm. Rows that hold no number, and rows missing in the
        column of time, are NaN and are counted in `skipped`.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If columns are missing or ambiguous, there is text in numbers, time does not increase or
        is too uneven, or there are too few rows; the message names file, line and column.
    """
    wanted = ("voltage", "displacement") if sample_rate is not None else ("time", "voltage", "displacement")
    table = read_table(Path(path), wanted, dict(columns or {}))
    voltage, displacement = _sane(table.values["voltage"]), _sane(table.values["displacement"])
    notes = list(table.notes)
    if sample_rate is None:
        time, where, said = even_time(table)
        voltage, displacement = spread(voltage, where), spread(displacement, where)
        sample_rate = float((time.size - 1) / (time[-1] - time[0]))
        notes += said
    else:
        time = np.arange(voltage.size) / positive("sample_rate", sample_rate)
    usable = int(np.sum(np.isfinite(voltage) & np.isfinite(displacement)))
    if usable < FEWEST_ROWS:
        raise ValueError(f"{path}: only {usable} usable rows, at least {FEWEST_ROWS} are needed")
    if skipped := voltage.size - usable:
        noun = "sample is" if skipped == 1 else "samples are"
        notes.append(f"{skipped} {noun} without usable numbers: skipped, the timing is kept")
    return Record(time, voltage, displacement, sample_rate, str(path), skipped, tuple(notes))


def _sane(values: FloatArray) -> FloatArray:
    """Values with NaN for what no stage can have."""
    return np.where(np.abs(values) < WILDEST, values, np.nan)


def read_reference(
    path: str | Path, *, column: str | None = None, sample_rate: float | None = None
) -> Signal:
    """Read a reference trajectory from a CSV file.

    Parameters
    ----------
    path : str or Path
        As for `read_record`.
    column : str, optional
        Name of the column; default one called reference, r, target and the like, else one that
        looks like a displacement.
    sample_rate : float, optional
        [Hz]; if given, a column of time is not needed.

    Returns
    -------
    Signal
        The reference [µm].

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        As `read_record`; also if the reference has gaps, which a voltage cannot have.
    """
    from piezoest.signals import Signal

    wanted = ("reference",) if sample_rate is not None else ("time", "reference")
    table = read_table(Path(path), wanted, {} if column is None else {"reference": column})
    values = table.values["reference"]
    bad = np.flatnonzero(~np.all(np.isfinite(list(table.values.values())), axis=0))
    if bad.size:
        raise ValueError(
            f"{path}, line {table.lines[bad[0]]}: no number in the time or the reference; "
            "a reference must have no gaps"
        )
    if values.size < FEWEST_ROWS:
        raise ValueError(f"{path}: only {values.size} rows, at least {FEWEST_ROWS} are needed")
    if sample_rate is None:
        time, where, _ = even_time(table)
        if np.any(np.diff(where) > 1):
            gap = int(np.argmax(np.diff(where) > 1))
            raise ValueError(
                f"{path}, line {table.lines[gap + 1]}: time jumps here; a reference must have no gaps"
            )
        sample_rate = float((time.size - 1) / (time[-1] - time[0]))
    return Signal(values, sample_rate, None, Path(path).stem)


def write_columns(path: str | Path, columns: Mapping[str, Any]) -> None:
    """Write columns as CSV with a header, to nine significant digits and time to twelve.

    Parameters
    ----------
    path : str or Path
        File to write; an existing one is replaced.
    columns : mapping of str to array_like, each of shape (N,)
        Header and values.

    Raises
    ------
    OSError
        If the file cannot be written.
    ValueError
        If the columns differ in length.
    """
    arrays = [array_1d(name, values, allow_nan=True) for name, values in columns.items()]
    if len({array.size for array in arrays}) > 1:
        raise ValueError(f"columns must be of one length, got {[array.size for array in arrays]}")
    formats = ["%.12g" if name.startswith("time") else "%.9g" for name in columns]
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        np.savetxt(
            file, np.column_stack(arrays), fmt=formats, delimiter=",", header=",".join(columns), comments=""
        )
