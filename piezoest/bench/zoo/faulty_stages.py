"""Stages with something wrong between them and the rest of the ring.

Every fault is seeded, and `step` and `run` give the same bits.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, array_1d

FOREVER = 1e9  # s


@dataclass(eq=False)
class FaultyStage:
    """A stage with something between it and the rest of the ring, for a while; by itself, nothing."""

    stage: Any  # such as `PaperStage`
    size: float = 0.0  # of the fault
    start: float = 0.0  # [s]
    duration: float = FOREVER  # [s]
    seed: int = 0  # start of the random numbers of the fault

    def __post_init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self._generator = np.random.default_rng(self.seed)
        self._count = 0  # index of the next sample
        self._held: Any = None  # what stands still meanwhile

    def _voltage(self, u: FloatArray, on: Any) -> FloatArray:
        """What reaches the stage [V]; `on` (N,) is where the fault is there."""
        return u

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        """What the ring gets for the stage's reading [µm]."""
        return x

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        return float(self.stage.sample_rate)

    @property
    def displacement(self) -> Any:
        """True displacement [µm]."""
        return self.stage.displacement

    def _time(self, size: int) -> FloatArray:
        """Of the next samples [s]."""
        return np.asarray((self._count + np.arange(size)) / self.sample_rate)

    def step(self, u: float) -> float:
        """Apply a voltage [V] for one sample; reading [µm], NaN where there is none."""
        return float(self.run([u])[0])

    def run(self, u: Any) -> FloatArray:
        """Apply a voltage record; the same as a loop of `step`."""
        u = array_1d("u", u, allow_nan=True)
        time = self._time(u.size)
        on = (time >= self.start) & (time < self.start + self.duration)
        read = self._reading(self.stage.run(self._voltage(u, on)), on)
        self._count += u.size
        return read

    def reset(self) -> None:
        """Go back to the start, with the same random numbers."""
        self.stage.reset()
        self._begin()


class Missing(FaultyStage):
    """Single samples without a reading, at random; `size` is the share of them."""

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        return np.where((self._generator.random(x.size) < self.size) & on, np.nan, x)


class Gap(FaultyStage):
    """No reading."""

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        return np.where(on, np.nan, x)


class Spikes(FaultyStage):
    """One reading in a hundred is off by `size` [µm], up or down at random."""

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        drawn = self._generator.random(x.size)
        sign = np.where(drawn < 0.005, 1.0, -1.0)
        return np.where((drawn < 0.01) & on, x + sign * self.size, x)


class Stuck(FaultyStage):
    """The reading stands still."""

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        if self._held is None and on.any():
            self._held = float(x[np.argmax(on)])
        return np.where(on, self._held, x) if on.any() else x


@dataclass(eq=False)
class Saturation(FaultyStage):
    """A converter whose range the displacement leaves; it reaches `size` to either side [µm]."""

    centre: float = 0.0  # middle of its range [µm]

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        return np.where(on, np.clip(x, self.centre - self.size, self.centre + self.size), x)


class Factor(FaultyStage):
    """Readings times `size`: -1 for a gauge wired the wrong way round, 1000 for nm taken for µm."""

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        return np.where(on, self.size * x, x)


class Offset(FaultyStage):
    """The gauge's zero has moved: readings are off by `size` [µm]."""

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        return np.where(on, x + self.size, x)


class FrozenAmplifier(FaultyStage):
    """The voltage stands still."""

    def _begin(self) -> None:
        super()._begin()
        self._last = 0.0

    def _voltage(self, u: FloatArray, on: Any) -> FloatArray:
        before = u[: int(np.argmax(on))][-1:] if on.any() else u[-1:]
        if before.size and np.isfinite(before[0]):
            self._last = float(before[0])
        return np.where(on, self._last, u)


@dataclass(eq=False)
class StuckStage(FaultyStage):
    """The stage itself stands still, and its gauge shows it with some noise."""

    noise: float = 0.0  # standard deviation of the reading meanwhile [µm]

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        self._true: Any = np.array(self.stage.displacement, ndmin=1)
        shown = self.noise * self._generator.standard_normal(x.size)
        if not on.any():
            return x
        if self._held is None:
            self._held = float(self._true[np.argmax(on)])
        self._true[on] = self._held
        return np.where(on, self._held + shown, x)

    @property
    def displacement(self) -> Any:
        """True displacement [µm] of the last samples, shape (N,)."""
        return self._true


@dataclass(eq=False)
class Dead(FaultyStage):
    """The gauge shows a level of its own, `size` [µm], with noise, whatever the stage does."""

    noise: float = 0.0  # standard deviation [µm]

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        return np.where(on, self.size + self.noise * self._generator.standard_normal(x.size), x)


class Hum(FaultyStage):
    """A sine of 50 Hz on the reading, from the mains, of amplitude `size` [µm]; the seed draws its phase."""

    def _begin(self) -> None:
        super()._begin()
        self._phase = self._generator.random()

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        turns = 50.0 * (self._count + np.arange(x.size)) / self.sample_rate
        return np.where(on, x + self.size * np.sin(2.0 * np.pi * (turns + self._phase)), x)


class Drift(FaultyStage):
    """The stage itself moves by `size` [µm/s] as its mount warms up, and stays there; the gauge sees it."""

    def _reading(self, x: FloatArray, on: Any) -> FloatArray:
        self._way: FloatArray = self.size * np.clip(self._time(x.size) - self.start, 0.0, self.duration)
        return x + self._way

    @property
    def displacement(self) -> Any:
        """True displacement [µm] of the last samples, shape (N,)."""
        return self.stage.displacement + self._way
