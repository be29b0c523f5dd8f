"""Cases of the bench: a reference, a stage and a start, from a seed and the conditions of a campaign.

The same scenario, seed and conditions give the same case, to the bit.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest import signals
from piezoest._checks import instance
from piezoest.bench.zoo.families import FAMILIES, Reach, draw_family
from piezoest.models import ColemanHodgdon, Creep, LinearGain
from piezoest.signals import Signal
from piezoest.stage import Amplifier, Gauge, PaperStage, SimulatedStage

PAPER = "paper"
# No estimator was made for these loops; the controller's Duhem model describes the second. Backlash is an
# extreme; the others are the models' relatives.
STRANGERS = ("bouc-wen", "duhem", "relays")
STAGES = (PAPER, *(name for name in FAMILIES if name != PAPER))
REACH = Reach(-100.0, 100.0)  # V
WIDTH = (0.10, 0.18)  # of the loop over the reach, relative to its stroke
GAIN = 0.155  # µm/V, mean slope over the reach
CREEP = 0.02  # share of the displacement for each decade of time
# Table I, triangle of 5 µm at 5 Hz: what a start would be that is right.
RIGHT_MODEL = ColemanHodgdon(alpha=2.10e-2, beta=1.47e-1, gamma=4.29e-3)
RIGHT_GAIN = LinearGain(GAIN)
COLD, WARM = 0.5, 0.1  # a start parameter is off by up to this fraction of its value
AMPLITUDE = 5.0  # µm, of the scenarios with one amplitude


def make_stage(
    name: str, sample_rate: float, *, seed: int, noise: float | None = None, gain_schedule: Any = None
) -> SimulatedStage:
    """Make a stage at rest; the same arguments give the same stage, its noise included."""
    if name not in STAGES:
        raise ValueError(f"stage must be one of {', '.join(STAGES)}, got {name!r}")
    paper = PaperStage(sample_rate, seed, noise=noise, gain_schedule=gain_schedule)
    if name == PAPER:
        return paper
    rng = np.random.default_rng([seed, *name.encode()])
    gauge: Gauge = paper.gauge
    return SimulatedStage(
        sample_rate,
        draw_family(name, rng, REACH, width=float(rng.uniform(*WIDTH)), gain=GAIN),
        creep=Creep.logarithmic(CREEP, shortest=0.01, longest=10.0),
        amplifier=Amplifier(REACH.low, REACH.high),
        gauge=Gauge(noise=gauge.noise, resolution=gauge.resolution),
        gain_schedule=gain_schedule,
        seed=seed,
    )


@dataclass(frozen=True, slots=True)
class Conditions:
    """What a scenario leaves open."""

    # [Hz]. The default is a tenth of the paper's, for filterpy's filters take half a millisecond a sample;
    # what settles where hardly depends on it. At 20 kHz and below the stage leaves its filters out, whose
    # delay costs an estimator accuracy.
    sample_rate: float = 5000.0
    # Largest nominal amplitude of the reference [µm]; default 5, and 7.5 where there are two.
    amplitude: float | None = None
    frequency: float = 5.0  # of the reference [Hz]; signals that are no wave are stretched in time with it
    noise: float | None = None  # standard deviation of the gauge's noise [µm]; default the stage's own
    before: int = 4  # periods before the change, where there is one
    after: int = 10  # periods after it
    rest: float = 5.0  # length of the dwell [s]
    drift: float = 5.0  # length of the drift [s]
    # Updates of the compensator's model in a period of the wave; the default is one in eight milliseconds at
    # 5 Hz.
    updates: int = 25
    stage: str = PAPER  # name in `STAGES`

    @property
    def period(self) -> float:
        """Of the wave, in samples."""
        return self.sample_rate / self.frequency


@dataclass(frozen=True, slots=True)
class Case:
    """One run: everything but the estimator."""

    scenario: str  # name of the scenario
    seed: int  # start of the random numbers, the stage's noise among them
    reference: Signal  # what the stage has to follow [µm]
    period: float  # samples over which an error is taken
    change: int  # sample at which something changes; 0 if it is the start itself
    amplitude: float  # nominal amplitude after the change [µm]
    start: ColemanHodgdon  # model to start from
    linear_start: LinearGain  # the same for linear feed-forward
    update_interval: int  # samples between two updates of the compensator's model
    conditions: Conditions = Conditions()
    # Time [s] and factor of the stage's hysteresis, see `PaperStage`.
    gain_schedule: tuple[tuple[float, float], ...] | None = None

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        return self.reference.sample_rate

    def new_stage(self) -> SimulatedStage:
        """Stage at rest; every one of the same case is identical, its noise included."""
        given, schedule = self.conditions, self.gain_schedule
        return make_stage(
            given.stage, self.sample_rate, seed=self.seed, noise=given.noise, gain_schedule=schedule
        )


@dataclass(frozen=True, slots=True)
class Draft:
    """What a scenario makes its case of."""

    scenario: str  # name of the scenario
    seed: int  # start of the random numbers
    rng: np.random.Generator  # random numbers of this scenario and seed
    conditions: Conditions  # what the scenario leaves open

    @property
    def amplitude(self) -> float:
        """Of a scenario with one amplitude [µm]."""
        return self.conditions.amplitude or AMPLITUDE

    def triangle(self, periods: float) -> Signal:
        """Smoothed triangle of `amplitude`."""
        given = self.conditions
        return signals.triangle(self.amplitude, given.frequency, periods, given.sample_rate)

    def case(
        self, reference: Signal, *, spread: float = WARM, period: float | None = None, **rest: Any
    ) -> Case:
        """Make the case from a drawn start, off by up to `spread`; `rest` are other fields of `Case`."""
        instance("reference", reference, Signal, "a Signal: make one of values, sample rate and period")
        given, rng = self.conditions, self.rng
        options = {"change": 0, "amplitude": self.amplitude, "conditions": given, **rest}
        start = None
        while start is None or not start.is_admissible:
            start = ColemanHodgdon.from_theta(RIGHT_MODEL.theta * (1.0 + rng.uniform(-spread, spread, 3)))
        return Case(
            scenario=self.scenario,
            seed=self.seed,
            reference=reference,
            period=given.period if period is None else period,
            start=start,
            linear_start=LinearGain(RIGHT_GAIN.gain * (1.0 + float(rng.uniform(-spread, spread)))),
            update_interval=max(1, round(given.period / given.updates)),
            **options,
        )
