"""A recorded log from a seed: a stage of some family, a voltage that moves it, and what spoils recordings.

The voltage is a function of time, drawn on a grid finer than the samples; so the delay of a gauge may be a
fraction of a sample, as it is where an amplifier and a gauge have filters.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, integer
from piezoest.bench.zoo.families import FAMILIES, Reach, draw_family, log_uniform
from piezoest.bench.zoo.voltages import SHAPES, draw_voltage
from piezoest.models import Creep

REACHES = (Reach(0.0, 10.0), Reach(0.0, 150.0), Reach(-20.0, 120.0), Reach(-10.0, 10.0), Reach(-100.0, 100.0))
STROKE = (5.0, 500.0)  # over the whole reach [µm]
WIDTH = (0.03, 0.25)  # of the loop over the reach, relative to the stroke
SPAN = (0.3, 1.0)  # part of the reach that the log's voltage uses
SAMPLES = (3_000, 50_000)
SAMPLE_RATES = (200.0, 500.0, 1e3, 2e3, 5e3, 1e4, 2e4)  # Hz
FEWEST_WAVES, MOST_WAVES, POINTS_IN_WAVE = 5.0, 80.0, 50
FINER = 8  # points of the voltage in a sample
CYCLES, LEG = 6, 200  # most turns before the log begins, and points of the way to each
LONGEST_DELAY = 5.0  # samples

# Chance and sizes of what is added. Sizes of displacements are relative to the stroke in the log.
NOISE = (1e-4, 5e-3)  # always
CREEP = (0.5, 0.003, 0.03)  # share of the displacement for each decade of time
DRIFT = (0.4, 0.002, 0.03)  # over the log
JUMPS = (0.25, 0.005, 0.05)  # one or two
SPIKES = (0.3, 1e-4, 1e-2)  # part of the samples
SPIKE_SIZE = (0.05, 1.0)
DROPOUTS = (0.3, 1e-3, 0.05)  # part of the samples, in gaps
LONGEST_GAP, ROWS = 0.01, 0.3  # part of the log; how often the voltage is missing, too
REST = (0.3, 0.02, 0.15)  # part of the log
DELAY, CYCLED = 0.6, 0.7  # chances alone
ADDED = (
    "noise", "creep", "drift", "jumps", "spikes", "dropouts", "rows", "rest", "delay", "cycled", "beyond",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Log:
    """A simulated recording, a function of its seed alone, and what only its maker knows."""

    seed: int
    u: FloatArray = field(repr=False)  # recorded voltage (N,) [V]; NaN where samples are missing
    x: FloatArray = field(repr=False)  # recorded displacement (N,) [µm]
    sample_rate: float  # [Hz]
    # Displacement (N,) of hysteresis, creep and drift, delayed, without noise, spikes and jumps [µm].
    truth: FloatArray = field(repr=False)
    jumps: FloatArray = field(repr=False)  # what jumps of the gauge have added to it until then (N,) [µm]
    spikes: Any = field(repr=False)  # where the reading is a spike (N,)
    family: str  # name in `piezoest.bench.zoo.families.FAMILIES`
    model: Any  # the hysteresis
    voltage: str  # name in `piezoest.bench.zoo.voltages.SHAPES`
    stroke: float  # largest less least displacement of the truth [µm]
    # How much of each of `ADDED`: of noise, drift and jumps relative to the stroke, of creep the share for
    # each decade of time, of spikes, dropouts and rest the part of the samples, of the delay the samples, of
    # `cycled` the turns before the log. `rows` are dropouts of the voltage, too; `beyond` is how far the
    # voltage of the second half leaves the first half's, relative to that.
    added: dict[str, float]

    @property
    def noise(self) -> float:
        """Standard deviation of the noise [µm]."""
        return self.added["noise"] * self.stroke


def draw(seed: int, *, family: str | None = None, clean: bool = False) -> Log:
    """Draw a stage and a recording of it."""
    rng = np.random.default_rng(integer("seed", seed))
    reach = REACHES[int(rng.integers(len(REACHES)))]
    gain = log_uniform(rng, *STROKE) / (2.0 * reach.half)
    drawn = str(rng.choice(list(FAMILIES)))
    family = drawn if family is None else family
    model = draw_family(family, rng, reach, width=rng.uniform(*WIDTH), gain=gain)
    n, sample_rate = round(log_uniform(rng, *SAMPLES)), float(rng.choice(SAMPLE_RATES))
    kind = str(rng.choice(list(SHAPES)))
    added: dict[str, float] = {}

    rest = round(n * _maybe(rng, *REST))
    voltage = _voltage(rng, kind, reach, n, rest)
    before = _before(rng, reach, voltage[0], added)
    w = model.simulate(np.concatenate((before, voltage)))
    if creep := 0.0 if clean else _maybe(rng, *CREEP):
        # The slowest terms outlast the log: there is always creep that has not come to its end.
        terms = Creep.logarithmic(
            creep, shortest=10.0 / sample_rate, longest=10.0 * n / sample_rate, terms_per_decade=2
        )
        w = w + terms.simulate(w, sample_rate=FINER * sample_rate)
    delay = round(FINER * LONGEST_DELAY * rng.random()) if rng.random() < DELAY else 0
    first = before.size - delay
    truth, u = w[first : first + FINER * n : FINER].copy(), voltage[::FINER].copy()
    truth += rng.uniform(-1.0, 1.0) * float(np.ptp(truth))
    drift = 0.0 if clean else _drifted(rng, truth)
    stroke = float(np.ptp(truth))

    noise = log_uniform(rng, *NOISE)
    x = truth + noise * stroke * rng.standard_normal(n)
    jumps = np.zeros(n) if clean else _jumps(rng, n, stroke)
    x += jumps
    spikes = rng.random(n) < (0.0 if clean else _maybe(rng, *SPIKES))
    far = SPIKE_SIZE[0] * (SPIKE_SIZE[1] / SPIKE_SIZE[0]) ** rng.random(n) * rng.choice((-1.0, 1.0), n)
    x[spikes] += stroke * far[spikes]
    missing = _missing(rng, n)
    x[missing] = np.nan
    rows = missing.any() and rng.random() < ROWS
    half = slice(0, n // 2)
    beyond = max(u.max() - u[half].max(), u[half].min() - u.min()) / float(np.ptp(u[half]))
    if rows:
        u[missing] = np.nan
    added |= {
        "noise": noise, "creep": creep, "drift": drift,
        "jumps": float(np.max(np.abs(jumps))) / stroke, "spikes": float(spikes.mean()),
        "dropouts": float(missing.mean()), "rows": float(rows), "rest": rest / n, "delay": delay / FINER,
        "beyond": beyond if beyond > 0.05 else 0.0,
    }  # fmt: skip
    return Log(
        seed=seed, u=u, x=x, sample_rate=sample_rate, truth=truth, jumps=jumps, spikes=spikes,
        family=family, model=model, voltage=kind, stroke=stroke,
        added={name: float(added[name]) for name in ADDED if added.get(name)},
    )  # fmt: skip


def _maybe(rng: np.random.Generator, chance: float, low: float, high: float) -> float:
    """Log-uniform, or zero."""
    size = log_uniform(rng, low, high)
    return size if rng.random() < chance else 0.0


def _voltage(rng: np.random.Generator, kind: str, reach: Reach, n: int, rest: int) -> FloatArray:
    """Voltage on the fine grid, shape (FINER n,) [V]; it rests first."""
    waves = log_uniform(rng, FEWEST_WAVES, min(MOST_WAVES, (n - rest) / POINTS_IN_WAVE))
    shape = draw_voltage(kind, FINER * (n - rest), waves, rng)
    half = reach.half * rng.uniform(*SPAN)
    # From the end that is 0 V, as most do with a unipolar amplifier, or anywhere.
    middle = rng.uniform(reach.low + half, reach.high - half)
    if rng.random() < 0.5:
        middle = reach.low + half if reach.low == 0.0 else reach.middle
    return middle + half * np.concatenate((np.full(FINER * rest, shape[0]), shape))


def _before(rng: np.random.Generator, reach: Reach, first: float, added: dict[str, float]) -> FloatArray:
    """Voltage before the log, from rest at 0 V to its first value by way of some turns [V]."""
    turns = int(rng.integers(1, CYCLES + 1)) if rng.random() < CYCLED else 0
    places = [0.0, *rng.uniform(reach.low, reach.high, turns), first]
    added["cycled"] = float(turns)
    way = np.arange(LEG * (turns + 1)) / LEG
    return np.interp(way, np.arange(turns + 2), places)


def _drifted(rng: np.random.Generator, truth: FloatArray) -> float:
    """Add a drift to the truth, bent like a thing that warms up; returns its size."""
    size, bend = _maybe(rng, *DRIFT), rng.uniform(0.0, 3.0)
    t = np.arange(truth.size) / truth.size
    way = t if bend < 0.5 else (1.0 - np.exp(-bend * t)) / (1.0 - np.exp(-bend))
    truth += rng.choice((-1.0, 1.0)) * size * float(np.ptp(truth)) * way
    return size


def _jumps(rng: np.random.Generator, n: int, stroke: float) -> FloatArray:
    jumps = np.zeros(n)
    count = int(rng.integers(1, 3)) if rng.random() < JUMPS[0] else 0
    for _ in range(count):
        jumps[round(n * rng.uniform(0.05, 0.95)) :] += (
            stroke * log_uniform(rng, *JUMPS[1:]) * rng.choice((-1.0, 1.0))
        )
    return jumps


def _missing(rng: np.random.Generator, n: int) -> Any:
    """Samples that are missing, in gaps of any length."""
    missing = np.zeros(n, bool)
    part = _maybe(rng, *DROPOUTS)
    while missing.sum() < part * n:
        start, length = int(rng.integers(n)), round(log_uniform(rng, 1.0, LONGEST_GAP * n))
        missing[start : start + length] = True
    return missing
