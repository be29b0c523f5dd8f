"""The paper's experiment, run again on `PaperStage`: what `piezoest bench paper` shows.

The procedure is the paper's. Reference, compensator, stage and estimator form the ring at 50 kHz, with noise
and converters; the parameters are estimated while the ring runs until it is stationary, and the error is max
|r - x| of the true displacement over the stationary part. Nothing is fitted to a record afterwards.

What the paper does not say is chosen here: the memory of the estimator, the start, and how
often the compensator takes over new parameters.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from piezoest import signals
from piezoest.bench.executors import in_processes
from piezoest.bench.metrics import settles
from piezoest.bench.paper_tables import PRBS_ROW, Published, crossed_row, published, triangle_row
from piezoest.compensators import InverseCompensator, LinearCompensator
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import ColemanHodgdon, LinearGain
from piezoest.stage import PaperStage, SimulatedStage
from piezoest.tracking import TrackingRecord, track

SAMPLE_RATE = 50_000.0  # Hz, the paper's
UPDATE_INTERVAL = 50  # samples between two models of the compensator: 1 ms
HAND_OVER: Literal["place"] = "place"  # that of the calibration too; the paper does not name its own
MEMORY = 1.0  # s, that of the calibration: the compensated error hangs on it
START = ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)  # no row of Table I
START_GAIN = LinearGain(0.12)
STATIONARY_PERIODS = 2
# Long enough for the start to be forgotten, and for what is slow in the stage.
SECONDS = 5.0
MEMORIES_TO_SETTLE = 6.0
SETTLED = 1.1  # times the stationary error: below it a period counts as settled


@dataclass(frozen=True, slots=True)
class Reference:
    """A reference signal of the paper."""

    shape: Literal["triangle", "prbs"]  # smoothed triangle, or filtered pseudo-random binary signal
    amplitude: float  # nominal [µm]
    frequency: float = 0.0  # of the triangle [Hz]

    @property
    def name(self) -> str:
        """Name of the row in Tables I and II."""
        return PRBS_ROW if self.shape == "prbs" else triangle_row(self.amplitude, self.frequency)

    def signal(self, seconds: float) -> signals.Signal:
        """Whole periods that take at least `seconds`, from rest at zero. `seconds`: [s]."""
        if self.shape == "prbs":
            period = signals.prbs(self.amplitude, sample_rate=SAMPLE_RATE, start="zero")
            return period.repeat(math.ceil(seconds / period.duration - 1e-9))
        periods = math.ceil(seconds * self.frequency - 1e-9)
        return signals.triangle(self.amplitude, self.frequency, periods, SAMPLE_RATE)


PRBS = Reference("prbs", 5.0)
TRIANGLES = tuple(Reference("triangle", *row) for row in ((2.5, 5.0), (5.0, 2.5), (5.0, 5.0), (7.5, 5.0)))
REFERENCES = (*TRIANGLES, PRBS)
CROSSED = ((TRIANGLES[0], TRIANGLES[3]), (TRIANGLES[3], TRIANGLES[0]))  # applied, found for
SWEPT = TRIANGLES[2]  # the row of Figs. 3 and 4
MEMORIES = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)  # s; its period is 0.2 s


@dataclass(frozen=True, slots=True)
class Experiment:
    """One way round the ring."""

    reference: Reference  # what the stage has to follow
    # For linear feed-forward (11), or for the inverse of the hysteresis (14)-(17): to start from, or to stay
    # with.
    model: LinearGain | ColemanHodgdon
    memory: float | None  # time constant of the estimator's forgetting [s]; None: no estimator
    seed: int  # start of the random numbers of the stage's noise

    @property
    def compensation(self) -> str:
        """What the model is used for."""
        return "linear" if isinstance(self.model, LinearGain) else "inverse"

    @property
    def seconds(self) -> float:
        """Least length of the run [s]."""
        return max(SECONDS, MEMORIES_TO_SETTLE * (self.memory or 0.0))

    def follow(self, stage: SimulatedStage, seconds: float) -> TrackingRecord:
        """Record of a stage that follows the reference for at least so long [s]."""
        model, estimator = self.model, None
        if self.memory is not None:
            estimator = HysteresisRLS(SAMPLE_RATE, initial_model=model, memory=self.memory)
        return track(
            self.reference.signal(seconds),
            stage=stage,
            compensator=LinearCompensator(model)
            if isinstance(model, LinearGain)
            else InverseCompensator(model, hand_over=HAND_OVER),
            estimator=estimator,
            update_interval=UPDATE_INTERVAL,
        )

    def run(self) -> Run:
        """Run it."""
        record = self.follow(PaperStage(SAMPLE_RATE, seed=self.seed), self.seconds)
        last = record.theta[-(record.period or 1) :]
        return Run(
            experiment=self,
            parameters=tuple((last.mean(axis=0) if last.size else self.model.theta).tolist()),
            errors=tuple(record.max_error_per_period().tolist()),
            stationary=last_periods(record, STATIONARY_PERIODS),
        )


@dataclass(frozen=True, slots=True)
class Run:
    """What an experiment gave."""

    experiment: Experiment  # what was run
    parameters: tuple[float, ...]  # mean over the last period of the parameters in use
    errors: tuple[float, ...]  # largest |r - x| of each period [µm]
    stationary: TrackingRecord = field(repr=False)  # the last periods

    @property
    def max_error(self) -> float:
        """Largest |r - x| of the stationary part [µm]."""
        return self.stationary.max_error()

    @property
    def relative_error(self) -> float:
        """`max_error` in per cent of max |r|."""
        return 100.0 * self.max_error / float(np.max(np.abs(self.stationary.reference)))

    @property
    def period(self) -> float:
        """Of the reference [s]."""
        return (self.stationary.period or 1) / self.stationary.sample_rate

    @property
    def settling_periods(self) -> int | None:
        """Periods until all errors stay below 1.1 times `max_error`; None if not in the run's first half.

        None also if the error became larger than it was in the first period: that run has failed.
        """
        if self.max_error > SETTLED * self.errors[0]:
            return None
        settled = settles(np.asarray(self.errors), SETTLED * self.max_error)
        return settled if settled is not None and settled <= len(self.errors) // 2 else None

    @property
    def settling_time(self) -> float | None:
        """`settling_periods` in seconds."""
        periods = self.settling_periods
        return None if periods is None else periods * self.period

    def to_dict(self) -> dict[str, Any]:
        """How the run became stationary, and what it ended with, JSON-safe."""
        return {
            "row": self.experiment.reference.name,
            "compensation": self.experiment.compensation,
            "memory_s": self.experiment.memory,
            "period_s": self.period,
            "parameters": list(self.parameters),
            "stationary_max_error_um": self.max_error,
            "settling_periods": self.settling_periods,
            "settling_s": self.settling_time,
            "max_error_um": list(self.errors),
        }


def last_periods(record: TrackingRecord, periods: int) -> TrackingRecord:
    """The end of a record, its time from zero."""
    n = periods * (record.period or 1)
    names = ("reference", "voltage", "measured", "displacement")
    last = {name: getattr(record, name)[-n:].copy() for name in names}
    return dataclasses.replace(record, **last, parameters=record.theta[-n:].copy(), update_interval=1)


def quantities(inverse: Run, linear: Run | None = None) -> dict[str, float]:
    """Numbers of a row of the tables, by the names that they have there."""
    found = {
        **dict(zip(("alpha", "beta", "gamma"), inverse.parameters, strict=True)),
        "compensated_max_error": inverse.max_error,
        "compensated_relative_error": inverse.relative_error,
    }
    if linear is None:
        return found
    return found | {
        "K": linear.parameters[0],
        "linear_max_error": linear.max_error,
        "linear_relative_error": linear.relative_error,
        "error_reduction": 100.0 * (1.0 - inverse.max_error / linear.max_error),
    }


@dataclass(frozen=True, slots=True)
class PaperResult:
    """The paper's experiment, run again."""

    seed: int  # start of the random numbers of the stage's noise
    # Both compensations by the row's name, parameters estimated while running.
    linear: dict[str, Run] = field(repr=False)
    inverse: dict[str, Run] = field(repr=False)
    crossed: dict[str, Run] = field(repr=False)  # rows of Table III
    sweep: dict[float, Run] = field(repr=False)  # inverse compensation of one reference by memory [s]

    def _beside(self, number: Published) -> dict[str, Any]:
        """A number of the paper beside ours, and whether the deviation is within its bound, if it has one."""
        runs = (self.crossed,) if number.table == "III" else (self.inverse, self.linear)
        ours, bound = quantities(*(each[number.row] for each in runs))[number.quantity], number.bound
        deviation = number.deviation(ours)
        return {
            **dataclasses.asdict(number),
            "ours": ours,
            "ratio": ours / number.value,
            "deviation": deviation,
            "bound": bound,
            "within": None if bound is None else bool(abs(deviation) <= bound),
        }

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe dictionary: the tables, the transients, the sweep, and what was chosen."""
        return {
            "conditions": {
                "stage": "PaperStage",
                "seed": self.seed,
                "memory_s": MEMORY,
                "sample_rate_hz": SAMPLE_RATE,
                "update_interval_samples": UPDATE_INTERVAL,
                "stationary_periods": STATIONARY_PERIODS,
                "settled_below": SETTLED,
                "start": START.to_dict(),
                "linear_start": START_GAIN.to_dict(),
            },
            "tables": [self._beside(number) for number in published()],
            "adaptation": [run.to_dict() for rows in (self.linear, self.inverse) for run in rows.values()],
            "memory": [run.to_dict() for run in self.sweep.values()],
        }


def run_paper(
    memories: Iterable[float], *, seed: int, workers: int | None, progress: Callable[[int, int], None]
) -> PaperResult:
    """Run the paper's experiment on the simulated stage, and one row with further memories."""
    inverse = {r: Experiment(r, START, MEMORY, seed) for r in REFERENCES}
    linear = {r: Experiment(r, START_GAIN, MEMORY, seed) for r in REFERENCES}
    swept = {value: Experiment(SWEPT, START, value, seed) for value in memories}
    # The longest first, so that no process waits for the last one.
    first = sorted([*inverse.values(), *linear.values(), *swept.values()], key=lambda e: -e.seconds)
    runs: dict[Experiment, Run] = {}

    def make(experiments: Sequence[Experiment]) -> None:
        for run in in_processes(Experiment.run, experiments, workers):
            runs[run.experiment] = run
            progress(len(runs), len(first) + len(CROSSED))

    make(first)
    crossed = {}
    for applied, found_for in CROSSED:
        # A mean of admissible parameters is admissible unless they wander.
        model = ColemanHodgdon(*runs[inverse[found_for]].parameters).nearest_admissible()
        row = crossed_row(applied.amplitude, applied.frequency, found_for.amplitude)
        crossed[row] = Experiment(applied, model, None, seed)
    make(list(crossed.values()))
    by_memory = {value: runs[experiment] for value, experiment in swept.items()}
    if by_memory:
        by_memory[MEMORY] = runs[inverse[SWEPT]]
    return PaperResult(
        seed=seed,
        linear={r.name: runs[experiment] for r, experiment in linear.items()},
        inverse={r.name: runs[experiment] for r, experiment in inverse.items()},
        crossed={row: runs[experiment] for row, experiment in crossed.items()},
        sweep=dict(sorted(by_memory.items())),
    )
