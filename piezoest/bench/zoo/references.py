"""References of the zoo: waves, rasters, walks and steps, as arrays of any length."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest import signals
from piezoest._checks import FloatArray

WALK_SWINGS, LEVELS = 4, 8  # waves in a cycle of the walk; levels in a cycle of the steps
ROUNDED = 40  # part of a period over which a raster's corners are rounded, as its inverse


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """A reference that a rig is to follow."""

    kind: str  # name in `SHAPES`
    values: FloatArray  # (N,): [µm]
    amplitude: float  # half of its range [µm]
    centre: float  # its middle [µm]
    frequency: float  # [Hz]; of what is no wave, that of about as fast a one
    wave: float  # samples in a wave
    cycle: int  # samples after which it repeats itself, or the longest wave
    begins: int  # samples of the way from rest to its beginning

    @property
    def repeats(self) -> bool:
        """Whether each cycle is like the one before."""
        return self.kind in REPEATING


def _triangle(n: int, f: float, fs: float, rng: Any) -> FloatArray:
    return signals.triangle(1.0, f, n * f / fs, fs, smoothing=rng.choice([0.02, 0.1])).values


def _sine(n: int, f: float, fs: float, rng: Any) -> FloatArray:
    return signals.sine(1.0, f, n * f / fs, fs).values


def _raster(n: int, f: float, fs: float, rng: Any) -> FloatArray:
    """Lines with a rest at each end."""
    wave = signals.triangle(1.0, f, n * f / fs, fs, smoothing=0.02).values
    clipped = np.clip(rng.uniform(1.2, 2.0) * wave, -1.0, 1.0)
    width = max(1, round(fs / f / ROUNDED))
    if width == 1:
        return clipped
    padded = np.concatenate((np.zeros(width - 1), clipped))
    return np.asarray(np.convolve(padded, np.full(width, 1.0 / width), mode="valid"))


def _chirp(n: int, f: float, fs: float, rng: Any) -> FloatArray:
    start, stop = (f, 3.0 * f) if rng.random() < 0.5 else (3.0 * f, f)
    return signals.chirp(1.0, start, min(stop, 0.4 * fs), n / fs, fs).values


def _sum_of_sines(n: int, f: float, fs: float, rng: Any) -> FloatArray:
    t = np.arange(n) / fs
    sizes, factors = rng.uniform(0.2, 0.6, 2), rng.uniform(1.3, 4.0, 2)
    wave = np.sin(2.0 * np.pi * f * t)
    for size, factor in zip(sizes, factors, strict=True):
        wave = wave + size * np.sin(2.0 * np.pi * factor * f * t)
    return wave


def _walk(n: int, f: float, fs: float, rng: Any) -> FloatArray:
    """A walk from zero to zero, again and again."""
    cycle = round(WALK_SWINGS * fs / f)
    walk = signals.random_walk(1.0, 2.5 * f, cycle / fs, fs, seed=int(rng.integers(1 << 30))).values
    return np.resize(walk, n)


def _steps(n: int, f: float, fs: float, rng: Any) -> FloatArray:
    """Levels from one end to the other, smoothed."""
    levels = rng.uniform(-1.0, 1.0, LEVELS)
    levels[rng.permutation(LEVELS)[:2]] = (-1.0, 1.0)
    cutoff = min(rng.uniform(3.0, 10.0) * f, 0.2 * fs)
    cycle = signals.filtered_steps(levels, 0.5 / f, fs, cutoff=cutoff, periods=1)
    return np.resize(cycle.values, n)


SHAPES: dict[str, Callable[[int, float, float, Any], FloatArray]] = {
    "triangle": _triangle, "sine": _sine, "raster": _raster, "chirp": _chirp, "sum-of-sines": _sum_of_sines,
    "walk": _walk, "steps": _steps, "beyond": _triangle,
}  # fmt: skip
REPEATING = ("triangle", "sine", "raster", "walk", "steps", "beyond")
CYCLES = {"walk": float(WALK_SWINGS), "steps": 0.5 * LEVELS}


def cycle_of(kind: str) -> float:
    """Waves in a cycle. `kind`: name in `SHAPES`."""
    return CYCLES.get(kind, 1.0)


def build(
    kind: str,
    *,
    amplitude: float,
    centre: float,
    frequency: float,
    sample_rate: float,
    waves: float,
    rng: Any,
) -> Reference:
    """Make a reference that begins at rest at 0 µm, goes to its first value and then its way."""
    n = round(waves * sample_rate / frequency)
    shape = SHAPES[kind](n, frequency, sample_rate, rng)
    high, low = shape.max(), shape.min()
    values = centre + amplitude * (shape - 0.5 * (high + low)) / (0.5 * (high - low))
    begins = 0
    if abs(values[0]) > 0.02 * amplitude:
        begins = max(2, round(0.5 * sample_rate / frequency))
        way = 0.5 - 0.5 * np.cos(np.pi * np.arange(begins) / begins)
        values = np.concatenate((values[0] * way, values))
    return Reference(
        kind=kind,
        values=values,
        amplitude=amplitude,
        centre=centre,
        frequency=frequency,
        wave=sample_rate / frequency,
        cycle=round(cycle_of(kind) * sample_rate / frequency),
        begins=begins,
    )
