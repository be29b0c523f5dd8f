"""Stages with something wrong between them and the rest of the ring.

Every fault is seeded, and `step` and `run` give the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, array_1d, fraction, integer, non_negative, positive

FOREVER = 1e9  # s


@dataclass(eq=False)
class FaultyStage:
    """A stage with something between it and the rest of the ring; by itself, nothing."""

    stage: Any  # such as `PaperStage`
    seed: int = field(default=0, kw_only=True)  # start of the random numbers of the fault

    def __post_init__(self) -> None:
        integer("seed", self.seed)
        self._begin()

    def _begin(self) -> None:
        self._generator = np.random.default_rng(self.seed)
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
        return float(self.stage.sample_rate)

    @property
    def displacement(self) -> Any:
        """True displacement [µm]: a float after `step`, shape (N,) after `run`."""
        return self.stage.displacement

    def step(self, u: float) -> float:
        """Apply a voltage for one sample. `u`: voltage [V]. Returns reading [µm]; NaN where there is none."""
        x = self.stage.step(float(self._voltage(np.array([float(u)]))[0]))
        return float(self._read(np.array([x]))[0])

    def run(self, u: Any) -> FloatArray:
        """Apply a voltage record; the same as a loop of `step`."""
        return self._read(self.stage.run(self._voltage(array_1d("u", u, allow_nan=True))))

    def _read(self, x: FloatArray) -> FloatArray:
        read = self._reading(x)
        self._count += x.size
        return read

    def reset(self) -> None:
        """Go back to the start, with the same random numbers."""
        self.stage.reset()
        self._begin()


@dataclass(eq=False)
class Missing(FaultyStage):
    """Single samples without a reading, at random."""

    share: float  # of the samples that are missing, within [0, 1]

    def __post_init__(self) -> None:
        fraction("share", self.share)
        super().__post_init__()

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.where(self._generator.random(x.size) < self.share, np.nan, x)


@dataclass(eq=False)
class Gap(FaultyStage):
    """No reading for a while."""

    start: float  # [s]
    duration: float = FOREVER  # [s]

    def __post_init__(self) -> None:
        non_negative("start", self.start)
        positive("duration", self.duration)
        super().__post_init__()

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.where(self._within(x.size, self.start, self.duration), np.nan, x)


@dataclass(eq=False)
class Spikes(FaultyStage):
    """Single readings that are off by `size`, up or down at random."""

    rate: float = 5.0  # [1/s]
    size: float = 10.0  # [µm]

    def _reading(self, x: FloatArray) -> FloatArray:
        drawn = self._generator.random(x.size)
        chance = self.rate / self.sample_rate
        sign = np.where(drawn < 0.5 * chance, 1.0, -1.0)
        return np.where(drawn < chance, x + sign * self.size, x)


class Stuck(Gap):
    """The reading stands still for a while. `start`, `duration`: [s]."""

    def _begin(self) -> None:
        super()._begin()
        self._held: float | None = None

    def _reading(self, x: FloatArray) -> FloatArray:
        stuck = np.flatnonzero(self._within(x.size, self.start, self.duration))
        if stuck.size == 0:
            return x
        if self._held is None:
            self._held = float(x[stuck[0]])
        read = x.copy()
        read[stuck] = self._held
        return read


@dataclass(eq=False)
class Saturation(FaultyStage):
    """A converter whose range the displacement leaves."""

    limit: float  # largest reading to either side of the centre [µm]
    centre: float = 0.0  # middle of its range [µm]

    def __post_init__(self) -> None:
        positive("limit", self.limit)
        super().__post_init__()

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.clip(x, self.centre - self.limit, self.centre + self.limit)


@dataclass(eq=False)
class Factor(FaultyStage):
    """Readings times a factor: -1 for a gauge wired the wrong way round, 1000 for nm taken for µm."""

    factor: float

    def _reading(self, x: FloatArray) -> FloatArray:
        return self.factor * x


@dataclass(eq=False)
class OffsetStep(FaultyStage):
    """The gauge's zero moves: from a time on, readings are off by a constant."""

    start: float  # [s]
    offset: float = 0.5  # [µm]

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.where(self._within(x.size, self.start, np.inf), x + self.offset, x)


class ForATime(Gap):
    """A fault between two moments only: the faulty stage is one whose fault by itself holds for ever."""

    def __post_init__(self) -> None:
        self._fault = self.stage
        self.stage = self._fault.stage
        super().__post_init__()

    def _voltage(self, u: FloatArray) -> FloatArray:
        return np.where(self._within(u.size, self.start, self.duration), self._fault._voltage(u), u)

    def _reading(self, x: FloatArray) -> FloatArray:
        # The fault's own time and random numbers go on, whether it is on or not.
        return np.where(self._within(x.size, self.start, self.duration), self._fault._read(x.copy()), x)

    def _begin(self) -> None:
        super()._begin()
        self._fault._begin()


class FrozenAmplifier(Gap):
    """The voltage stands still for a while."""

    def _begin(self) -> None:
        super()._begin()
        self._last = 0.0

    def _voltage(self, u: FloatArray) -> FloatArray:
        frozen = self._within(u.size, self.start, self.duration)
        if not frozen.any():
            self._last = float(u[-1]) if np.isfinite(u[-1]) else self._last
            return u
        put = u.copy()
        first = int(np.argmax(frozen))
        if first > 0 and np.isfinite(u[first - 1]):
            self._last = float(u[first - 1])
        put[frozen] = self._last
        return put

    def _reading(self, x: FloatArray) -> FloatArray:
        # The gauge is a good one.
        return x


@dataclass(eq=False)
class StuckStage(Gap):
    """The stage itself stands still for a while, and its gauge shows it with some noise."""

    noise: float = 0.0  # standard deviation of the reading meanwhile [µm]

    def _begin(self) -> None:
        super()._begin()
        self._held: float | None = None
        self._true: FloatArray = np.zeros(1)

    def _reading(self, x: FloatArray) -> FloatArray:
        self._true = np.array(self.stage.displacement, ndmin=1)
        stuck = self._within(x.size, self.start, self.duration)
        shown = self.noise * self._generator.standard_normal(x.size)
        if not stuck.any():
            return x
        if self._held is None:
            self._held = float(self._true[np.argmax(stuck)])
        self._true[stuck] = self._held
        read = x.copy()
        read[stuck] = self._held + shown[stuck]
        return read

    @property
    def displacement(self) -> Any:
        """True displacement [µm] of the last samples, shape (N,)."""
        return self._true


@dataclass(eq=False)
class Dead(Gap):
    """The gauge shows a level of its own, with noise, whatever the stage does."""

    level: float = 0.0  # [µm]
    noise: float = 0.0  # standard deviation [µm]

    def _reading(self, x: FloatArray) -> FloatArray:
        shown = self.level + self.noise * self._generator.standard_normal(x.size)
        return np.where(self._within(x.size, self.start, self.duration), shown, x)


@dataclass(eq=False)
class Hum(FaultyStage):
    """A sine on the reading, from the mains; the seed draws its phase."""

    size: float  # its amplitude [µm]
    frequency: float = 50.0  # [Hz]

    def _begin(self) -> None:
        super()._begin()
        self._phase = self._generator.random()

    def _reading(self, x: FloatArray) -> FloatArray:
        turns = self.frequency * (self._count + np.arange(x.size)) / self.sample_rate
        return x + self.size * np.sin(2.0 * np.pi * (turns + self._phase))


@dataclass(eq=False)
class Drift(FaultyStage):
    """The stage itself moves, slowly and steadily, as its mount warms up; the gauge sees it."""

    rate: float  # [µm/s]
    start: float = 0.0  # [s]
    duration: float = FOREVER  # after which it stays where it came to [s]

    def _begin(self) -> None:
        super()._begin()
        self._way: FloatArray = np.zeros(1)

    def _reading(self, x: FloatArray) -> FloatArray:
        time = (self._count + np.arange(x.size)) / self.sample_rate
        self._way = self.rate * np.clip(time - self.start, 0.0, self.duration)
        return x + self._way

    @property
    def displacement(self) -> Any:
        """True displacement [µm] of the last samples, shape (N,)."""
        return self.stage.displacement + self._way
