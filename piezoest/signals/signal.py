"""`Signal`, the samples of a trajectory with their sample rate and period, and the test for jumps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from piezoest._checks import FloatArray, array_1d, finite, integer, positive
from piezoest.signals._arguments import number_of_samples

# An increment is a jump when it is both a visible part of the range and out of proportion to what
# happens around it (see check_continuity).
JUMP_FRACTION_OF_RANGE = 0.05
JUMP_RATIO = 20.0
NEIGHBOURS_ON_EACH_SIDE = 5
NEIGHBOURS_ALIKE = 3


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Signal:
    """Samples with a sample rate, and a period if there is one.

    Behaves as an array where one is wanted (`np.asarray(signal)`, `signal - x`, slices, iteration in plain
    floats). `signal.then(other)` and `signal + other` append; `2 * signal` scales; `signal + 40.0`, as
    `signal.shifted(40.0)`, adds an offset; `signal.with_lead_in(0.2)` begins at rest. Signals compare by
    identity.

    Parameters
    ----------
    values : array_like, shape (N,)
        Samples, finite, in µm (a reference) or V (a voltage). Copied.
    sample_rate : float
        Samples per second, Hz.
    period : float, optional
        Samples per period, not necessarily whole. None: not periodic.
    name : str
        For labels and messages.

    Raises
    ------
    ValueError
        If `values` is empty, not of shape (N,), or holds NaN or infinity; if `sample_rate` or `period`
        is not above zero.

    Examples
    --------
    >>> import piezoest as pz
    >>> r = pz.Signal([0.0, 1.0, 2.0, 1.0], sample_rate=10.0, period=4)
    >>> r + 40.0
    Signal('signal', 4 samples at 10 Hz, period 4 samples, amplitude 42)
    """

    values: FloatArray
    sample_rate: float
    period: float | None = None
    name: str = "signal"

    def __post_init__(self) -> None:
        values = array_1d("values", self.values, minimum_length=1).copy()
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "sample_rate", positive("sample_rate", self.sample_rate))
        if self.period is not None:
            object.__setattr__(self, "period", positive("period", self.period))

    def __len__(self) -> int:
        return int(self.values.size)

    def __iter__(self) -> Iterator[float]:
        # Plain floats: per-sample loops run about twice as fast on them as on NumPy scalars.
        return iter(self.values.tolist())

    def __getitem__(self, index: Any) -> Any:
        return self.values[index]

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Any:
        return np.array(self.values, dtype=dtype, copy=copy)

    def __repr__(self) -> str:
        period = "" if self.period is None else f", period {self.period:g} samples"
        return (
            f"Signal({self.name!r}, {len(self)} samples at {self.sample_rate:g} Hz{period}, "
            f"amplitude {self.amplitude:g})"
        )

    @property
    def time(self) -> FloatArray:
        """Time of each sample, shape (N,), s, from zero."""
        return np.arange(len(self)) / self.sample_rate

    @property
    def duration(self) -> float:
        """Number of samples over the sample rate, s."""
        return len(self) / self.sample_rate

    @property
    def amplitude(self) -> float:
        """Largest absolute value, in the unit of the values."""
        return float(np.max(np.abs(self.values)))

    def repeat(self, n: int) -> Signal:
        """Return the signal `n` times in a row.

        The period is kept if the signal is a whole number of periods long; otherwise the phase
        breaks at the joints and the result has no period.

        Parameters
        ----------
        n : int
            How often, at least once.

        Raises
        ------
        ValueError
            If `n` is not a whole number of at least 1.
        """
        n = integer("n", n, 1)
        period = self.period
        if n > 1 and period is not None:
            periods = len(self) / period
            if abs(periods - round(periods)) > 1e-9 * periods:
                period = None
        return Signal(np.tile(self.values, n), self.sample_rate, period, self.name)

    def then(self, other: Signal) -> Signal:
        """Return this signal followed by `other`; the period is kept if both have the same one.

        A difference between the last and the first value becomes a jump: `check_continuity` finds it.

        Parameters
        ----------
        other : Signal
            What follows, of the same sample rate.

        Raises
        ------
        ValueError
            If the sample rates differ.
        """
        if other.sample_rate != self.sample_rate:
            raise ValueError(
                f"other must have the same sample rate, {self.sample_rate:g} Hz, got "
                f"{other.sample_rate:g} Hz: build both signals with one sample_rate"
            )
        period = self.period if self.period == other.period else None
        name = self.name if self.name == other.name else f"{self.name} + {other.name}"
        return Signal(np.concatenate([self.values, other.values]), self.sample_rate, period, name)

    def with_lead_in(self, duration: float, start: float = 0.0) -> Signal:
        """Return a smooth way from a displacement to the first value, followed by this signal.

        The way goes in one direction and never beyond its ends, where it is at rest: velocity and
        acceleration are zero.

        Parameters
        ----------
        duration : float
            Of the way, s; the number of samples is rounded.
        start : float
            Where the way begins, such as where the stage rests, in the unit of the values.

        Returns
        -------
        Signal
            Its period is that of this signal: the interval over which errors are compared.

        Raises
        ------
        ValueError
            If `duration` covers no sample or `start` is not a finite number.

        Examples
        --------
        >>> import piezoest as pz
        >>> r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=2, sample_rate=1000.0) + 40.0
        >>> r = r.with_lead_in(0.2, start=12.0)
        >>> float(r[0]), float(r[200]), len(r)
        (12.0, 40.0, 600)
        """
        n = number_of_samples("duration", positive("duration", duration), self.sample_rate)
        start = finite("start", start)
        way = start + (self.values[0] - start) * smooth_rise(n)
        return Signal(np.concatenate([way, self.values]), self.sample_rate, self.period, self.name)

    def __add__(self, other: object) -> Signal:
        """Append another signal (`then`), or add a number to every value (`shifted`)."""
        if isinstance(other, Real):
            return self.shifted(finite("offset", other))
        if not isinstance(other, Signal):
            return NotImplemented
        return self.then(other)

    __radd__ = __add__

    def __sub__(self, offset: object) -> Signal:
        """Subtract a number from every value."""
        if not isinstance(offset, Real):
            return NotImplemented
        return self.shifted(-finite("offset", offset))

    def __rsub__(self, offset: object) -> Signal:
        """Subtract every value from a number; `np.float64(2) - signal` is NumPy's, a plain array."""
        if not isinstance(offset, Real):
            return NotImplemented
        return -self + offset

    def __mul__(self, factor: object) -> Signal:
        """Scale by a number; `np.float64(2) * signal` is NumPy's product, a plain array."""
        if not isinstance(factor, Real):
            return NotImplemented
        return Signal(finite("factor", factor) * self.values, self.sample_rate, self.period, self.name)

    __rmul__ = __mul__

    def __neg__(self) -> Signal:
        return self * -1.0

    def shifted(self, offset: float) -> Signal:
        """Return the signal plus a constant.

        Parameters
        ----------
        offset : float
            Added to every value, in its unit.

        Raises
        ------
        ValueError
            If `offset` is not a finite number.
        """
        return Signal(self.values + finite("offset", offset), self.sample_rate, self.period, self.name)


def smooth_rise(n: int) -> FloatArray:
    """Rise from 0 towards 1, which the sample after these would be; slope and curvature zero at both ends."""
    s = np.arange(n) / max(n, 1)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def check_continuity(values: ArrayLike, sample_rate: float | None = None, name: str = "signal") -> None:
    """Refuse samples with jumps, which the Coleman-Hodgdon model cannot take.

    The model is defined for continuous inputs with a bounded derivative (paper, below (1)): "not unfiltered
    steps and square-waves". Samples are never continuous, so the test is one of proportion. The increment
    between two samples is a jump if it is

    - larger than 5 % of the peak-to-peak range, and
    - alone: fewer than three of the five increments before it and the five after it reach a twentieth
      of its size (at the ends of the record: fewer than all, if there are only one or two).

    A rise therefore has to spread over at least four samples. Coarse sampling passes, because there
    neighbouring increments are alike: a sine of 50 samples a period, even of 5, or white noise. So do a
    dwell followed by a ramp and a quantised slow signal (steps below 5 % of the range). Square waves,
    staircases of up to 20 steps, unfiltered PRBS and single-sample spikes are refused: the increments
    around theirs are zero or small. Where the signal starts from is not judged.

    Parameters
    ----------
    values : array_like, shape (N,)
        Samples, in any unit.
    sample_rate : float, optional
        Hz, for the time in the message.
    name : str
        What the message calls the values.

    Raises
    ------
    ValueError
        If there is a jump; the message says where, and what to do instead. If `values` is not of shape
        (N,) or not finite.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.signals.check_continuity(pz.signals.sine(5.0, 5.0, 2, 1000.0))
    >>> pz.signals.check_continuity([0.0, 0.0, 5.0, 5.0, 5.0, 5.0])  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ValueError: signal jumps by 5 ...
    """
    values = array_1d(name, values)
    if values.size < 3:
        return
    increments = np.abs(np.diff(values))
    extent = float(np.ptp(values))
    candidates = np.flatnonzero(increments > JUMP_FRACTION_OF_RANGE * extent)
    if candidates.size == 0:
        return
    padding = np.full(NEIGHBOURS_ON_EACH_SIDE, np.nan)
    padded = np.concatenate([padding, increments, padding])
    offsets = np.delete(np.arange(2 * NEIGHBOURS_ON_EACH_SIDE + 1), NEIGHBOURS_ON_EACH_SIDE)
    neighbours = padded[candidates[:, None] + offsets]
    present = np.sum(np.isfinite(neighbours), axis=1)
    alike = np.sum(JUMP_RATIO * neighbours >= increments[candidates, None], axis=1)
    jumps = candidates[alike < np.minimum(present, NEIGHBOURS_ALIKE)]
    if jumps.size == 0:
        return
    first = int(jumps[0])
    size = float(increments[first])
    time = "" if sample_rate is None else f" (t = {(first + 1) / positive('sample_rate', sample_rate):g} s)"
    others = f", and {jumps.size - 1} more like it" if jumps.size > 1 else ""
    raise ValueError(
        f"{name} jumps by {size:.4g} ({100.0 * size / extent:.0f} % of its range) between samples {first} "
        f"and {first + 1}{time}{others}: the Coleman-Hodgdon model needs a "
        "continuous input; use signals.filtered_steps(...) or signals.prbs(...), or low-pass the samples "
        "first"
    )
