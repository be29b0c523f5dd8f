"""Errors of every estimator against the standard errors it reports; written to docs/data/consistency.json.

The setting of tests/estimators/test_consistency.py: a true Coleman-Hodgdon plant with the parameters of
Table I, 1 nm of white noise, 2 s of a 5 Hz triangle, 200 seeds. Some minutes, most of them filterpy's.

    python docs/consistency.py [--runs N] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz
from piezoest.bench.origin import origin, put

TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
NOISE, RUNS, SECONDS = 1e-3, 200, 2.0
FAST, SLOW = 5000.0, 500.0  # Hz

# The plant is the model and does not change: so the filters are told, where they have a word for it.
CONSTANT = {"drift": 0.0, "mismatch": 0.0}
CASES: list[tuple[str, type, dict[str, Any], float]] = [
    ("HysteresisRLS", pz.HysteresisRLS, {}, FAST),
    ("HysteresisRLS", pz.HysteresisRLS, {"memory": 0.4}, FAST),
    ("HysteresisEKF", pz.HysteresisEKF, CONSTANT, FAST),
    ("HysteresisEKF", pz.HysteresisEKF, {}, FAST),
    ("FilterPyEKF", pz.FilterPyEKF, CONSTANT, SLOW),
    ("FilterPyUKF", pz.FilterPyUKF, CONSTANT, SLOW),
    ("BatchFit", pz.BatchFit, {}, FAST),
    ("MovingHorizon", pz.MovingHorizon, {}, SLOW),
]


@dataclass(frozen=True)
class Row:
    """What one estimator says of itself, and what is true.

    Parameters
    ----------
    name : str
        The estimator's.
    options : dict
        Arguments beside sample rate and noise.
    sample_rate : float
        [Hz].
    within_three : float
        Fraction of the runs in which all of alpha, beta, gamma lie within three standard errors.
    errors_by_said : list of float
        Root mean square of error over standard error, of alpha, beta, gamma: 1 if what is said is true,
        less if it is too cautious.
    alone_by_said : list of float
        Square root of P's diagonal over the standard error: what P alone would say too much.
    """

    name: str
    options: dict[str, Any]
    sample_rate: float
    within_three: float
    errors_by_said: list[float]
    alone_by_said: list[float]


def measure(name: str, new: Callable[[], Any], options: dict[str, Any], sample_rate: float, runs: int) -> Row:
    """Run so many seeds."""
    u = pz.signals.triangle(33.0, 5.0, 5.0 * SECONDS, sample_rate).values
    clean = TRUE.simulate(u)
    errors, said, alone = [], [], []
    for seed in range(runs):
        estimator = new()
        estimator.run(u, clean + NOISE * np.random.default_rng(seed).standard_normal(u.size), every=u.size)
        errors.append(estimator.theta[:3] - TRUE.theta)
        said.append(estimator.standard_errors[:3])
        alone.append(np.sqrt(np.diag(estimator.P))[:3])
    z = np.array(errors) / np.array(said)
    return Row(
        name, options, sample_rate, float(np.mean(np.all(np.abs(z) < 3.0, axis=1))),
        np.sqrt(np.mean(z**2, axis=0)).tolist(),
        np.median(np.array(alone) / np.array(said), axis=0).tolist(),
    )  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description="Errors of every estimator against the standard errors it reports.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("--runs", type=int, default=RUNS, help="seeds of each case")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the table to this file too")
    arguments = parser.parse_args()
    rows = []
    for name, cls, options, rate in CASES:
        rows.append(measure(name, partial(cls, rate, noise=NOISE, **options), options, rate, arguments.runs))
        print(json.dumps(asdict(rows[-1])), flush=True)
    if arguments.json is not None:
        document = {
            **origin(),
            "runs": arguments.runs,
            "seconds": SECONDS,
            "noise_um": NOISE,
            "rows": [asdict(row) for row in rows],
        }
        put(document, arguments.json)


if __name__ == "__main__":
    main()
