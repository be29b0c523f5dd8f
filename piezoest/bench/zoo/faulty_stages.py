"""Stages with something wrong between them and the rest of the ring.

Every fault is seeded, and `step` and `run` give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, array_1d

FOREVER = 1e9  # s
HUM = 50.0  # Hz, of the mains


@dataclass(eq=False)
class FaultyStage:
    """A stage with something between it and the rest of the ring, for a while; by itself, nothing."""

    stage: Any  # such as `PaperStage`
    size: float = 0.0  # of the fault
    start: float = 0.0  # [s]
    duration: float = FOREVER  # [s]
    seed: int = 0  # start of the random numbers of the fault
    noise: float = 0.0  # standard deviation of a reading of its own [µm]
    centre: float = 0.0  # middle of the range of readings [µm]
    # What is read where the fault is, from a sound gauge's readings (N,) [µm].
    reading: Callable[[FaultyStage, FloatArray], Any] = lambda own, x: x

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.seed)
        self._count = 0  # index of the next sample
        self._held: Any = None  # what stands still meanwhile

    def _voltage(self, u: FloatArray, on: Any) -> FloatArray:
        """What reaches the stage [V]; `on` (N,) is where the fault is there."""
        return u

    def _read(self, x: FloatArray, on: Any) -> FloatArray:
        """What the ring gets for the stage's reading [µm]."""
        return np.where(on, self.reading(self, x), x)

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        return float(self.stage.sample_rate)

    @property
    def displacement(self) -> Any:
        """True displacement [µm] of the last samples, shape (N,)."""
        return self.stage.displacement

    def index(self, size: int) -> Any:
        """Of the next samples, since the start."""
        return self._count + np.arange(size)

    def step(self, u: float) -> float:
        """Apply a voltage [V] for one sample; reading [µm], NaN where there is none."""
        return float(self.run([u])[0])

    def run(self, u: Any) -> FloatArray:
        """Apply a voltage record; the same as a loop of `step`."""
        u = array_1d("u", u, allow_nan=True)
        time = self.index(u.size) / self.sample_rate
        on = (time >= self.start) & (time < self.start + self.duration)
        read = self._read(self.stage.run(self._voltage(u, on)), on)
        self._count += u.size
        return read


class FrozenAmplifier(FaultyStage):
    """The voltage stands still."""

    def _voltage(self, u: FloatArray, on: Any) -> FloatArray:
        before = u[: int(np.argmax(on))][-1:] if on.any() else u[-1:]
        if before.size and np.isfinite(before[0]):
            self._held = float(before[0])
        return np.where(on, self._held or 0.0, u)


class StuckGauge(FaultyStage):
    """The reading stands still."""

    def _read(self, x: FloatArray, on: Any) -> FloatArray:
        if self._held is None and on.any():
            self._held = float(x[np.argmax(on)])
        return np.where(on, self._held, x) if on.any() else x


class StuckStage(StuckGauge):
    """The stage itself stands still, and its gauge shows it with some noise."""

    def _read(self, x: FloatArray, on: Any) -> FloatArray:
        self._true = super()._read(np.array(self.stage.displacement, ndmin=1), on)
        noise = self.noise * self.random.standard_normal(x.size)
        return np.where(on, self._true + noise, x)

    @property
    def displacement(self) -> Any:
        """True displacement [µm] of the last samples, shape (N,)."""
        return self._true


class Drift(FaultyStage):
    """The stage itself moves by `size` [µm/s] as its mount warms up, and stays there; the gauge sees it."""

    def _read(self, x: FloatArray, on: Any) -> FloatArray:
        time = self.index(x.size) / self.sample_rate
        self._way: FloatArray = self.size * np.clip(time - self.start, 0.0, self.duration)
        return x + self._way

    @property
    def displacement(self) -> Any:
        """True displacement [µm] of the last samples, shape (N,)."""
        return self.stage.displacement + self._way


def spikes(own: FaultyStage, x: FloatArray) -> FloatArray:
    """One reading in a hundred is off by `size` [µm], up or down at random."""
    drawn = own.random.random(x.size)
    sign = np.where(drawn < 0.005, 1.0, -1.0)
    return np.where(drawn < 0.01, x + sign * own.size, x)


def hum(own: FaultyStage, x: FloatArray) -> FloatArray:
    """A sine of 50 Hz on the reading, from the mains, of amplitude `size` [µm]; the seed draws its phase."""
    turns, phase = HUM * own.index(x.size) / own.sample_rate, np.random.default_rng(own.seed).random()
    return x + own.size * np.sin(2.0 * np.pi * (turns + phase))


# Readings while the fault is there, by what is wrong.
READINGS: dict[str, Callable[[FaultyStage, FloatArray], Any]] = {
    "spikes": spikes,
    "hum": hum,
    # `size` is the share of the samples without a reading, at random.
    "missing": lambda own, x: np.where(own.random.random(x.size) < own.size, np.nan, x),
    "gap": lambda own, x: np.nan,
    # A converter whose range the displacement leaves; it reaches `size` to either side.
    "saturated": lambda own, x: np.clip(x, own.centre - own.size, own.centre + own.size),
    # -1 for a gauge wired the wrong way round, 1000 for nm taken for µm.
    "scaled": lambda own, x: own.size * x,
    # The gauge's zero has moved.
    "moved": lambda own, x: x + own.size,
    # A level of its own, with noise, whatever the stage does.
    "dead": lambda own, x: own.size + own.noise * own.random.standard_normal(x.size),
}


def reads(what: str) -> Callable[..., FaultyStage]:
    """Maker of a stage with one of `READINGS`."""
    return partial(FaultyStage, reading=READINGS[what])
