"""What each fault does to the ring: every estimator.

A triangle of 5 µm at 5 Hz for three seconds; the fault is between the stage and the rest of the ring
(piezoest.bench.faults). Errors are those of the true displacement: the worst from the fourth period on,
and that of the last three, without what a gauge that is off carries the stage along by.

    python benchmarks/faults.py [--json FILE] [--jobs N] [--seed N]

It takes about a minute.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz
from piezoest.bench.adaptation import LIMITS, TRANSFER, json_safe
from piezoest.bench.candidates import candidate
from piezoest.bench.executors import in_processes
from piezoest.bench.faults import FAULTS, NONE
from piezoest.bench.metrics import LAST_PERIODS, SETTLED
from piezoest.bench.origin import origin, put

SAMPLE_RATE = 10_000.0
AMPLITUDE, FREQUENCY, PERIODS = 5.0, 5.0, 15  # µm, Hz
LEARNT = 3  # periods until the start is forgotten
UPDATE = 0.002  # s
START = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
ESTIMATORS = ("HysteresisRLS", "OutputErrorRLS", "HysteresisEKF", "PrandtlIshlinskiiRLS")


@dataclass(frozen=True)
class Case:
    """One run."""

    fault: str
    estimator: str
    seed: int


def cases(seed: int) -> list[Case]:
    """Every fault, and none, with every estimator."""
    return [Case(fault, estimator, seed) for fault in ("none", *FAULTS) for estimator in ESTIMATORS]


def one(case: Case) -> dict[str, Any]:
    """Run it and look at what it did."""
    fault = NONE if case.fault == "none" else FAULTS[case.fault]
    reference = fault.reference(pz.signals.triangle(AMPLITUDE, FREQUENCY, PERIODS, SAMPLE_RATE))
    learner = candidate(case.estimator)(SAMPLE_RATE, START)
    transfer = round(TRANSFER * SAMPLE_RATE)
    row: dict[str, Any] = {"fault": case.fault, "estimator": case.estimator}
    try:
        record = pz.track(
            reference,
            stage=fault.build(lambda rate: pz.PaperStage(rate, seed=case.seed), SAMPLE_RATE, seed=case.seed),
            compensator=pz.InverseCompensator(START, LIMITS, transfer_samples=transfer),
            estimator=learner,
            update_interval=round(UPDATE * SAMPLE_RATE),
        )
    except Exception as error:
        return {**row, "failure": f"{type(error).__name__}: {error}"}
    errors = largest_per_period(record.error)
    # A gauge that is off takes the stage along, or does not: both are right.
    after = min(
        float(np.max(largest_per_period(record.error - carried)[-LAST_PERIODS:]))
        for carried in (0.0, fault.carried)
    )
    return {
        **row,
        "failure": None,
        "worst": float(np.max(errors[LEARNT:])),
        "after": after,
        "recovered": bool(after < SETTLED * fault.reference_factor * AMPLITUDE),
        "finite": bool(np.isfinite(record.theta).all() and np.isfinite(learner.P).all()),
        "admissible": bool(learner.model.is_admissible),
        "largest_voltage": float(np.max(np.abs(record.voltage))),
        "errors": errors.tolist(),
    }


def largest_per_period(error: Any) -> Any:
    """Largest error of each period [µm]."""
    return np.max(np.abs(error).reshape(PERIODS, -1), axis=1)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--jobs", type=int, help="processes; default one for each core")
    parser.add_argument("--seed", type=int, default=3)
    arguments = parser.parse_args()

    began = time.perf_counter()
    todo = cases(arguments.seed)
    found = {(row["fault"], row["estimator"]): row for row in in_processes(one, todo, arguments.jobs)}
    rows = [found[case.fault, case.estimator] for case in todo]
    document = {
        "suite": "faults",
        **origin(began),
        "seed": arguments.seed,
        "sample_rate": SAMPLE_RATE,
        "limits": [LIMITS.minimum, LIMITS.maximum],
        "rows": json_safe(rows),
    }
    put(document, arguments.json)
    broken = [row for row in rows if row["failure"] or not (row["finite"] and row["admissible"])]
    for row in broken:
        print(f"out of bounds: {row['fault']}, {row['estimator']}", file=sys.stderr)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
