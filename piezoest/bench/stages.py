"""Stages of the bench by name: the paper's, and others whose hysteresis the seed draws from a family."""

from typing import Any

import numpy as np

from piezoest.bench.zoo.families import FAMILIES, Reach, draw_family
from piezoest.models import Creep
from piezoest.stage import Amplifier, Gauge, PaperStage, SimulatedStage

PAPER = "paper"
# No estimator was made for these smooth loops. Backlash is an extreme; the others are the models' relatives.
STRANGERS = ("bouc-wen", "duhem", "relays")
STAGES = (PAPER, *(name for name in FAMILIES if name != PAPER))
REACH = Reach(-100.0, 100.0)  # V
WIDTH = (0.10, 0.18)  # of the loop over the reach, relative to its stroke
GAIN = 0.155  # µm/V, mean slope over the reach
CREEP = 0.02  # share of the displacement for each decade of time


def make_stage(
    name: str,
    sample_rate: float,
    *,
    seed: int,
    noise: float | None = None,
    gain_schedule: Any = None,
    creep: bool = True,
) -> SimulatedStage:
    """Make a stage at rest; the same arguments give the same stage, its noise included."""
    if name not in STAGES:
        raise ValueError(f"stage must be one of {', '.join(STAGES)}, got {name!r}")
    paper = PaperStage(sample_rate, seed, noise=noise, gain_schedule=gain_schedule, creep=creep)
    if name == PAPER:
        return paper
    rng = np.random.default_rng([seed, *name.encode()])
    gauge: Gauge = paper.gauge
    return SimulatedStage(
        sample_rate,
        draw_family(name, rng, REACH, width=float(rng.uniform(*WIDTH)), gain=GAIN),
        creep=Creep.logarithmic(CREEP, shortest=0.01, longest=10.0) if creep else None,
        amplifier=Amplifier(REACH.low, REACH.high),
        gauge=Gauge(noise=gauge.noise, resolution=gauge.resolution),
        gain_schedule=gain_schedule,
        seed=seed,
    )
