"""How far any fixed Coleman-Hodgdon model can compensate the simulated stage: found by direct search.

    python benchmarks/best_fixed_model.py [--json FILE] [--evaluations N]

For each triangle row of the paper the inverse of (a, b, c, offset) feeds forward, and the error of the last
two periods is taken. Nelder and Mead's search over the four parameters makes first its mean square as small
as it gets, then its largest value; no estimator is in between. Beside it is the best linear feed-forward,
found the same way. What an estimator of this model reaches beyond these figures it owes to adapting within
the period.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar
from smoke import machine

import piezoest as pz
from piezoest._files import write_text
from piezoest.bench.adaptation import LIMITS

FloatArray = NDArray[np.float64]

SAMPLE_RATE = 50_000.0
PERIODS, LAST = 8, 2
ROWS = ((2.5, 5.0), (5.0, 5.0), (7.5, 5.0), (5.0, 2.5))  # µm, Hz
START = pz.ColemanHodgdon(0.021, 0.147, 0.00429)  # Table I
STEP = 0.1  # of the first simplex: parts of a, b and c, and µm


@dataclass(frozen=True)
class Row:
    """One reference and what is best for it."""

    amplitude: float
    frequency: float
    linear_max: float
    fixed_max: float
    fixed_rms: float
    reduction: float
    a: float
    b: float
    c: float
    offset: float
    evaluations: int


def last_error(r: FloatArray, u: FloatArray, samples: int) -> FloatArray:
    """Error of the last samples if the stage is given u [µm]."""
    stage = pz.PaperStage(sample_rate=SAMPLE_RATE, seed=0)
    stage.run(u)
    return (r - np.asarray(stage.displacement))[-samples:]


def best(amplitude: float, frequency: float, evaluations: int) -> Row:
    """Search for one row."""
    r = pz.signals.triangle(amplitude, frequency, PERIODS, SAMPLE_RATE).values
    samples = round(LAST * SAMPLE_RATE / frequency)

    def linear(gain: float) -> float:
        return float(np.abs(last_error(r, r / gain, samples)).max())

    def error(p: FloatArray) -> FloatArray:
        a, b, c = np.exp(p[:3])
        model = pz.ColemanHodgdon.from_loop(a, b, c, p[3])
        if not model.is_admissible:
            return np.full(samples, 10.0)
        return last_error(r, pz.InverseCompensator(model, LIMITS, transfer_samples=1).run(r), samples)

    p = np.array([np.log(START.a), np.log(START.b), np.log(START.c), 0.0])
    used = 0
    for cost in (lambda p: float(np.sqrt(np.mean(error(p) ** 2))), lambda p: float(np.abs(error(p)).max())):
        simplex = np.vstack([p, p + STEP * np.eye(4)])
        options = {"maxfev": evaluations, "xatol": 1e-4, "fatol": 1e-5, "initial_simplex": simplex}
        found = minimize(cost, p, method="Nelder-Mead", options=options)
        p, used = found.x, used + found.nfev
    e = error(p)
    linear_max = float(minimize_scalar(linear, bounds=(0.1, 0.25), method="bounded").fun)
    largest = float(np.abs(e).max())
    a, b, c = np.exp(p[:3]).tolist()
    return Row(
        amplitude, frequency, linear_max, largest, float(e.std()), 1.0 - largest / linear_max,
        a, b, c, float(p[3]), used,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures there")
    parser.add_argument("--evaluations", type=int, default=400, help="at most, of each of the two searches")
    arguments = parser.parse_args()
    rows = []
    print("µm    Hz    linear µm   fixed µm   below linear")
    for amplitude, frequency in ROWS:
        row = best(amplitude, frequency, arguments.evaluations)
        rows.append(row)
        print(
            f"{amplitude:<5g} {frequency:<5g} {row.linear_max:9.4f} {row.fixed_max:10.4f}"
            f" {100 * row.reduction:11.1f} %",
            flush=True,
        )
        if arguments.json:
            document = {
                "machine": machine(),
                "date": datetime.now(UTC).isoformat(timespec="seconds"),
                "sample_rate": SAMPLE_RATE,
                "periods": PERIODS,
                "rows": [asdict(row) for row in rows],
            }
            write_text(arguments.json, json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
