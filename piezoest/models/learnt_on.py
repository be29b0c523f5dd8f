"""The ranges of the log that a model was learnt on; outside them it has not been tested."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d, finite, non_negative, positive
from piezoest.models._base import AsFields
from piezoest.signals.turns import TURN, turns

Range = tuple[float, float]

# A range is left by more than this fraction of its width, a frequency by this fraction of itself; the rate by
# this factor, for after a turn the inverse is steeper than what it was learnt on.
BEYOND, FASTER = 0.05, 1.5
# Of the samples at which the voltage moves this fraction is no faster than the rate that is named, which is
# that over this fraction of a period: steps of a converter, and noise, are no rate.
USUAL, PERIOD = 0.995, 0.02
# Fractions of all periods that are longer and shorter than those of the frequencies named.
LONG, SHORT = 0.05, 0.95
# Of so many readings the lowest and the highest may be wild ones.
WILD = 2000


@dataclass(frozen=True, slots=True)
class LearntOn(AsFields):
    """Ranges of the log that a model was learnt on.

    Parameters
    ----------
    voltage : tuple of float
        Lowest and highest [V].
    displacement : tuple of float
        Lowest and highest [µm], without one reading in 2000 at either end.
    rate : float
        Largest |du/dt| [V/s]. 99.5 % of the samples at which the voltage moves are slower, so a step or a
        spike does not count.
    frequency : tuple of float, optional
        Lowest and highest frequency of the voltage's swings [Hz], without 5 % of the periods at either end.
        None if it has fewer than two turning points.

    Raises
    ------
    ValueError
        If a range is no pair of finite numbers that do not fall, or rate or frequency are below zero.

    Notes
    -----
    Source: a rule of this library.

    Examples
    --------
    >>> import piezoest as pz
    >>> u = pz.signals.sine(40.0, 5.0, periods=4, sample_rate=1000.0)
    >>> learnt_on = pz.models.LearntOn.of(u, 0.15 * u.values, 1000.0)
    >>> learnt_on.voltage, learnt_on.frequency
    ((-40.0, 40.0), (5.0, 5.0))
    """

    called = "learnt_on"

    voltage: Range
    displacement: Range
    rate: float
    frequency: Range | None = None

    def __post_init__(self) -> None:
        for name in ("voltage", "displacement", "frequency"):
            if name != "frequency" or self.frequency is not None:
                object.__setattr__(self, name, _range(name, getattr(self, name)))
        object.__setattr__(self, "rate", non_negative("rate", self.rate))
        if self.frequency is not None:
            non_negative("frequency", self.frequency[0])

    @classmethod
    def of(cls, u: Any, x: Any, sample_rate: float) -> Self:
        """Return the ranges of a log.

        Parameters
        ----------
        u, x : array_like, shape (N,)
            Voltage [V] and displacement [µm]; NaN where a sample is missing.
        sample_rate : float
            [Hz].

        Raises
        ------
        ValueError
            If they are not 1-D, of two lengths, or without a single number, or the rate is not above zero.
        """
        u, x = array_1d("u", u, allow_nan=True), array_1d("x", x, allow_nan=True)
        sample_rate = positive("sample_rate", sample_rate)
        if u.size != x.size:
            raise ValueError(f"u and x must have the same length, got {u.size} and {x.size}")
        u = np.where(np.isfinite(u), u, np.nan)
        known, readings = np.flatnonzero(np.isfinite(u)), np.sort(x[np.isfinite(x)])
        for name, count in (("u", known.size), ("x", readings.size)):
            if count == 0:
                raise ValueError(f"{name} holds no number: give samples that were recorded")
        voltage = float(u[known].min()), float(u[known].max())
        wild = readings.size // WILD
        frequency = _frequency(np.interp(np.arange(u.size), known, u[known]), sample_rate)
        return cls(
            voltage,
            (float(readings[wild]), float(readings[-1 - wild])),
            _rate(u, sample_rate, frequency),
            frequency,
        )

    def joined(self, other: LearntOn) -> LearntOn:
        """Return the ranges of two logs, or of two blocks of one.

        Parameters
        ----------
        other : LearntOn
            Ranges of the other one.
        """
        known = [each.frequency for each in (self, other) if each.frequency is not None]
        return LearntOn(
            _hull(self.voltage, other.voltage),
            _hull(self.displacement, other.displacement),
            max(self.rate, other.rate),
            _hull(*known) if known else None,
        )

    def left_by(self, used: LearntOn) -> tuple[str, ...]:
        """Say in what a use of the model leaves these ranges.

        Parameters
        ----------
        used : LearntOn
            Ranges of the use: of a voltage and the displacement that it is to make.

        Returns
        -------
        tuple of str
            For each range that is left by more than 5 %, and for a rate above 1.5 times the rate here, a part
            of a sentence with both figures, without a full stop.
        """
        said = [
            f"the {name} goes from {ends(now, unit)}, the model was learnt from {ends(known, unit)}"
            for name, known, now, unit in (
                ("displacement", self.displacement, used.displacement, "µm"),
                ("voltage", self.voltage, used.voltage, "V"),
            )
            if now[0] < allowed(known)[0] or now[1] > allowed(known)[1]
        ]
        if used.rate > FASTER * self.rate:
            said.append(
                f"the voltage changes by up to {figure(used.rate)} V/s, the model was learnt at up to "
                f"{figure(self.rate)} V/s"
            )
        if self.frequency is not None and used.frequency is not None:
            (low, high), (lowest, highest) = self.frequency, used.frequency
            if lowest * (1.0 + BEYOND) < low or highest > high * (1.0 + BEYOND):
                said.append(
                    f"the voltage swings at {ends(used.frequency, 'Hz')}, the model was learnt at "
                    f"{ends(self.frequency, 'Hz')}"
                )
        return tuple(said)


def allowed(known: Range) -> Range:
    """A range, wider by 5 % of its width on either side."""
    margin = BEYOND * (known[1] - known[0])
    return known[0] - margin, known[1] + margin


def figure(value: float) -> str:
    """Three figures, without an exponent."""
    return np.format_float_positional(value, precision=3, fractional=False, trim="-")


def ends(known: Range, unit: str) -> str:
    """A range in words, with its unit."""
    low, high = (figure(each) for each in known)
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def _range(name: str, value: Any) -> Range:
    """A pair of finite numbers that do not fall."""
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise ValueError(f"{name} must be a pair of the lowest and the highest, got {value!r}")
    low, high = (finite(name, each) for each in value)
    if low > high:
        raise ValueError(f"{name} must be the lowest and the highest, got {low:g} and {high:g}: swap them")
    return low, high


def _hull(*ranges: Range) -> Range:
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def _frequency(u: FloatArray, sample_rate: float) -> Range | None:
    """Frequencies of the swings; a period is from one turn to the next but one."""
    places = turns(u, TURN * float(np.ptp(u)))
    if places.size < 2:
        return None
    periods = places[2:] - places[:-2] if places.size > 2 else 2 * np.diff(places)
    short, long = np.quantile(periods, (LONG, SHORT))
    return float(sample_rate / long), float(sample_rate / short)


def _rate(u: FloatArray, sample_rate: float, frequency: Range | None) -> float:
    """Rate that hardly any sample at which the voltage moves exceeds."""
    lag = 1 if frequency is None else max(1, int(PERIOD * sample_rate / frequency[1]))
    change = np.abs(u[lag:] - u[:-lag])
    moving = change[change > 0.0]  # not where one is missing
    return float(np.quantile(moving, USUAL)) * sample_rate / lag if moving.size else 0.0
