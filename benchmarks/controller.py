"""The generated C against the library: a million samples of every scenario, in double and in float.

Double: the C controller replays the run's reference and measurements, and must give its voltages. Float:
it runs the stage itself, and its settled error is compared with the library's. Takes some minutes.

    python benchmarks/controller.py [--samples N] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from smoke import machine

import piezoest as pz
from piezoest._files import write_text
from piezoest.bench.scenarios import SCENARIOS

SAMPLES = 1_000_000
# The last so many periods are judged; the stage has settled long before.
JUDGED = 10
LIMITS = pz.VoltageLimits(-80.0, 80.0)
LARGEST_DIFFERENCE, LARGEST_FLOAT = 1e-12, 0.01
# A float build rounds at every step, not once.
ROUNDING = 3.0


def within(row: dict[str, Any]) -> bool:
    """Whether the float build is as near as it can be: within 1 %, or as near as rounding the reference."""
    rounded = row["settled_error_of_rounded_reference_um"]
    own = 0.0 if rounded is None else abs(rounded / row["settled_error_um"] - 1.0)
    return row["float_difference"] <= max(LARGEST_FLOAT, ROUNDING * own)


def pair(learner: str, case: Any) -> tuple[Any, Any]:
    """Estimator and compensator."""
    estimators = {"HysteresisRLS": pz.HysteresisRLS, "HysteresisEKF": pz.HysteresisEKF}
    estimator = estimators[learner](case.sample_rate, initial_model=case.start)
    return estimator, pz.InverseCompensator(case.start, LIMITS)


def build(name: str, samples: int) -> tuple[Any, Any]:
    """Case and reference of at least so many samples, where the scenario can be that long."""
    periods = max(2, samples // 10_000)
    seconds = samples / 50_000.0
    before = max(1, periods // 2)
    switches = name in ("amplitude-switch", "amplitude-drop")
    case = SCENARIOS[name].build(
        0, before=before, after=periods - before if switches else periods,
        rest=0.5 * seconds, drift=min(0.9 * seconds, 30.0),
    )  # fmt: skip
    return case, pz.signals.from_array(
        case.reference.values[:samples], case.sample_rate, period=case.reference.period
    )


def settled(error: Any, period: int) -> float:
    """Largest error of a period, mean of the last ones; fewer where there are not so many."""
    count = min(JUDGED, max(1, error.size // period // 2))
    return float(np.mean(np.max(np.abs(error[-count * period :].reshape(count, period)), axis=1)))


def compare(name: str, learner: str, samples: int) -> dict[str, Any]:
    """One scenario, one estimator."""
    case, r = build(name, samples)
    estimator, compensator = pair(learner, case)
    double = pz.export.CompiledController(pz.export.c(estimator, compensator))
    single = pz.export.CompiledController(pz.export.c(estimator, compensator, precision="float"))
    parts: dict[str, Any] = {"compensator": compensator, "estimator": estimator}
    library = pz.track(r, stage=case.new_stage(), **parts)
    before = np.concatenate([[np.nan], library.measured[:-1]])
    voltage = double.run(library.reference, before)
    scale = float(np.max(np.abs(library.voltage)))
    own = pz.track(r, stage=case.new_stage(), compensator=single)
    errors = [settled(record.error, round(case.period)) for record in (library, own)]
    largest = [float(np.max(np.abs(record.error[-2 * round(case.period) :]))) for record in (library, own)]
    apart = abs(errors[1] / errors[0] - 1.0)
    rounded = rounding(name, learner, samples) if apart > LARGEST_FLOAT else None
    return {
        "scenario": name,
        "estimator": learner,
        "samples": len(r),
        "double_difference": float(np.max(np.abs(voltage - library.voltage))) / scale,
        "settled_error_um": errors[0],
        "settled_error_float_um": errors[1],
        "float_difference": apart,
        "settled_error_of_rounded_reference_um": rounded,
        "largest_of_two_periods_um": largest[0],
        "largest_of_two_periods_float_um": largest[1],
    }


def rounding(name: str, learner: str, samples: int) -> float:
    """Settled error of the library itself, in double, for a reference rounded to float [µm].

    How far the ring carries a difference in the seventh digit; no float build can come closer than that.
    """
    case, r = build(name, samples)
    estimator, compensator = pair(learner, case)
    single = pz.signals.from_array(r.values.astype(np.float32).astype(float), r.sample_rate, period=r.period)
    record = pz.track(single, stage=case.new_stage(), compensator=compensator, estimator=estimator)
    return settled(record.error, round(case.period))


def main() -> int:
    """Print the comparison; 1 if a difference is too large."""
    parser = argparse.ArgumentParser(description="Generated C against the library, scenario by scenario.")
    parser.add_argument("--samples", type=int, default=SAMPLES, help="of each scenario")
    parser.add_argument("--only", action="append", help="only this scenario; may be repeated")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to this file too")
    arguments = parser.parse_args()
    rows = []
    for name in arguments.only or SCENARIOS:
        for learner in ("HysteresisRLS", "HysteresisEKF"):
            row = compare(name, learner, arguments.samples)
            rows.append(row)
            print(
                f"{name:<17} {learner:<14} {row['samples']} samples: double off by "
                f"{row['double_difference']:.1e}; settled {row['settled_error_um']:.5f} µm, float "
                f"{row['settled_error_float_um']:.5f} µm, {100.0 * row['float_difference']:.2f} % apart",
                flush=True,
            )
    if arguments.json is not None:
        document = {"machine": machine(), "rows": rows}
        write_text(arguments.json, json.dumps(document, indent=2, ensure_ascii=False) + "\n")
    wrong = [
        row for row in rows
        if not (row["double_difference"] <= LARGEST_DIFFERENCE and within(row))
    ]  # fmt: skip
    for row in wrong:
        print(f"too far apart: {row['scenario']}, {row['estimator']}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
