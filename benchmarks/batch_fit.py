"""Time the CasADi estimators, and give each time as a ratio to one compiled simulation of the record.

Absolute times are the machine's; the ratios travel. The first fit in a process also builds the CasADi
functions and loads scipy.optimize: it is shown on a line of its own.

    python benchmarks/batch_fit.py [--repeats N] [--json FILE]

The memory of a fit is the largest that a process of its own ever held (Linux only): it grows in
proportion to the record.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import scipy
from numpy.typing import NDArray
from smoke import SAMPLE_RATE, TRUE, machine

import piezoest as pz
from piezoest._files import write_text
from piezoest.estimators.batch import BatchFit
from piezoest.estimators.horizon import MovingHorizon
from piezoest.models.coleman_hodgdon import _simulate

FloatArray = NDArray[np.float64]

LENGTHS = (20_001, 200_000)
NOISE = 1e-3
METHODS: tuple[Any, ...] = ("single-shooting", "multiple-shooting")
HORIZON_SECONDS = 4.0
# The first is what a process holds that fits hardly anything.
MEMORY_LENGTHS = (1_000, 200_000, 400_000)
STATUS = Path("/proc/self/status")


@dataclass(frozen=True)
class Row:
    """One case: time, its ratio to a simulation, and the outcome beside it."""

    name: str
    samples: int
    seconds: float
    median_seconds: float
    simulations: float
    worst_parameter_error: float
    solver: str


def record(samples: int) -> tuple[FloatArray, FloatArray]:
    """5 Hz triangle of 33 V through the true model, 1 nm noise."""
    u = pz.signals.triangle(33.0, 5.0, samples * 5.0 / SAMPLE_RATE, SAMPLE_RATE).values[:samples]
    return u, TRUE.simulate(u) + NOISE * np.random.default_rng(0).standard_normal(u.size)


def times_of(function: Callable[[], Any], repeats: int) -> tuple[FloatArray, Any]:
    """Times [s] of so many calls, and the last result."""
    times, result = [], None
    for _ in range(repeats):
        start = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - start)
    return np.array(times), result


def simulation_seconds(u: FloatArray) -> float:
    """Shortest time of one pass of the compiled simulation."""
    x = np.empty_like(u)

    def simulate() -> None:
        _simulate(u, 0.0, TRUE.a, TRUE.b, TRUE.c, 0.0, x)

    simulate()
    return float(times_of(simulate, 30)[0].min())


def worst(theta: FloatArray) -> float:
    """Largest relative error of the parameters."""
    return float(np.max(np.abs(theta[:3] / TRUE.theta - 1.0)))


def fits(repeats: int) -> list[Row]:
    """Whole records, by both methods."""
    rows = []
    for samples in LENGTHS:
        u, x = record(samples)
        simulation = simulation_seconds(u)
        rows.append(Row("one simulation", samples, simulation, simulation, 1.0, 0.0, ""))
        for method in METHODS:
            estimator = BatchFit(SAMPLE_RATE, method=method)
            if samples == LENGTHS[0]:
                (first,), fit = times_of(lambda: estimator.fit(u, x), 1)  # noqa: B023
                rows.append(_row(f"{method}, first", samples, np.array([first]), simulation, fit))
            times, fit = times_of(lambda: estimator.fit(u, x), repeats)  # noqa: B023
            rows.append(_row(method, samples, times, simulation, fit))
    return rows


def _row(name: str, samples: int, times: FloatArray, simulation: float, fit: Any) -> Row:
    shortest = float(times.min())
    return Row(
        name, samples, shortest, float(np.median(times)), shortest / simulation, worst(fit.theta),
        f"{fit.evaluations} passes, {fit.message}",
    )  # fmt: skip


def horizon() -> list[Row]:
    """Solves of a moving horizon of default settings, thinned and at full rate."""
    u, x = record(int(HORIZON_SECONDS * SAMPLE_RATE))
    rows = []
    for name, decimation in (("moving horizon", None), ("moving horizon, full rate", 1)):
        estimator = MovingHorizon(SAMPLE_RATE, decimation=decimation)
        times = []
        for start in range(0, u.size, 5000):
            estimator.run(u[start : start + 5000], x[start : start + 5000])
            times.append(estimator.last_solve_seconds)
        full = np.array(times[5:])
        rows.append(
            Row(
                name, 20_000, float(full.min()), float(np.median(full)),
                float(full.min()) / simulation_seconds(u[:20_000]), worst(estimator.theta),
                f"{estimator.solves} solves, {estimator.failures} failed",
            )
        )  # fmt: skip
    return rows


@dataclass(frozen=True)
class MemoryRow:
    """Largest memory of a process that makes one fit."""

    method: str
    samples: int
    megabytes: float
    bytes_per_sample: float | None


def largest_memory(method: Any, samples: int) -> float:
    """Largest memory [MB] of this process, after a fit."""
    BatchFit(SAMPLE_RATE, method=method).fit(*record(samples))
    (line,) = (line for line in STATUS.read_text(encoding="ascii").splitlines() if line.startswith("VmHWM"))
    return float(line.split()[1]) / 1024.0


def memories() -> list[MemoryRow]:
    """Each method and length in a process of its own; nothing where the system does not tell."""
    rows: list[MemoryRow] = []
    if not STATUS.exists():
        return rows
    for method in METHODS:
        least = 0.0
        for samples in MEMORY_LENGTHS:
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                found = pool.apply(largest_memory, (method, samples))
            first = samples == MEMORY_LENGTHS[0]
            least = found if first else least
            grown = None if first else 2**20 * (found - least) / (samples - MEMORY_LENGTHS[0])
            rows.append(MemoryRow(method, samples, found, grown))
    return rows


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description="Time the CasADi estimators against one compiled simulation of the record.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("--repeats", type=int, default=7, help="the best, and the median, of so many")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write table and machine to this file too")
    arguments = parser.parse_args()
    about = {**machine(), "casadi": casadi.__version__, "scipy": scipy.__version__}
    print(*(f"{key:>10}: {value}" for key, value in about.items()), sep="\n")
    rows = [*fits(arguments.repeats), *horizon()]
    print(
        f"\n{'':<26}{'samples':>8}{'best, ms':>11}{'median, ms':>12}{'simulations':>13}{'worst error':>13}"
        "  outcome"
    )
    for row in rows:
        print(
            f"{row.name:<26}{row.samples:8d}{1e3 * row.seconds:11.2f}{1e3 * row.median_seconds:12.2f}"
            f"{row.simulations:13.0f}{row.worst_parameter_error:13.1e}  {row.solver}"
        )
    memory = memories()
    if memory:
        print(f"\n{'memory of a process':<26}{'samples':>8}{'MB':>11}{'bytes a sample':>17}")
    for each in memory:
        grown = "" if each.bytes_per_sample is None else f"{each.bytes_per_sample:17.0f}"
        print(f"{each.method:<26}{each.samples:8d}{each.megabytes:11.0f}{grown}")
    if arguments.json is not None:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        document = {
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "machine": about,
            "rows": [asdict(row) for row in rows],
            "memory": [asdict(row) for row in memory],
        }
        write_text(arguments.json, json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
