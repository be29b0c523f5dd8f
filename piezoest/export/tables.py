"""Tables for controllers that take no code: the settled voltage of a periodic reference, and its branches."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, array_1d, integer, positive
from piezoest.models import Model
from piezoest.records import write_columns
from piezoest.signals import Signal, check_continuity

# The loop has settled when the voltage of two periods differs by no more than this, relative to its largest.
_SETTLED = 1e-9
_MOST_PERIODS = 400


@dataclass(frozen=True, slots=True)
class Table:
    """One settled period of a reference through the inverse of a model.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    reference, voltage : ndarray, shape (N,)
        One period [µm], [V].
    branches : tuple of ndarray, each of shape (points, 2)
        Displacement [µm] and voltage [V] along each leg from one turning point of the reference to
        the next, at even steps of displacement, in the order of time.
    """

    sample_rate: float
    reference: FloatArray = field(repr=False)
    voltage: FloatArray = field(repr=False)
    branches: tuple[FloatArray, ...] = field(repr=False)

    def write(self, directory: str | Path) -> tuple[Path, Path]:
        """Write ``waveform.csv`` and ``branches.csv`` into a folder, which is made if need be.

        The columns are time_s, reference_um, voltage_V, and branch, displacement_um, voltage_V.

        Parameters
        ----------
        directory : str or Path
            The folder.

        Returns
        -------
        tuple of Path
            The two files.

        Raises
        ------
        OSError
            If a file cannot be written; one that was there is then as it was.
        ValueError
            If a number is not finite.
        """
        folder = Path(directory)
        folder.mkdir(parents=True, exist_ok=True)
        waveform, branches = folder / "waveform.csv", folder / "branches.csv"
        time = np.arange(self.reference.size) / self.sample_rate
        period = {"time_s": time, "reference_um": self.reference, "voltage_V": self.voltage}
        rows = np.concatenate(self.branches) if self.branches else np.empty((0, 2))
        number = np.repeat(np.arange(1.0, len(self.branches) + 1.0), [len(b) for b in self.branches])
        ways = {"branch": number, "displacement_um": rows[:, 0], "voltage_V": rows[:, 1]}
        for path, columns in ((waveform, period), (branches, ways)):
            write_columns(path, columns, allow_nan=False)
        return waveform, branches


def table(
    model: Model, reference: Signal | Any, *, sample_rate: float | None = None, points: int = 257
) -> Table:
    """Settled voltage of a periodic reference, and the branches of its loop, by a model's exact inverse.

    Parameters
    ----------
    model : ColemanHodgdon, PrandtlIshlinskii or LinearGain
        Must be admissible.
    reference : Signal or array_like, shape (N,)
        Reference [µm]. Of a signal with a period its last one is taken; anything else is one period.
    sample_rate : float, optional
        [Hz]; needed if the reference is a plain array.
    points : int
        Entries of each branch (default 257).

    Raises
    ------
    ValueError
        If the reference is not finite, jumps (also from its end to its start), or has a period that
        is no whole number of samples; if no sample rate is known, or the model has no inverse.

    Examples
    --------
    >>> import piezoest as pz
    >>> model = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    >>> r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=2, sample_rate=1000.0)
    >>> found = pz.export.table(model, r)
    >>> found, len(found.branches)
    (Table(sample_rate=1000.0), 2)
    >>> float(found.voltage.max().round(2))
    37.49
    """
    points = integer("points", points, 2)
    period, rate = _one_period(reference, sample_rate)
    check_continuity(np.concatenate([period, period]), rate, "reference")
    invert: Any = model.invert  # type: ignore[attr-defined]
    before = None
    periods = 2
    while True:
        # As a signal it has its rate, on which creep depends.
        voltage = invert(Signal(np.tile(period, periods), rate))[-period.size :]
        if before is not None and np.max(np.abs(voltage - before)) <= _SETTLED * np.max(np.abs(voltage)):
            break
        if periods > _MOST_PERIODS:
            raise ValueError(
                "the loop of this model does not settle on the reference; with slow creep it never does: "
                "identify with --model plays or plays-asymmetric"
            )
        before, periods = voltage, 2 * periods
    return Table(rate, period, voltage, _branches(period, voltage, points))


def _one_period(reference: Any, sample_rate: float | None) -> tuple[FloatArray, float]:
    if not isinstance(reference, Signal):
        if sample_rate is None:
            raise ValueError("sample_rate is unknown: pass it in Hz, or a piezoest.signals.Signal")
        return array_1d("reference", reference, minimum_length=3), positive("sample_rate", sample_rate)
    if sample_rate is not None and sample_rate != reference.sample_rate:
        raise ValueError(
            f"sample_rate is {sample_rate:g} Hz, but reference says {reference.sample_rate:g} Hz"
        )
    values = reference.values
    if reference.period is None:
        return values, reference.sample_rate
    samples = round(reference.period)
    if abs(samples - reference.period) > 1e-9 * reference.period or samples > values.size:
        raise ValueError(
            f"reference must hold a period that is a whole number of samples, got {reference.period:g}: "
            "choose a sample rate that is a multiple of its frequency"
        )
    return values[-samples:].copy(), reference.sample_rate


def _branches(r: FloatArray, u: FloatArray, points: int) -> tuple[FloatArray, ...]:
    """Ways between turning points; the first begins at a turning point."""
    steps = np.sign(np.diff(np.concatenate([r, r[:1]])))
    moving = np.flatnonzero(steps != 0.0)
    if moving.size == 0:
        return ()
    # A dwell belongs to the way before it.
    following = np.maximum.accumulate(np.where(steps != 0.0, np.arange(r.size), -1))
    direction = steps[np.where(following < 0, moving[-1], following)]
    turns = np.flatnonzero(direction != np.roll(direction, 1))
    if turns.size == 0:
        return ()
    ways = []
    for start, end in zip(turns, np.roll(turns, -1), strict=True):
        span = np.arange(start, end + 1 if end > start else end + r.size + 1) % r.size
        x, voltage = r[span], u[span]
        order = 1 if x[-1] > x[0] else -1
        grid = np.linspace(x[0], x[-1], points)
        # A dwell repeats a displacement: its last voltage counts.
        keep = np.append(np.diff(x) != 0.0, True)
        ways.append(np.column_stack([grid, np.interp(grid, x[keep][::order], voltage[keep][::order])]))
    return tuple(ways)
