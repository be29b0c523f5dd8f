"""Records that the oracle's cases are run on: voltages, and what a stage made of them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

import piezoest as pz

Array = NDArray[np.float64]

RATE = 1000.0
LENGTH = 2000
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
LINE = pz.LinearGain(0.15)


def rounded(values: Any) -> Array:
    """Values on a grid of 2^-30, so that another computer's `sin` and `exp` give the same records."""
    return np.asarray(np.round(np.asarray(values, dtype=np.float64) * 2.0**30) * 2.0**-30)


def sine(volts: float, frequency: float = 5.0, length: int = LENGTH) -> Array:
    return rounded(volts * np.sin(2.0 * np.pi * frequency / RATE * np.arange(length)))


def triangle(volts: float, frequency: float = 5.0, length: int = LENGTH) -> Array:
    turns = frequency / RATE * np.arange(length) + 0.25
    return rounded(volts * (4.0 * np.abs(turns - np.floor(turns) - 0.5) - 1.0) * -1.0)


def walk(volts: float, seed: int = 0, length: int = LENGTH) -> Array:
    """A random walk of the slope, held back to the middle: turns at every size."""
    rng = np.random.default_rng(seed)
    u = np.zeros(length)
    slope = 0.0
    for k in range(1, length):
        slope = 0.95 * slope + 0.05 * volts * rng.uniform(-1.0, 1.0) - 1e-3 * u[k - 1]
        u[k] = u[k - 1] + slope
    return rounded(u)


def growing(length: int = LENGTH) -> Array:
    """One amplitude after the other, two of them twice."""
    sizes = np.repeat([10.0, 33.0, 20.0, 33.0, 10.0, 45.0], -(-length // 6))[:length]
    return rounded(sizes * triangle(1.0, 10.0, length))


def dwelling(length: int = LENGTH) -> Array:
    """A triangle that rests three times, once at zero and twice on a branch."""
    index = np.arange(length)
    for start, rest in ((150, 100), (430, 150), (800, 200)):
        index = np.where(index < start, index, np.maximum(index - rest, start))
    return triangle(33.0)[index]


def answer(u: Array, noise: float = 1.5e-3, seed: int = 1, model: Any = TRUE) -> Array:
    x = model.simulate(np.ascontiguousarray(u))
    return rounded(x + noise * np.random.default_rng(seed).standard_normal(u.size))


def jump() -> tuple[Array, Array]:
    """The stage's gain changes, then its level."""
    u, x = triangle(33.0), answer(triangle(33.0))
    x[500:] *= 1.25
    x[900:] += 0.75
    return u, rounded(x)


def wild(seed: int = 4) -> tuple[Array, Array]:
    u, x, rng = sine(33.0), answer(sine(33.0)), np.random.default_rng(seed)
    odd = np.array([np.inf, -np.inf, np.nan, 1e300, -1e300, 1e30, 9e8, 5e-324])
    for values, share in ((u, 0.01), (x, 0.03)):
        places = rng.random(u.size) < share
        values[places] = rng.choice(odd, int(places.sum()))
    return u, x


def rough(seed: int = 5) -> tuple[Array, Array]:
    """Rests, spikes, gaps, a bias that drifts, a delay, missing voltages, a sensor that ends: all of it."""
    u, rng = dwelling(), np.random.default_rng(seed)
    index = np.arange(u.size)
    x = answer(rounded(np.interp(index - 1.3, index, u)), 5e-3) + 2.0 + rounded(2e-4 * index)
    x[rng.random(u.size) < 0.01] += 4.0
    x[rng.random(u.size) < 0.03] = np.nan
    x[600:680], u[950:960] = np.nan, np.nan
    return u, np.clip(x, -4.0, 9.0)


def of(u: Array) -> tuple[Array, Array]:
    return u, answer(u)


SCENARIOS: dict[str, Any] = {
    "sine": lambda: of(sine(33.0)),
    "walk": lambda: of(walk(30.0)),
    "growing": lambda: of(growing()),
    "unipolar": lambda: of(rounded(triangle(25.0) + 50.0)),
    "dwell": lambda: of(dwelling()),
    "jump": jump,
    "wild": wild,
    "rough": rough,
}
# The three that hold most.
SOME = ("rough", "growing", "jump")
