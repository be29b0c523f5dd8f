"""The runs behind `beyond_the_paper.py`: each a job of one seed that gives numbers by name.

An error's number ends in ``_um``, one over linear feed-forward's in ``_left``; of all numbers less is better.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import piezoest as pz
from piezoest.bench import runner
from piezoest.bench.estimators import REFERENCE
from piezoest.bench.faults import FAULTS
from piezoest.bench.scenarios import SCENARIOS
from piezoest.equations.bent_plays import segment

Numbers = dict[str, float]

RATE = 50_000.0  # Hz
SLOW = 20_000.0  # Hz, of the change of amplitude
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
STAGES: dict[str, Callable[..., Any]] = {"PaperStage": pz.PaperStage, "PreisachStage": pz.PreisachStage}
PAPERS, OURS = "HysteresisRLS", "PrandtlIshlinskiiRLS"
LIMITS = pz.VoltageLimits(-100.0, 100.0)


@dataclass(frozen=True, slots=True)
class Job:
    """One case of one section on one stage, with one seed."""

    section: str
    case: str
    stage: str
    seed: int

    def new_stage(self, rate: float, **parts: Any) -> Any:
        return STAGES[self.stage](rate, seed=self.seed, **parts)


def jobs(section: str, seeds: int) -> list[Job]:
    """All of a section, with at most so many seeds."""
    return [
        Job(section, case, stage, seed)
        for seed in range(min(seeds, ENOUGH.get(section, seeds)))
        for case in CASES[section]
        for stage in STAGES
    ]


def play(job: Job) -> tuple[Job, Numbers]:
    """Run a job."""
    return job, RUNS[job.section](job)


def follow(reference: pz.Signal, stage: Any, estimator: Any) -> pz.TrackingRecord:
    """Send a reference round the ring; without an estimator, linear feed-forward with its gain estimated."""
    rate = reference.sample_rate
    transfer = max(1, round(0.01 * rate))
    compensator: Any = pz.InverseCompensator(START, LIMITS, transfer_samples=transfer)
    if estimator is None:
        line = pz.LinearGain(0.15)
        memory = 2.0 * (reference.period or rate / 5.0) / rate
        estimator = pz.HysteresisRLS(rate, initial_model=line, memory=memory)
        compensator = pz.LinearCompensator(line, LIMITS, transfer_samples=transfer)
    return pz.track(
        reference,
        stage=stage,
        compensator=compensator,
        estimator=estimator,
        update_interval=max(1, round(1e-3 * rate)),
    )


def learner(name: str, rate: float, **options: Any) -> Any:
    return getattr(pz, name)(rate, initial_model=START, **options)


# ---------------------------------------------------------------- settled errors

TRIANGLES = {
    f"triangle {a:g} µm {f:g} Hz": (a, f) for a, f in ((2.5, 5.0), (5.0, 2.5), (5.0, 5.0), (7.5, 5.0))
}
PRBS, SMALLEST = "PRBS", next(iter(TRIANGLES))


def reference_of(name: str) -> pz.Signal:
    """Of the paper's Table I."""
    if name == PRBS:
        return pz.signals.prbs(5.0, sample_rate=RATE, start="zero").repeat(8)
    amplitude, frequency = TRIANGLES[name]
    return pz.signals.triangle(amplitude, frequency, round(5.0 * frequency), RATE)


def settled(job: Job) -> Numbers:
    """Largest error of the last two periods."""
    reference = reference_of(job.case)
    found = {
        name: follow(
            reference, job.new_stage(RATE), learner(name, RATE) if name in (PAPERS, OURS) else None
        ).max_error(last_periods=2)
        for name in ("linear", PAPERS, OURS)
    }
    numbers = {f"{name}_um": value for name, value in found.items()}
    return numbers | {f"{name}_left": found[name] / found["linear"] for name in (PAPERS, OURS)}


# ---------------------------------------------------------------- a change of amplitude

AMPLITUDES, PERIODS = (2.5, 7.5, 2.5, 7.5), 10  # µm; of each
KNOWN, FROZEN = f"{OURS}, range known", f"{OURS}, frozen before the second"


class FrozenLater:
    """An estimator that stops learning after so many samples."""

    def __init__(self, estimator: Any, samples: int) -> None:
        self._estimator, self._left = estimator, samples
        self.sample_rate = estimator.sample_rate

    def run(self, u: Any, x: Any) -> None:
        self._estimator.run(u, x)
        self._left -= len(u)
        self._estimator.frozen = self._left <= 0

    def step(self, u: float, x: float) -> None:
        self.run(np.array([u]), np.array([x]))

    @property
    def model(self) -> Any:
        return self._estimator.model


def amplitudes(job: Job) -> Numbers:
    """From 2.5 µm to 7.5 µm, back, and again: the first period after each step up, and the settled ones.

    Of the first period the rise to the new peak is told from the rest.
    """
    reference = pz.signals.multi_amplitude(AMPLITUDES, 5.0, [PERIODS] * len(AMPLITUDES), SLOW)
    period = round(SLOW / 5.0)
    options = {"voltage_range": (-55.0, 55.0)} if job.case == KNOWN else {}
    estimator = learner(job.case.partition(",")[0], SLOW, **options)
    if job.case == FROZEN:
        estimator = FrozenLater(estimator, 2 * PERIODS * period)
    error = np.abs(follow(reference, job.new_stage(SLOW), estimator).error)
    found = {}
    for time, change in (("first", PERIODS), ("second", 3 * PERIODS)):
        first = error[change * period : (change + 1) * period]
        last = error[(change + PERIODS - 2) * period : (change + PERIODS) * period]
        rise = round(period / 4)
        found[f"{time}_rise_um"] = float(first[:rise].max())
        found[f"{time}_rest_um"] = float(first[rise:].max())
        found[f"{time}_settled_um"] = float(last.max())
        found[f"{time}_over_settled"] = float(first.max() / last.max())
    return found


# ---------------------------------------------------------------- scenarios and faults

SCENARIO = runner.Settings(
    sample_rate=10_000.0, before=10, after=15, after_long=8, rest=60.0, drift=30.0, updates=50
)
SUITE_STAGES = {cls.__name__: name for name, cls in runner.STAGES.items()}
SOON = 2  # periods


def scenarios(job: Job) -> Numbers:
    """As `piezoest bench` plays them, at part 4's lengths: what each estimator makes of one."""
    settings = replace(SCENARIO, stage=SUITE_STAGES[job.stage])
    found = {}
    for name in (REFERENCE, PAPERS, OURS):
        row = runner.play(runner.Task(job.case, name, job.seed, settings, ""))
        if row["failure"] is not None:
            raise RuntimeError(f"{job}, {name}: {row['failure']}")
        periods = row["settling_periods"]
        found |= {
            f"{name}_worst_um": row["worst_error"],
            f"{name}_settled_um": row["settled_max"],
            f"{name}_periods": np.inf if periods is None else float(periods),
            f"{name}_late": float(periods is None or periods > SOON),
            f"{name}_diverged": float(row["diverged"]),
        }
        if job.case == "dwell":
            found[f"{name}_after_rest"] = row["errors"][0] / row["before_max"]
    return found


FAULT_RATE = 10_000.0  # Hz
# Those that leave the readings right, or end; the gauge's moved zero takes the stage along.
RECOVERABLE = ("missing-1", "missing-50", "gap", "wrong-rate", "spikes", "stuck", "offset-step")
MOVED = {"offset-step": 0.5}  # µm


def faults(job: Job) -> Numbers:
    """A triangle of 5 µm at 5 Hz for 3 s: the last 3 periods.

    ``broken`` is 0 where parameters stay finite and admissible and the voltage within its limits.
    """
    fault = FAULTS[job.case]
    estimator = learner(OURS, FAULT_RATE)
    record = pz.track(
        fault.reference(pz.signals.triangle(5.0, 5.0, 15, FAULT_RATE)),
        stage=fault.build(job.new_stage, FAULT_RATE, seed=job.seed),
        compensator=pz.InverseCompensator(START, LIMITS, transfer_samples=100, sample_rate=FAULT_RATE),
        estimator=estimator,
        update_interval=40,
    )
    sound = (
        np.all(np.isfinite(record.theta))
        and np.all(np.isfinite(estimator.P))
        and estimator.model.is_admissible
        and np.max(np.abs(record.voltage)) <= LIMITS.maximum
    )
    last = record.error[-round(3 * FAULT_RATE / 5.0) :] - MOVED.get(job.case, 0.0)
    return {"last_um": float(np.max(np.abs(last))), "broken": float(not sound)}


# ---------------------------------------------------------------- towards the resonance

# Of the simulated stages: resonance, delay of the amplifier's filter, and of the gauge's.
MECHANICS, AMPLIFIER_DELAY, GAUGE_DELAY = pz.MassSpringDamper(780.0, 0.02), 1.95e-5, 1.95e-5
FAST = {
    f"{shape} {frequency:.0f} Hz": (shape, frequency, periods)
    for frequency, periods in ((5.0, 8), (20.0, 25), (39.0625, 40))
    for shape in ("sine", "triangle")
}


def near_the_resonance(job: Job) -> Numbers:
    """Towards a twentieth of the resonance, with a lead and without; the sensor's delay is told to both."""
    shape, frequency, periods = FAST[job.case]
    reference = getattr(pz.signals, shape)(5.0, frequency, periods, RATE)
    found = {}
    for way in ("without", "lead"):
        compensator: Any = pz.InverseCompensator(START, LIMITS)
        options: dict[str, Any] = {"delay": GAUGE_DELAY * RATE}
        if way == "lead":
            compensator = pz.LeadFilter(compensator, MECHANICS, sample_rate=RATE, delay=AMPLIFIER_DELAY)
            options = {"delay": (AMPLIFIER_DELAY + GAUGE_DELAY) * RATE, "mechanics": MECHANICS}
        record = pz.track(
            reference,
            stage=job.new_stage(RATE),
            compensator=compensator,
            estimator=learner(OURS, RATE, **options),
        )
        found |= {f"{way}_max_um": record.max_error(2), f"{way}_rms_um": record.rms_error(2)}
    return found


# ---------------------------------------------------------------- the smallest triangle

AS_IT_IS, TOLD = "as it is", "sensor's delay told"
SMALL: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    AS_IT_IS: ({}, {}),
    TOLD: ({}, {"delay": GAUGE_DELAY * RATE}),
    "without converter steps": ({"quantisation": False}, {}),
    "without resonance": ({"mechanics": False}, {}),
    "without noise": ({"noise": 0.0}, {}),
}


def small_triangle(job: Job) -> Numbers:
    """What is left of the smallest triangle, and what of it has which cause."""
    parts, options = SMALL[job.case]
    reference = pz.signals.triangle(2.5, 5.0, 15, RATE)
    record = follow(reference, job.new_stage(RATE, **parts), learner(OURS, RATE, **options))
    return {"max_um": record.max_error(2), "rms_um": record.rms_error(2)}


# ---------------------------------------------------------------- dead zones

SUM, EACH = "on the sum of the plays", "on each play"
PLAIN = "none"


@functools.cache
def _loop(stage: str) -> tuple[Any, Any, Any]:
    """Voltage, plays of it and displacement over a settled loop, without noise, steps and resonance."""
    rate, amplitude, plays = 10_000.0, 35.0, 12
    u = pz.signals.triangle(amplitude, 5.0, 6, rate).values
    made = STAGES[stage](rate, noise=0.0, quantisation=False, mechanics=False)
    made.run(u)
    thresholds = amplitude * np.arange(1, plays) / plays
    operators = [pz.PrandtlIshlinskii(1e-12, [r], [1.0]).simulate(u) for r in thresholds]
    last = slice(-round(rate / 5.0), None)
    return amplitude, np.array([u, *operators])[:, last], made.displacement[last]


def dead_zones(job: Job) -> Numbers:
    """What a least-squares fit of a settled loop leaves, in parts of a straight line's largest residual.

    Two dead zones within the loop, at thirds of it. On the sum of the plays they are fitted as Kuhnen
    does, through the inverse of the superposition, whose dead zones act on the displacement.
    """
    amplitude, plays, x = _loop(job.stage)
    one = np.ones((1, x.size))
    inside = np.linspace(-1.0, 1.0, 4)[1:-1]
    if job.case == SUM:
        bends = x.mean() + 0.5 * np.ptp(x) * inside
        rows = np.vstack([plays, *(-np.maximum(x - bend, 0.0)[None] for bend in bends)])
    elif job.case == EACH:
        edges = [-np.inf, *(amplitude * inside), np.inf]
        rows = np.array([segment(p, low, high) for p in plays for low, high in itertools.pairwise(edges)])
    else:
        rows = plays

    def largest(regressors: Any) -> float:
        A = np.vstack([regressors, one]).T
        return float(np.max(np.abs(x - A @ np.linalg.lstsq(A, x, rcond=None)[0])))

    return {"left": largest(rows) / largest(plays[:1])}


RUNS: dict[str, Callable[[Job], Numbers]] = {
    "settled": settled,
    "amplitudes": amplitudes,
    "scenarios": scenarios,
    "faults": faults,
    "near_the_resonance": near_the_resonance,
    "small_triangle": small_triangle,
    "dead_zones": dead_zones,
}
CASES: dict[str, tuple[str, ...]] = {
    "settled": (*TRIANGLES, PRBS),
    "amplitudes": (PAPERS, OURS, KNOWN, FROZEN),
    "scenarios": tuple(SCENARIOS),
    "faults": tuple(FAULTS),
    "near_the_resonance": tuple(FAST),
    "small_triangle": tuple(SMALL),
    "dead_zones": (PLAIN, SUM, EACH),
}
# Seeds that are enough: one where nothing is left to chance, few where a run takes long.
ENOUGH = {"dead_zones": 1, "faults": 2, "scenarios": 3, "near_the_resonance": 3, "small_triangle": 3}
