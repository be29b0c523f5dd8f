"""Errors of every estimator beside the standard errors it reports; writes docs/data/consistency.json.

A Coleman-Hodgdon plant with the parameters of Table I, 1 nm of white noise, 2 s of a 5 Hz triangle and 200
seeds, as in tests/estimators/test_consistency.py. Takes some minutes: python docs/consistency.py
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from page_parts import DOCS, Document

import piezoest as pz
from piezoest.bench.origin import origin, put

TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
NOISE, SECONDS = 1e-3, 2.0
FAST, SLOW = 5000.0, 500.0  # Hz

# The plant is the model and is constant: the filters are told so where they have an argument for it.
CONSTANT = {"drift": 0.0, "mismatch": 0.0}
CASES: list[tuple[str, dict[str, Any], float]] = [
    ("HysteresisRLS", {}, FAST),
    ("HysteresisRLS", {"memory": 0.4}, FAST),
    ("HysteresisEKF", CONSTANT, FAST),
    ("HysteresisEKF", {}, FAST),
    ("FilterPyEKF", CONSTANT, SLOW),
    ("FilterPyUKF", CONSTANT, SLOW),
    ("BatchFit", {}, FAST),
    ("MovingHorizon", {}, SLOW),
]


def measure(name: str, options: dict[str, Any], sample_rate: float, runs: int) -> Document:
    """Run all seeds of one case.

    `within_three` is the fraction of runs in which all parameters lie within three standard errors;
    `errors_by_said` the rms of error over standard error, 1 if the standard error is right and less if it is
    too large; `alone_by_said` the square root of P's diagonal over the standard error.
    """
    u = pz.signals.triangle(33.0, 5.0, 5.0 * SECONDS, sample_rate).values
    clean = TRUE.simulate(u)
    errors, said, alone = [], [], []
    for seed in range(runs):
        estimator = getattr(pz, name)(sample_rate, noise=NOISE, **options)
        estimator.run(u, clean + NOISE * np.random.default_rng(seed).standard_normal(u.size), every=u.size)
        errors.append(estimator.theta[:3] - TRUE.theta)
        said.append(estimator.standard_errors[:3])
        alone.append(np.sqrt(np.diag(estimator.P))[:3])
    z = np.array(errors) / np.array(said)
    return {
        "name": name,
        "options": options,
        "sample_rate": sample_rate,
        "within_three": float(np.mean(np.all(np.abs(z) < 3.0, axis=1))),
        "errors_by_said": np.sqrt(np.mean(z**2, axis=0)).tolist(),
        "alone_by_said": np.median(np.array(alone) / np.array(said), axis=0).tolist(),
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Errors of every estimator beside its standard errors.")
    parser.add_argument("--runs", type=int, default=200, help="seeds of each case")
    parser.add_argument("--json", default=DOCS / "data" / "consistency.json", help="file to write")
    given = parser.parse_args()
    rows = []
    for case in CASES:
        rows.append(measure(*case, given.runs))
        print(rows[-1], flush=True)
    put({**origin(), "runs": given.runs, "seconds": SECONDS, "noise_um": NOISE, "rows": rows}, given.json)
