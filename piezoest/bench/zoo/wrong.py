"""Faulty stages beside those of `piezoest.bench.zoo.faulty_stages`: for a time, and of the stage itself."""

from __future__ import annotations

from typing import Any

import numpy as np

from piezoest._checks import FloatArray, finite, non_negative
from piezoest.bench.zoo.faulty_stages import FaultyStage, Gap

FOREVER = 1e9  # s


class ForATime(Gap):
    """A fault between two moments only.

    `fault`: with the stage; by itself it holds for ever. `start`, `duration`: [s].
    """

    def __init__(self, fault: FaultyStage, start: float, duration: float = FOREVER, *, seed: int = 0) -> None:
        self._fault: Any = fault
        super().__init__(self._fault._stage, start, duration, seed=seed)

    def _voltage(self, u: FloatArray) -> FloatArray:
        return np.where(self._within(u.size, *self._interval), self._fault._voltage(u), u)

    def _reading(self, x: FloatArray) -> FloatArray:
        # The fault's own time and random numbers go on, whether it is on or not.
        return np.where(self._within(x.size, *self._interval), self._fault._read(x.copy()), x)

    def _begin(self) -> None:
        super()._begin()
        self._fault._begin()


class FrozenAmplifier(Gap):
    """The voltage stands still for a while."""

    def _begin(self) -> None:
        super()._begin()
        self._last = 0.0

    def _voltage(self, u: FloatArray) -> FloatArray:
        frozen = self._within(u.size, *self._interval)
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


class StuckStage(Gap):
    """The stage itself stands still for a while, and its gauge shows it with some noise.

    `start`, `duration`: [s]. `noise`: standard deviation of the reading meanwhile [µm].
    """

    def __init__(
        self, stage: Any, start: float, duration: float = FOREVER, noise: float = 0.0, *, seed: int = 0
    ) -> None:
        self._noise = non_negative("noise", noise)
        super().__init__(stage, start, duration, seed=seed)

    def _begin(self) -> None:
        super()._begin()
        self._held: float | None = None
        self._true: FloatArray = np.zeros(1)

    def _reading(self, x: FloatArray) -> FloatArray:
        self._true = np.array(self._stage.displacement, ndmin=1)
        stuck = self._within(x.size, *self._interval)
        shown = self._noise * self._generator.standard_normal(x.size)
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


class Dead(Gap):
    """The gauge shows a level of its own, with noise, whatever the stage does.

    `start`, `duration`: [s]. `level`, `noise`: what it shows and the standard deviation of its noise [µm].
    """

    def __init__(
        self,
        stage: Any,
        start: float,
        duration: float = FOREVER,
        level: float = 0.0,
        noise: float = 0.0,
        *,
        seed: int = 0,
    ) -> None:
        self._level, self._noise = finite("level", level), non_negative("noise", noise)
        super().__init__(stage, start, duration, seed=seed)

    def _reading(self, x: FloatArray) -> FloatArray:
        shown = self._level + self._noise * self._generator.standard_normal(x.size)
        return np.where(self._within(x.size, *self._interval), shown, x)


class Hum(FaultyStage):
    """A sine on the reading, from the mains.

    `size`: its amplitude [µm]. `frequency`: [Hz]. `seed`: start of the random numbers: its phase.
    """

    def __init__(self, stage: Any, size: float, frequency: float = 50.0, *, seed: int = 0) -> None:
        self._size, self._frequency = non_negative("size", size), non_negative("frequency", frequency)
        super().__init__(stage, seed=seed)

    def _begin(self) -> None:
        super()._begin()
        self._phase = self._generator.random()

    def _reading(self, x: FloatArray) -> FloatArray:
        turns = self._frequency * (self._count + np.arange(x.size)) / self.sample_rate
        return x + self._size * np.sin(2.0 * np.pi * (turns + self._phase))


class Drift(FaultyStage):
    """The stage itself moves, slowly and steadily, as its mount warms up; the gauge sees it.

    `rate`: [µm/s]. `start`, `duration`: when it moves [s]; it stays where it came to.
    """

    def __init__(
        self, stage: Any, rate: float, start: float = 0.0, duration: float = FOREVER, *, seed: int = 0
    ) -> None:
        self._rate = finite("rate", rate)
        self._interval = non_negative("start", start), non_negative("duration", duration)
        super().__init__(stage, seed=seed)

    def _begin(self) -> None:
        super()._begin()
        self._way: FloatArray = np.zeros(1)

    def _reading(self, x: FloatArray) -> FloatArray:
        time = (self._count + np.arange(x.size)) / self.sample_rate
        self._way = self._rate * np.clip(time - self._interval[0], 0.0, self._interval[1])
        return x + self._way

    @property
    def displacement(self) -> Any:
        """True displacement [µm] of the last samples, shape (N,)."""
        return self._stage.displacement + self._way
