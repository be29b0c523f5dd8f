"""The generated C against the library: a million samples of every scenario, in double and in float.

Double: the C controller replays the run's reference and measurements, and must give its voltages. Float:
it runs the stage itself, and its settled error is compared with the library's. Takes some minutes.

    python benchmarks/controller.py [--samples N] [--only SCENARIO] [--json FILE]
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import typer

import piezoest as pz
from piezoest.bench.estimators import candidate
from piezoest.bench.origin import origin, put
from piezoest.bench.scenarios import SCENARIOS

JUDGED = 10  # periods at the end; the stage has settled long before
LIMITS = pz.VoltageLimits(-80.0, 80.0)
ESTIMATORS = ("HysteresisRLS", "HysteresisEKF")
LARGEST_DIFFERENCE, LARGEST_FLOAT = 1e-12, 0.01
ROUNDING = 3.0  # times that of the reference: a float build rounds at every step, not once


def build(name: str, samples: int) -> tuple[Any, Any]:
    """Case and reference of at least so many samples, where the scenario can be that long."""
    periods = max(2, samples // 10_000)
    seconds = samples / 50_000.0
    case = SCENARIOS[name].build(
        0, sample_rate=50_000.0, updates=200, before=max(1, periods // 2), after=periods,
        rest=0.5 * seconds, drift=min(0.9 * seconds, 30.0),
    )  # fmt: skip
    r = case.reference
    return case, pz.signals.from_array(r.values[:samples], case.sample_rate, period=r.period)


def settled(error: Any, period: float) -> float:
    """Largest error of a period, mean of the last ones; fewer where there are not so many."""
    N = round(period)
    count = min(JUDGED, max(1, error.size // N // 2))
    return float(np.mean(np.max(np.abs(error[-count * N :].reshape(count, N)), axis=1)))


def compare(name: str, learner: str, samples: int) -> dict[str, Any]:
    """One scenario, one estimator."""
    case, r = build(name, samples)
    estimator = candidate(learner)(case.sample_rate, case.start)
    compensator = pz.InverseCompensator(case.start, LIMITS)
    double, single = (
        pz.export.CompiledController(pz.export.c(estimator, compensator, precision=precision))
        for precision in ("double", "float")
    )

    def by_library(reference: pz.Signal) -> pz.TrackingRecord:
        parts = {"compensator": compensator.copy(), "estimator": estimator.copy()}
        return pz.track(reference, stage=case.new_stage(), **parts)

    library = by_library(r)
    before = np.concatenate([[np.nan], library.measured[:-1]])
    off = np.max(np.abs(double.run(library.reference, before) - library.voltage))
    own = pz.track(r, stage=case.new_stage(), compensator=single)
    ours, float_ = (settled(record.error, case.period) for record in (library, own))
    apart, rounded = abs(float_ / ours - 1.0), None
    if apart > LARGEST_FLOAT:
        # How far the ring carries a difference in the seventh digit: no float build can come closer.
        near = r.values.astype(np.float32).astype(float)
        near_run = by_library(pz.signals.from_array(near, r.sample_rate, period=r.period))
        rounded = settled(near_run.error, case.period)
    return {
        "scenario": name,
        "estimator": learner,
        "samples": len(r),
        "double_difference": float(off / np.max(np.abs(library.voltage))),
        "settled_error_um": ours,
        "settled_error_float_um": float_,
        "float_difference": apart,
        "settled_error_of_rounded_reference_um": rounded,
    }


def is_near(row: dict[str, Any]) -> bool:
    """Whether double is the library's, and float within 1 %, or as near as rounding the reference."""
    rounded = row["settled_error_of_rounded_reference_um"]
    own = 0.0 if rounded is None else abs(rounded / row["settled_error_um"] - 1.0)
    allowed = max(LARGEST_FLOAT, ROUNDING * own)
    return bool(row["double_difference"] <= LARGEST_DIFFERENCE and row["float_difference"] <= allowed)


def main(samples: int = 1_000_000, only: list[str] | None = None, json: Path | None = None) -> None:
    """Compare SAMPLES of each scenario, or ONLY of some; fails if a difference is too large."""
    rows = []
    for name in only or SCENARIOS:
        for learner in ESTIMATORS:
            rows.append(compare(name, learner, samples))
            print(rows[-1], "" if is_near(rows[-1]) else "too far apart", file=sys.stderr, flush=True)
    put({**origin(), "rows": rows}, json)
    sys.exit(not all(map(is_near, rows)))


if __name__ == "__main__":
    typer.run(main)
