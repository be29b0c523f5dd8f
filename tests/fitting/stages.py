"""Stages of plays and voltages drawn at random, and plays by plain NumPy."""

import numpy as np

import piezoest as pz
from piezoest._checks import FloatArray

RATE, N = 1000.0, 5000
T = np.arange(N) / RATE


def voltage(rng: np.random.Generator, half: float = 40.0, centre: float = 0.0) -> FloatArray:
    """Two sines of unlike frequencies [V], the greater one steady, growing or dying away."""
    slow, fast = rng.uniform(1.0, 2.5), rng.uniform(3.0, 8.0)
    first, last = [(1.0, 1.0), (0.5, 1.0), (1.0, 0.5)][rng.integers(3)]
    wave = np.linspace(first, last, N) * np.sin(2.0 * np.pi * slow * T + rng.uniform(0.0, 6.0))
    return np.asarray(centre + half * (0.8 * wave + 0.2 * np.sin(2.0 * np.pi * fast * T)))


def stage(
    rng: np.random.Generator,
    half: float = 40.0,
    *,
    plays: int = 12,
    creep: pz.Creep | None = None,
    bends: int = 0,
) -> pz.PrandtlIshlinskii:
    """Plays of which all move over a range of twice `half` [V], with a gain of 0.02 to 2 µm/V."""
    gain = float(np.exp(rng.uniform(np.log(0.02), np.log(2.0))))
    weights = rng.uniform(0.2, 1.0, plays)
    weights *= 0.6 * gain / weights.sum()
    changes = rng.uniform(-0.1, 0.1, (bends, 1 + plays)) * np.append(gain, weights)
    return pz.PrandtlIshlinskii(
        gain, np.sort(rng.uniform(0.05, 0.8, plays)) * half, weights, rng.uniform(-1.0, 1.0) * gain * half,
        creep, np.sort(rng.uniform(-0.7, 0.7, bends)) * half, changes, RATE,
    )  # fmt: skip


def noise(size: float, seed: int = 0, count: int = N) -> FloatArray:
    return size * np.random.default_rng([seed, 7]).standard_normal(count)


def rms(error: FloatArray) -> float:
    return float(np.sqrt(np.mean(error**2)))
