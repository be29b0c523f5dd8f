"""A recorded log in memory: read from a file of any format, and written to one; and one to try."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d, positive
from piezoest.records.frame import frame_source
from piezoest.records.source import counted
from piezoest.records.stream import RecordStream, sane, title_of, without_gaps
from piezoest.records.writing import write_columns

if TYPE_CHECKING:
    from piezoest.signals import Signal

# Times may differ from those of the sample rate by this part of a step.
UNEVEN = 0.1


@dataclass(frozen=True, slots=True, eq=False, repr=False)
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
        If the arrays are not of one shape (N,), the sample rate is not above zero, or the times have another.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.Record.from_arrays([0.0, 1.0, 2.0], [0.0, 0.13, 0.27], sample_rate=1000.0)
    Record(3 samples at 1000 Hz, 0 to 2 V, 0 to 0.27 µm, source='record', skipped=0)
    """

    time: FloatArray
    voltage: FloatArray
    displacement: FloatArray
    sample_rate: float
    source: str = "record"
    skipped: int = 0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("time", "voltage", "displacement"):
            values = array_1d(name, getattr(self, name), allow_nan=name != "time", minimum_length=2)
            object.__setattr__(self, name, values if name == "time" else sane(values))
            if values.size != self.time.size:
                other = "time" if name == "voltage" else "voltage"
                raise ValueError(
                    f"{name} must be as long as the {other}, {self.time.size} samples, got {values.size}"
                )
        object.__setattr__(self, "sample_rate", positive("sample_rate", self.sample_rate))
        # Rounded times have no other mean step, and a pause no other usual one.
        steps = np.diff(self.time)
        fits = (abs(step * self.sample_rate - 1.0) < UNEVEN for step in (np.mean(steps), np.median(steps)))
        if not any(fits):
            raise ValueError(
                f"time has steps of {np.median(steps):.4g} s, {self.sample_rate:g} Hz has "
                f"{1.0 / self.sample_rate:.4g} s: give the rate of these times, or use Record.from_arrays"
            )

    def __repr__(self) -> str:
        """How long it is, its ranges, and what was noted."""
        said = [f"Record({len(self)} samples at {self.sample_rate:.6g} Hz"]
        for values, unit in ((self.voltage, "V"), (self.displacement, "µm")):
            read = values[np.isfinite(values)]
            said.append(f"{read.min():.4g} to {read.max():.4g} {unit}" if read.size else f"no {unit}")
        noted = [f"notes={self.notes!r}"] if self.notes else []
        return ", ".join([*said, f"source={self.source!r}", f"skipped={self.skipped}", *noted]) + ")"

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
        voltage = array_1d("voltage", voltage, allow_nan=True, minimum_length=2)
        time = np.arange(voltage.size) / positive("sample_rate", sample_rate)
        return cls(time, voltage, displacement, sample_rate, source)._counted()

    @classmethod
    def from_frame(
        cls,
        frame: Any,
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        sample_rate: float | None = None,
    ) -> Record:
        """Make a record of a table of pandas or Polars.

        Parameters
        ----------
        frame : pandas.DataFrame or polars.DataFrame
            One row per sample. An index of pandas that holds times, or is named like time, is the column of
            time.
        columns, units : mapping of str to str, optional
            As for `read_record`; the index is called by its name, or ``"index"``.
        sample_rate : float, optional
            [Hz], as for `read_record`.

        Returns
        -------
        Record
            In s, V and µm.

        Raises
        ------
        ValueError
            If `frame` is no such table, or as `read_record`.

        Examples
        --------
        >>> import numpy as np, pandas as pd
        >>> from piezoest import Record
        >>> frame = pd.DataFrame({"t_ms": np.arange(20.0), "u": np.arange(20.0), "x_nm": np.ones(20)})
        >>> Record.from_frame(frame).sample_rate
        1000.0
        """
        source = frame_source(frame)
        return _record(RecordStream(source, columns=columns, units=units, sample_rate=sample_rate, held=True))

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

    def _counted(self) -> Self:
        """Return it with the number of its unusable samples, and a note on them."""
        if not (skipped := int(np.sum(~self.usable))):
            return self
        verb = "is" if skipped == 1 else "are"
        said = f"{counted(skipped, 'sample')} {verb} without usable numbers: skipped, the timing is kept"
        return replace(self, skipped=skipped, notes=(*self.notes, said))

    def write(self, path: str | Path) -> None:
        """Write the columns time_s, voltage_V, displacement_um in any format that `read_record` reads.

        Parameters
        ----------
        path : str or Path
            File to write; an existing one is replaced. Its ending says the format: ``.csv``, ``.txt``,
            ``.dat``, ``.tsv``, ``.parquet``, ``.h5``, ``.mat``, ``.npy`` or ``.npz``.

        Raises
        ------
        OSError
            If the file cannot be written.
        ValueError
            If the ending stands for no format.
        ImportError
            If writing the format needs a package of the extra ``formats`` that is not installed.
        """
        columns = {"time_s": self.time, "voltage_V": self.voltage, "displacement_um": self.displacement}
        write_columns(path, columns)


def read_record(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    sample_rate: float | None = None,
) -> Record:
    """Read a log from a text, LabVIEW, TDMS, Parquet, HDF5, MATLAB, NumPy or spreadsheet file.

    Parameters
    ----------
    path : str or Path
        File with one row per sample; the format is recognised. In text files, delimiter (comma, semicolon,
        tab, blank), decimal comma, separators of thousands, time stamps and header are
        recognised too, with lines of an instrument above the header or of units below it, and gzip may have
        packed them (``.csv.gz``). Lines that begin with # or % are comments; names of columns in the last
        one above the rows are used, and so are the names in a GCS array of Physik Instrumente.
        Of a spreadsheet the first sheet with a table of numbers is read, of LabVIEW's files and TDMS all
        channels.
        Of HDF5 and MATLAB files every vector is a column, and so is every column of a matrix (``data:1``,
        ``data:2``) and every field of a structure (``log.u``).
    columns : mapping of str to str, optional
        Names of the columns of ``"time"``, ``"voltage"`` and ``"displacement"`` where they should not be
        guessed, or their numbers from 1: ``{"voltage": "drive_mV", "displacement": "3"}``.
    units : mapping of str to str, optional
        Units where the file does not state them as it should: ``{"displacement": "nm"}``. With a number
        before it, what one in the log stands for: ``{"displacement": "0.2 um"}`` for a sensor's volts. Left
        out, a unit is read from the end of a name (``drive_mV``, ``pos [nm]``, ``t (ms)``) or from the
        attribute ``unit`` of an HDF5 dataset or a Parquet field.
    sample_rate : float, optional
        [Hz]; if given, the rows are taken as evenly spaced and the column of time is ignored. Left out, and
        without a column of time, a number called ``fs`` or ``sample_rate`` in a MATLAB, HDF5 or NumPy file is
        taken, or such an entry of a Parquet file's metadata, or of a line above text: ``# fs = 10 kHz``,
        ``Sample Interval,1e-4``.

    Returns
    -------
    Record
        In s, V and µm. Rows that hold no number, and rows missing in the
        column of time, are NaN and are counted in `skipped`. Where up to 1 % of the rows repeat the time of
        the row before, those beside say where they belong.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If columns are missing or ambiguous, a unit is unknown, there is text in numbers, time does not
        increase or is too uneven, there are too few rows, or the file is damaged; the message names
        file, line and column.
    ImportError
        If reading the format needs a package of the extra ``formats`` that is not installed.

    Examples
    --------
    >>> import piezoest as pz
    >>> record = pz.read_record(pz.records.example_log())
    >>> len(record), record.sample_rate
    (14155, 200.0)
    """
    return _record(RecordStream(path, columns=columns, units=units, sample_rate=sample_rate, held=True))


def _record(stream: RecordStream) -> Record:
    columns, count = np.empty((3, stream.count())), 0
    for block in stream:
        columns[:, count : count + block.time.size] = block
        count += block.time.size
    time, voltage, displacement = columns
    record = Record(time, voltage, displacement, stream.sample_rate, str(stream.path), notes=stream.notes)
    return record._counted()


def example_log() -> Path:
    """Path of a recorded log: 71 s of a piezo micromanipulator at 200 Hz, a sine of 1 Hz.

    Constant and growing amplitude with dwells; after the middle the voltage holds the authors' own
    compensation. Y. N. Aye and W. T. Ang, *A Discrete Backlash Operator for Identification and Compensation
    of Hysteresis and Non-linearity for Piezoelectric Micromanipulator*, ICSTSD, 2018; MIT licence, whose
    text and origin stand beside the file.

    Returns
    -------
    Path
        A CSV file with the columns time_s, voltage_V, displacement_um and reference_um, packed by gzip.

    Examples
    --------
    >>> import piezoest as pz
    >>> len(pz.read_record(pz.records.example_log()))
    14155
    """
    return Path(str(resources.files("piezoest.records") / "example" / "micromanipulator.csv.gz"))


def read_reference(
    path: str | Path,
    *,
    column: str | None = None,
    units: Mapping[str, str] | None = None,
    sample_rate: float | None = None,
) -> Signal:
    """Read a reference trajectory from a file of any format that `read_record` reads.

    Parameters
    ----------
    path : str or Path
        As for `read_record`.
    column : str, optional
        Name of the column; default one called reference, r, target and the like, else one that
        looks like a displacement.
    units : mapping of str to str, optional
        Units of ``"reference"`` and ``"time"``, as for `read_record`.
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

    Examples
    --------
    >>> import piezoest as pz
    >>> r = pz.signals.sine(5.0, 5.0, 2, 1000.0)
    >>> pz.records.write_columns("reference.csv", {"time_s": r.time, "reference_um": r.values})
    >>> pz.records.read_reference("reference.csv").sample_rate
    1000.0
    """
    return named_reference(path, column, units, sample_rate)[0]


def named_reference(
    path: str | Path,
    column: str | None = None,
    units: Mapping[str, str] | None = None,
    sample_rate: float | None = None,
) -> tuple[Signal, str]:
    """Read a reference as `read_reference` does, and the title of the column that it is in."""
    from piezoest.signals import Signal

    log = RecordStream(
        path,
        columns={} if column is None else {"reference": column},
        units=units,
        sample_rate=sample_rate,
        wanted=("reference",),
        held=True,
    )
    return Signal(without_gaps(log), log.sample_rate, None, Path(path).stem), title_of(log, "reference")
