"""What goes wrong in a laboratory, put around a stage: `piezoest.track` runs with it as with the stage.

Every fault is seeded, and `step` and `run` give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, array_1d, finite, fraction, integer, non_negative, positive
from piezoest.signals import Signal


class FaultyStage:
    """A stage with something between it and the rest of the ring; by itself, nothing.

    Parameters
    ----------
    stage : object with ``step``, ``run``, ``displacement``, ``reset`` and ``sample_rate``
        Such as `PaperStage`.
    seed : int
        Start of the random numbers of the fault.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    def __init__(self, stage: Any, *, seed: int = 0) -> None:
        self._stage = stage
        self._seed = integer("seed", seed)
        self._begin()

    def _begin(self) -> None:
        self._generator = np.random.default_rng(self._seed)
        self._count = 0

    def _voltage(self, u: FloatArray) -> FloatArray:
        """What reaches the stage [V]."""
        return u

    def _reading(self, x: FloatArray) -> FloatArray:
        """What the ring gets for the stage's reading [µm]; `_count` is the first sample's index."""
        return x

    def _within(self, size: int, start: float, duration: float) -> Any:
        """Which of the next samples lie within [start, start + duration) s."""
        time = (self._count + np.arange(size)) / self.sample_rate
        return (time >= start) & (time < start + duration)

    @property
    def sample_rate(self) -> float:
        """What the rest of the ring takes for the sample rate [Hz]."""
        return float(self._stage.sample_rate)

    @property
    def displacement(self) -> Any:
        """True displacement [µm]: a float after `step`, shape (N,) after `run`."""
        return self._stage.displacement

    def step(self, u: float) -> float:
        """Apply a voltage for one sample.

        Parameters
        ----------
        u : float
            Voltage [V].

        Returns
        -------
        float
            Reading [µm]; NaN where there is none.
        """
        x = self._stage.step(float(self._voltage(np.array([float(u)]))[0]))
        return float(self._read(np.array([x]))[0])

    def run(self, u: Any) -> FloatArray:
        """Apply a voltage record; the same as a loop of `step`.

        Parameters
        ----------
        u : array_like, shape (N,)
            Voltage [V].

        Returns
        -------
        ndarray, shape (N,)
            Readings [µm]; NaN where there is none.
        """
        return self._read(self._stage.run(self._voltage(array_1d("u", u, allow_nan=True))))

    def _read(self, x: FloatArray) -> FloatArray:
        read = self._reading(x)
        self._count += x.size
        return read

    def reset(self) -> None:
        """Go back to the start, with the same random numbers."""
        self._stage.reset()
        self._begin()


class Missing(FaultyStage):
    """Single samples without a reading, at random.

    Parameters
    ----------
    stage : object
        See `FaultyStage`.
    part : float
        Of the samples that are missing, within [0, 1].
    seed : int
        Start of the random numbers.
    """

    def __init__(self, stage: Any, part: float, *, seed: int = 0) -> None:
        self._part = fraction("part", part)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.where(self._generator.random(x.size) < self._part, np.nan, x)


class Gap(FaultyStage):
    """No reading for a while.

    Parameters
    ----------
    stage : object
        See `FaultyStage`.
    start, duration : float
        [s].
    seed : int
        Not used: the fault is certain.
    """

    def __init__(self, stage: Any, start: float, duration: float = 1.0, *, seed: int = 0) -> None:
        self._interval = non_negative("start", start), positive("duration", duration)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.where(self._within(x.size, *self._interval), np.nan, x)


class Spikes(FaultyStage):
    """Single readings that are off by `size`, up or down at random.

    Parameters
    ----------
    stage : object
        See `FaultyStage`.
    rate : float
        Mean number a second.
    size : float
        [µm].
    seed : int
        Start of the random numbers.
    """

    def __init__(self, stage: Any, rate: float = 5.0, size: float = 10.0, *, seed: int = 0) -> None:
        self._rate, self._size = non_negative("rate", rate), finite("size", size)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        drawn = self._generator.random(x.size)
        chance = self._rate / self.sample_rate
        sign = np.where(drawn < 0.5 * chance, 1.0, -1.0)
        return np.where(drawn < chance, x + sign * self._size, x)


class Stuck(Gap):
    """The reading stands still for a while.

    Parameters
    ----------
    stage : object
        See `FaultyStage`.
    start, duration : float
        [s].
    seed : int
        Not used: the fault is certain.
    """

    def _begin(self) -> None:
        super()._begin()
        self._held: float | None = None

    def _reading(self, x: FloatArray) -> FloatArray:
        stuck = np.flatnonzero(self._within(x.size, *self._interval))
        if stuck.size == 0:
            return x
        if self._held is None:
            self._held = float(x[stuck[0]])
        read = x.copy()
        read[stuck] = self._held
        return read


class Saturation(FaultyStage):
    """A converter whose range the displacement leaves.

    Parameters
    ----------
    stage : object
        See `FaultyStage`.
    limit : float
        Largest reading of either sign [µm].
    seed : int
        Not used: the fault is certain.
    """

    def __init__(self, stage: Any, limit: float, *, seed: int = 0) -> None:
        self._limit = positive("limit", limit)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.clip(x, -self._limit, self._limit)


class Factor(FaultyStage):
    """Readings times a factor: -1 for a gauge wired the wrong way round, 1000 for nm taken for µm.

    Parameters
    ----------
    stage : object
        See `FaultyStage`.
    factor : float
        Of the readings.
    seed : int
        Not used: the fault is certain.
    """

    def __init__(self, stage: Any, factor: float, *, seed: int = 0) -> None:
        self._factor = finite("factor", factor)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return self._factor * x


class OffsetStep(FaultyStage):
    """The gauge's zero moves: from a time on, readings are off by a constant.

    Parameters
    ----------
    stage : object
        See `FaultyStage`.
    start : float
        [s].
    offset : float
        [µm].
    seed : int
        Not used: the fault is certain.
    """

    def __init__(self, stage: Any, start: float, offset: float = 0.5, *, seed: int = 0) -> None:
        self._start, self._offset = non_negative("start", start), finite("offset", offset)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.where(self._within(x.size, self._start, np.inf), x + self._offset, x)


class WeakAmplifier(FaultyStage):
    """An amplifier that gives less than it is asked for, and does not say so.

    Parameters
    ----------
    stage : object
        See `FaultyStage`.
    limit : float
        Largest voltage of either sign [V].
    factor : float
        Of the voltage before that: -1 for an amplifier wired the wrong way round.
    seed : int
        Not used: the fault is certain.
    """

    def __init__(self, stage: Any, limit: float, factor: float = 1.0, *, seed: int = 0) -> None:
        self._limit, self._factor = positive("limit", limit), finite("factor", factor)
        super().__init__(stage, seed=seed)

    def _voltage(self, u: FloatArray) -> FloatArray:
        return np.clip(self._factor * u, -self._limit, self._limit)


class WrongRate(FaultyStage):
    """The ring takes the samples for faster than they are.

    Parameters
    ----------
    stage : object
        See `FaultyStage`.
    factor : float
        Sample rate that the ring believes in, over the true one.
    seed : int
        Not used: the fault is certain.
    """

    def __init__(self, stage: Any, factor: float = 1.1, *, seed: int = 0) -> None:
        self._factor = positive("factor", factor)
        super().__init__(stage, seed=seed)

    @property
    def sample_rate(self) -> float:
        """What the rest of the ring takes for the sample rate [Hz]."""
        return self._factor * float(self._stage.sample_rate)


@dataclass(frozen=True, slots=True)
class Fault:
    """A named fault.

    Parameters
    ----------
    name : str
        Stays what it is.
    description : str
        One line.
    stage : callable
        ``stage(make, sample_rate, seed)`` builds the faulty stage; ``make(sample_rate)`` is a
        sound one.
    reference_factor : float
        What the reference is multiplied by, where it is the reference that is wrong.
    ends : float or None
        Time after which all is well again [s]; None if it stays.
    carried : float
        Error that no ring can know of, since its gauge is off by it [µm].
    """

    name: str
    description: str
    stage: Callable[[Callable[[float], Any], float, int], Any]
    reference_factor: float = 1.0
    ends: float | None = None
    carried: float = 0.0

    def build(self, make: Callable[[float], Any], sample_rate: float, *, seed: int = 0) -> Any:
        """Make the faulty stage.

        Parameters
        ----------
        make : callable
            Sound stage for a sample rate [Hz], such as `PaperStage`.
        sample_rate : float
            What the ring takes for it [Hz].
        seed : int
            Start of the fault's random numbers.

        Returns
        -------
        FaultyStage
        """
        return self.stage(make, positive("sample_rate", sample_rate), seed)

    def reference(self, r: Signal) -> Signal:
        """Reference under this fault: the same one, or one too large for the stage.

        Parameters
        ----------
        r : Signal
            [µm].
        """
        return r if self.reference_factor == 1.0 else self.reference_factor * r


def _around(kind: Callable[..., FaultyStage], **arguments: float) -> Callable[..., FaultyStage]:
    def stage(make: Callable[[float], Any], sample_rate: float, seed: int) -> FaultyStage:
        return kind(make(sample_rate), **arguments, seed=seed)

    return stage


def _wrong_rate(make: Callable[[float], Any], sample_rate: float, seed: int) -> FaultyStage:
    return WrongRate(make(sample_rate / 1.1), 1.1, seed=seed)


NONE = Fault("none", "Nothing is wrong.", _around(FaultyStage))

BEGINS = 1.0  # s: five periods at 5 Hz, most of what there is to learn

# Sizes are for a reference of 5 µm.
FAULTS: dict[str, Fault] = {
    fault.name: fault
    for fault in (
        Fault("missing-1", "1 % of the samples missing.", _around(Missing, part=0.01)),
        Fault("missing-50", "Half of the samples missing.", _around(Missing, part=0.5)),
        Fault("gap", "No samples for 1 s.", _around(Gap, start=BEGINS), ends=BEGINS + 1.0),
        Fault("spikes", "Five spikes of 10 µm a second.", _around(Spikes)),
        Fault("stuck", "The reading stands still for 1 s.", _around(Stuck, start=BEGINS), ends=BEGINS + 1.0),
        Fault("adc-saturation", "The converter ends at 4 µm.", _around(Saturation, limit=4.0)),
        Fault("gauge-sign", "The gauge is wired the wrong way round.", _around(Factor, factor=-1.0)),
        Fault(
            "voltage-sign", "The amplifier is wired the wrong way round.",
            _around(WeakAmplifier, limit=100.0, factor=-1.0),
        ),
        Fault("wrong-unit", "Readings in nm, taken for µm.", _around(Factor, factor=1000.0)),
        Fault(
            "offset-step", "The gauge's zero moves by 0.5 µm.", _around(OffsetStep, start=BEGINS),
            carried=0.5,
        ),
        Fault(
            "voltage-saturation", "The amplifier ends at 25 V and does not say so.",
            _around(WeakAmplifier, limit=25.0),
        ),
        Fault(
            "out-of-range", "A reference four times as large, which the stage cannot reach.",
            _around(FaultyStage), reference_factor=4.0,
        ),
        Fault("wrong-rate", "The samples are 10 % slower than everyone believes.", _wrong_rate),
    )
}  # fmt: skip
