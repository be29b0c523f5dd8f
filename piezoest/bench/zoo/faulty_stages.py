"""Stages with something wrong between them and the rest of the ring.

Every fault is seeded, and `step` and `run` give the same bits.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from piezoest._checks import FloatArray, array_1d, finite, fraction, integer, non_negative, positive


class FaultyStage:
    """A stage with something between it and the rest of the ring; by itself, nothing.

    `stage`: such as `PaperStage`. `seed`: start of the random numbers of the fault. ValueError if a value is
    out of its range.
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
        """Apply a voltage for one sample. `u`: voltage [V]. Returns reading [µm]; NaN where there is none."""
        x = self._stage.step(float(self._voltage(np.array([float(u)]))[0]))
        return float(self._read(np.array([x]))[0])

    def run(self, u: Any) -> FloatArray:
        """Apply a voltage record; the same as a loop of `step`.

        `u` (N,): voltage [V]. Returns (N,): readings [µm]; NaN where there is none.
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

    `share`: of the samples that are missing, within [0, 1].
    """

    def __init__(self, stage: Any, share: float, *, seed: int = 0) -> None:
        self._share = fraction("share", share)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.where(self._generator.random(x.size) < self._share, np.nan, x)


class Gap(FaultyStage):
    """No reading for a while. `start`, `duration`: [s]."""

    def __init__(self, stage: Any, start: float, duration: float = 1.0, *, seed: int = 0) -> None:
        self._interval = non_negative("start", start), positive("duration", duration)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.where(self._within(x.size, *self._interval), np.nan, x)


class Spikes(FaultyStage):
    """Single readings that are off by `size`, up or down at random. `size`: [µm]."""

    def __init__(self, stage: Any, rate: float = 5.0, size: float = 10.0, *, seed: int = 0) -> None:
        self._rate, self._size = non_negative("rate", rate), finite("size", size)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        drawn = self._generator.random(x.size)
        chance = self._rate / self.sample_rate
        sign = np.where(drawn < 0.5 * chance, 1.0, -1.0)
        return np.where(drawn < chance, x + sign * self._size, x)


class Stuck(Gap):
    """The reading stands still for a while. `start`, `duration`: [s]."""

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

    `limit`: largest reading to either side of the centre [µm]. `centre`: middle of its range [µm].
    """

    def __init__(self, stage: Any, limit: float, centre: float = 0.0, *, seed: int = 0) -> None:
        self._limit, self._centre = positive("limit", limit), finite("centre", centre)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.clip(x, self._centre - self._limit, self._centre + self._limit)


class Factor(FaultyStage):
    """Readings times a factor: -1 for a gauge wired the wrong way round, 1000 for nm taken for µm."""

    def __init__(self, stage: Any, factor: float, *, seed: int = 0) -> None:
        self._factor = finite("factor", factor)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return self._factor * x


class OffsetStep(FaultyStage):
    """The gauge's zero moves: from a time on, readings are off by a constant.

    `start`: [s]. `offset`: [µm].
    """

    def __init__(self, stage: Any, start: float, offset: float = 0.5, *, seed: int = 0) -> None:
        self._start, self._offset = non_negative("start", start), finite("offset", offset)
        super().__init__(stage, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        return np.where(self._within(x.size, self._start, np.inf), x + self._offset, x)
