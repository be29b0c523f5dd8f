"""Voltages as users record them: shapes between -1 and 1, drawn at any number of points.

Each shape is a function of the number of points, the number of waves in them and a random generator.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from piezoest import signals
from piezoest._checks import FloatArray

# Where a wave may begin, in parts of a period: in the middle, rising, or at its lowest point.
BEGINNINGS = (0.0, 0.75)
SMALLEST = (0.1, 0.4)  # amplitude of a growing wave where it is least, relative to the largest
# Most sweeps of a growing or decaying amplitude; where there is one, the held-out part has other amplitudes.
SWEEPS = 3
ONE_SIDED = 0.5  # how often a growing wave stands on its lowest voltage
STEPS_PER_WAVE = 4
RAMP = (0.05, 0.5)  # part of a step in which the voltage moves


def _phase(n: int, waves: float, rng: Any) -> FloatArray:
    return waves * np.arange(n) / n + rng.choice(BEGINNINGS)


def _triangle_at(phase: FloatArray) -> FloatArray:
    return np.asarray(1.0 - 4.0 * np.abs((phase + 0.25) % 1.0 - 0.5))


def _sine_at(phase: FloatArray) -> FloatArray:
    return np.sin(2.0 * np.pi * phase)


def _envelope(n: int, waves: float, sweeps: int, rng: Any) -> FloatArray:
    """Amplitude that grows to 1, once or several times: evenly, or by steps between waves."""
    turn = sweeps * np.arange(n) / n % 1.0
    if rng.random() < 0.5:
        levels = int(rng.integers(3, 7))
        # Steps fall between waves: the phase counts from the start of a sweep.
        per_level = max(1, round(waves / sweeps / levels))
        turn = np.minimum(np.floor(turn * waves / sweeps / per_level) / max(levels - 1, 1), 1.0)
    least = rng.uniform(*SMALLEST)
    return np.asarray(least + (1.0 - least) * turn)


def _growing(n: int, waves: float, rng: Any) -> FloatArray:
    sweeps = int(rng.integers(1, SWEEPS + 1))
    # Whole waves in a sweep, so that the amplitude steps back where the wave passes its beginning.
    waves = sweeps * max(3, round(waves / sweeps))
    wave: Callable[[FloatArray], FloatArray] = _triangle_at if rng.random() < 0.5 else _sine_at
    if rng.random() < ONE_SIDED:
        phase = waves * np.arange(n) / n + 0.75
        return _envelope(n, waves, sweeps, rng) * (1.0 + wave(phase)) - 1.0
    return _envelope(n, waves, sweeps, rng) * wave(waves * np.arange(n) / n)


def _sines(n: int, waves: float, rng: Any) -> FloatArray:
    t = np.arange(n) / n
    wave = np.sin(2.0 * np.pi * waves * t)
    for _ in range(int(rng.integers(1, 5))):
        factor, size, phase = rng.uniform(0.3, 1.7), rng.uniform(0.3, 1.0), rng.random()
        wave = wave + size * np.sin(2.0 * np.pi * (factor * waves * t + phase))
    return wave


def _walk(n: int, waves: float, rng: Any) -> FloatArray:
    seed = int(rng.integers(1 << 30))
    return signals.random_walk(1.0, 2.0 * waves, 1.0, float(n), seed=seed).values


def _staircase(n: int, waves: float, rng: Any) -> FloatArray:
    """Levels with a rest on each: up and down evenly, or in any order."""
    count = max(10, round(STEPS_PER_WAVE * waves))
    if rng.random() < 0.5:
        period = 2 * int(rng.integers(4, 11))
        # In each half of it the voltage turns.
        count = max(count, 3 * period)
        levels = _triangle_at(np.arange(count) / period - 0.25)
    else:
        levels = rng.uniform(-1.0, 1.0, count)
    place = np.arange(n) * (count - 1) / n
    ramp = rng.uniform(*RAMP)
    step = place.astype(int)
    part = np.clip((place - step - (1.0 - ramp)) / ramp, 0.0, 1.0)
    return np.asarray(levels[step] + (levels[step + 1] - levels[step]) * part)


def _chirp(n: int, waves: float, rng: Any) -> FloatArray:
    t, factor = np.arange(n) / n, rng.uniform(3.0, 10.0)
    phase = waves * 2.0 / (1.0 + factor) * (t + 0.5 * (factor - 1.0) * t * t)
    wave = np.sin(2.0 * np.pi * phase)
    return wave if rng.random() < 0.7 else np.ascontiguousarray(wave[::-1])


SHAPES: dict[str, Callable[[int, float, Any], FloatArray]] = {
    "triangle": lambda n, waves, rng: _triangle_at(_phase(n, waves, rng)),
    "sine": lambda n, waves, rng: _sine_at(_phase(n, waves, rng)),
    "growing": _growing,
    "decaying": lambda n, waves, rng: np.ascontiguousarray(_growing(n, waves, rng)[::-1]),
    "sum-of-sines": _sines,
    "walk": _walk,
    "staircase": _staircase,
    "chirp": _chirp,
}


def draw_voltage(kind: str, n: int, waves: float, rng: np.random.Generator) -> FloatArray:
    """Draw a voltage of a kind, from -1 to 1."""
    shape = SHAPES[kind](n, waves, rng)
    low, high = shape.min(), shape.max()
    return np.asarray(2.0 * (shape - low) / (high - low) - 1.0)
