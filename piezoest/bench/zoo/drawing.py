"""A rig from a seed."""

from dataclasses import replace
from typing import Any

import numpy as np

from piezoest._checks import integer
from piezoest.bench.zoo.families import FAMILIES, Reach, draw_family, log_uniform
from piezoest.bench.zoo.faults import FAULTS, NONE, draw_fault
from piezoest.bench.zoo.references import SHAPES, Reference, build, cycle_of
from piezoest.bench.zoo.rig import MECHANICS, Rig, Surroundings

REACHES = {"±100": Reach(-100.0, 100.0), "0..150": Reach(0.0, 150.0), "0..10": Reach(0.0, 10.0),
           "-20..120": Reach(-20.0, 120.0)}  # fmt: skip
USUAL_GAIN, ODD_GAIN = (0.05, 0.5), (1.5e-3, 20.0)  # µm/V
USUAL_AMPLITUDE = (0.2, 10.0)  # µm
FREQUENCY = (0.5, 50.0)  # Hz
WIDTH = (0.08, 0.25)
SAMPLES, MOST = 12_000, 60_000  # of a run, about and at most
LONG, LONGEST = 0.06, 200_000  # how often a run may be longer, and how long
BLOCKS = 4  # of a run, at least
BY_SAMPLE, ONE_BY_ONE = 25_000, 0.15  # samples of a run that may be handed over one by one; how often


class _Draw:
    """Random numbers by name, of which some are given instead."""

    def __init__(self, seed: int, given: dict[str, Any]) -> None:
        self.rng = np.random.default_rng([seed, 20])
        self._given = given
        self._asked: set[str] = set()

    def __call__(self, name: str, drawn: Any) -> Any:
        self._asked.add(name)
        return self._given.get(name, drawn)

    def check(self) -> None:
        """Refuse a name that nothing is drawn for."""
        if unknown := sorted(self._given.keys() - self._asked):
            raise ValueError(f"{', '.join(unknown)}: choose one of {', '.join(sorted(self._asked))}")

    def log(self, low: float, high: float) -> float:
        """Log-uniform."""
        return log_uniform(self.rng, low, high)

    def one(self, **chances: float) -> str:
        """A name, by its chance."""
        names, weights = list(chances), np.array(list(chances.values()))
        return str(names[int(self.rng.choice(len(names), p=weights / weights.sum()))])

    def maybe(self, chance: float, value: float) -> float:
        """The value, or zero."""
        return value if self.rng.random() < chance else 0.0


def draw(seed: int, **given: Any) -> Rig:
    """Draw a rig and what it is to do: a function of the seed, and of what is given instead of being drawn.

    `**given`: by its column: family, limits ("±100", "0..150", "0..10", "-20..120"), gain, width,
    sample_rate, reference, amplitude, frequency, waves, mechanics, delay, noise, resolution, volts, slew,
    creep, hum, drift, fault, mode, block. `slew` is relative to the fastest change that the reference needs.
    """
    pick = _Draw(integer("seed", seed), given)
    rng = pick.rng
    reach = REACHES[pick("limits", pick.one(**{"±100": 5, "0..150": 3, "0..10": 1, "-20..120": 2}))]
    # The stroke stays what it is where the range is short.
    gain = pick.log(*(USUAL_GAIN if rng.random() < 0.75 else ODD_GAIN)) * (15.0 if reach.high < 20.0 else 1.0)
    gain = pick("gain", gain)
    width = pick("width", float(rng.uniform(*WIDTH)))
    family = pick("family", str(rng.choice(list(FAMILIES))))
    model = draw_family(family, np.random.default_rng([seed, 21]), reach, width=width, gain=gain)
    sample_rate = float(pick("sample_rate", float(rng.choice([1e3, 1e4, 5e4], p=[0.3, 0.5, 0.2]))))
    plain = _reference(pick, seed, reach, model, gain, sample_rate)
    around = _surroundings(pick, reach, 2.0 * reach.half * gain, gain, plain, sample_rate)
    rig = Rig(
        seed=seed, family=family, model=model, reach=reach, sample_rate=sample_rate, gain=gain, width=width,
        around=around, plain=plain,
    )  # fmt: skip
    kind = pick("fault", NONE if rng.random() < 0.5 else str(rng.choice(list(FAULTS))))
    fault = draw_fault(kind, pick("mode", None), np.random.default_rng([seed, 22]), rig)
    block = 1 if rng.random() < ONE_BY_ONE else round(pick.log(1.0, 500.0))
    block = block if plain.values.size <= BY_SAMPLE else max(block, 10)
    # Of a run that is one block nothing can be learnt.
    block = min(block, plain.values.size // BLOCKS)
    block = integer("block", pick("block", block), 1)
    pick.check()
    return replace(rig, fault=fault, block=block)


def _reference(
    pick: _Draw, seed: int, reach: Reach, model: Any, gain: float, sample_rate: float
) -> Reference:
    rng = pick.rng
    kind = pick("reference", str(rng.choice(list(SHAPES))))
    at_ends = model.simulate(np.array([0.0, reach.high, reach.low]))
    centre = 0.0 if reach.low == -reach.high else 0.5 * float(at_ends[1] + at_ends[2])
    half = float(min(at_ends[1] - centre, centre - at_ends[2]))
    usual = (
        pick.log(*USUAL_AMPLITUDE) if USUAL_GAIN[0] <= gain <= USUAL_GAIN[1] else half * pick.log(0.05, 0.9)
    )
    amplitude = min(max(usual, 0.03 * half), 0.85 * half)
    if kind == "beyond":
        amplitude = half * rng.uniform(1.1, 1.6)
    amplitude = float(pick("amplitude", amplitude))
    waves_in_cycle = cycle_of(kind)
    least = 12.0 if waves_in_cycle == 1.0 else 7.0
    longest = LONGEST if rng.random() < LONG else MOST
    slowest = max(FREQUENCY[0], 7.0 * waves_in_cycle * sample_rate / longest)
    frequency = float(pick("frequency", pick.log(slowest, FREQUENCY[1])))
    cycles = np.clip(SAMPLES * frequency / sample_rate / waves_in_cycle, least, 40.0)
    most = longest * frequency / sample_rate / waves_in_cycle
    waves = float(pick("waves", round(min(cycles, most)) * waves_in_cycle))
    return build(
        kind, amplitude=amplitude, centre=centre, frequency=frequency, sample_rate=sample_rate, waves=waves,
        rng=np.random.default_rng([seed, 23]),
    )  # fmt: skip


def _surroundings(
    pick: _Draw, reach: Reach, stroke: float, gain: float, plain: Reference, sample_rate: float
) -> Surroundings:
    rng = pick.rng
    mechanics = pick("mechanics", str(rng.choice([*MECHANICS, "lag"], p=[0.4, 0.13, 0.13, 0.17, 0.17])))
    lag = pick.log(5.0, 50.0) * plain.frequency
    fastest = float(np.max(np.abs(np.diff(plain.values)))) * sample_rate / gain
    slew = pick("slew", pick.log(2.0, 30.0) if rng.random() < 0.3 else np.inf)
    duration = plain.values.size / sample_rate
    swing = 2.0 * plain.amplitude
    # Of a stroke of 30 µm: 0.1 nm to 20 nm.
    noise = stroke * pick.log(3e-6, 7e-4)
    hum = pick.maybe(0.1, min(0.2, 0.05 * swing))
    drift = pick.maybe(0.2, swing * rng.uniform(-0.1, 0.1) / duration)
    return Surroundings(
        mechanics=mechanics,
        lag=lag if mechanics == "lag" else 0.0,
        delay=int(pick("delay", int(rng.choice([0, 0, 0, 0, 0, 1, 1, 2, 3, 5, 10])))),
        noise=float(pick("noise", noise)),
        resolution=float(pick("resolution", pick.maybe(0.7, stroke * 2.0 ** -int(rng.integers(12, 19))))),
        volts=float(pick("volts", pick.maybe(0.7, 2.0 * reach.half * 2.0 ** -int(rng.integers(12, 19))))),
        slew_rate=slew * fastest,
        creep=float(pick("creep", pick.maybe(0.5, rng.uniform(0.003, 0.02)))),
        hum=float(pick("hum", hum)),
        drift=float(pick("drift", drift)),
    )
