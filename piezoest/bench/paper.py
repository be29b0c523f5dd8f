"""The paper's tables beside those of `PaperStage`: what `piezoest bench paper` shows."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from piezoest._checks import integer, positive
from piezoest.bench.executors import in_processes
from piezoest.bench.paper_experiment import (
    MEMORY,
    PRBS,
    SAMPLE_RATE,
    SETTLED,
    START,
    START_GAIN,
    STATIONARY_PERIODS,
    TRIANGLES,
    UPDATE_INTERVAL,
    Experiment,
    Run,
)
from piezoest.bench.paper_tables import Published, crossed_row, published
from piezoest.models import ColemanHodgdon

REFERENCES = (*TRIANGLES, PRBS)
CROSSED = ((TRIANGLES[0], TRIANGLES[3]), (TRIANGLES[3], TRIANGLES[0]))  # applied, found for
SWEPT = TRIANGLES[2]  # the row of Figs. 3 and 4
MEMORIES = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)  # s; its period is 0.2 s


@dataclass(frozen=True, slots=True)
class PaperResult:
    """The paper's experiment, run again."""

    memory: float  # of the estimator [s]
    seed: int  # start of the random numbers of the stage's noise
    # Both compensations by the row's name, parameters estimated while running.
    linear: dict[str, Run] = field(repr=False)
    inverse: dict[str, Run] = field(repr=False)
    crossed: dict[str, Run] = field(repr=False)  # rows of Table III
    sweep: dict[float, Run] = field(repr=False)  # inverse compensation of one reference by memory [s]

    def _beside(self, number: Published) -> dict[str, Any]:
        """A number of the paper beside ours, and whether the deviation is within its bound, if it has one."""
        ours, bound = self._ours(number), number.bound
        deviation = number.deviation(ours)
        return {
            **dataclasses.asdict(number),
            "ours": ours,
            "ratio": ours / number.value,
            "deviation": deviation,
            "bound": bound,
            "within": None if bound is None else bool(abs(deviation) <= bound),
        }

    def _ours(self, number: Published) -> float:
        if number.table == "III":
            return _error(self.crossed[number.row], number.quantity)
        linear, inverse = self.linear[number.row], self.inverse[number.row]
        if number.quantity == "K":
            return linear.parameters[0]
        if number.quantity in ("alpha", "beta", "gamma"):
            return inverse.parameters[("alpha", "beta", "gamma").index(number.quantity)]
        if number.quantity == "error_reduction":
            return 100.0 * (1.0 - inverse.max_error / linear.max_error)
        return _error(linear if number.quantity.startswith("linear") else inverse, number.quantity)

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe dictionary: the tables, the transients, the sweep, and what was chosen."""
        return {
            "conditions": {
                "stage": "PaperStage",
                "seed": self.seed,
                "memory_s": self.memory,
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
    *,
    memory: float = MEMORY,
    memories: Iterable[float] = MEMORIES,
    seed: int = 0,
    workers: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> PaperResult:
    """Run the paper's experiment on the simulated stage, and one row with further memories.

    A script that calls this with other `workers` than 1 needs ``if __name__ == "__main__":``.
    """
    memory, seed = positive("memory", memory), integer("seed", seed)
    sweep = sorted({positive("memories", value) for value in memories} - {memory})

    inverse = {r: Experiment(r, START, memory, seed) for r in REFERENCES}
    linear = {r: Experiment(r, START_GAIN, memory, seed) for r in REFERENCES}
    swept = {value: Experiment(SWEPT, START, value, seed) for value in sweep}
    # The longest first, so that no process waits for the last one.
    first = sorted([*inverse.values(), *linear.values(), *swept.values()], key=lambda e: -e.seconds)
    runs: dict[Experiment, Run] = {}

    def make(experiments: Sequence[Experiment]) -> None:
        for run in in_processes(Experiment.run, experiments, workers):
            runs[run.experiment] = run
            if progress is not None:
                progress(f"{len(runs)} of {len(first) + len(CROSSED)}: {run.experiment.name}")

    make(first)
    crossed = {
        crossed_row(applied.amplitude, applied.frequency, found_for.amplitude): Experiment(
            applied, _model(runs[inverse[found_for]]), None, seed
        )
        for applied, found_for in CROSSED
    }
    make(list(crossed.values()))
    by_memory = {value: runs[experiment] for value, experiment in swept.items()}
    if by_memory:
        by_memory[memory] = runs[inverse[SWEPT]]
    return PaperResult(
        memory=memory,
        seed=seed,
        linear={r.name: runs[experiment] for r, experiment in linear.items()},
        inverse={r.name: runs[experiment] for r, experiment in inverse.items()},
        crossed={row: runs[experiment] for row, experiment in crossed.items()},
        sweep=dict(sorted(by_memory.items())),
    )


def _model(run: Run) -> ColemanHodgdon:
    # A mean of admissible parameters is admissible unless they wander.
    return ColemanHodgdon(*run.parameters).nearest_admissible()


def _error(run: Run, quantity: str) -> float:
    return run.relative_error if quantity.endswith("relative_error") else run.max_error
