"""Run HysteresisRLS for a thousand million samples, and look whether it is still what it was.

A model of the kind that is estimated, with the gauge's noise, is followed for 5.6 hours of a stage at
50 kHz. At every check P has to be symmetric and positive definite, and theta within the noise of where
its mean over the first blocks was: within so many of its standard deviations over these, of which
there is one value a block. The trend over the whole soak has to be within that as well. Before the first
block it runs for as long as it takes to learn the sensor's noise.

    python benchmarks/soak.py [--samples N] [--json FILE]

It takes some twenty minutes; a tenth of it (--samples 1e8) says nearly as much.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import piezoest as pz
from piezoest.bench.adaptation import json_safe
from piezoest.bench.origin import origin, put

FloatArray = NDArray[np.float64]

SAMPLE_RATE = 50_000.0
TRUE = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
NOISE = 1.2e-3  # µm
BLOCK_PERIODS = 50  # of 5 Hz: 500 000 samples
CHECKS = 200
RUN_IN = 4  # blocks: the share that noise has in the slopes is learnt over a hundred periods
FIRST = 20  # blocks whose scatter is the noise of theta
WITHIN = 8.0  # standard deviations: an estimate from so few of them is itself uncertain


def stationary_loop() -> tuple[FloatArray, FloatArray]:
    """A block of voltage, and displacement without noise, that continue themselves without a seam."""
    u = np.asarray(pz.signals.triangle(35.0, 5.0, BLOCK_PERIODS, SAMPLE_RATE))
    twice = TRUE.simulate(np.tile(u, 2))
    return u, twice[u.size :]


def check(estimator: pz.HysteresisRLS) -> dict[str, Any]:
    P = estimator.P
    scale = np.sqrt(np.diag(P))
    correlation = P / np.outer(scale, scale)
    eigenvalues = np.linalg.eigvalsh(0.5 * (correlation + correlation.T))
    return {
        "samples": estimator.status.samples,
        "theta": estimator.theta.tolist(),
        "symmetric": bool(np.array_equal(P, P.T)),
        "smallest_eigenvalue": float(eigenvalues[0]),  # of P scaled to a unit diagonal
        "sound": bool(np.all(np.isfinite(P)) and eigenvalues[0] > 0.0 and np.array_equal(P, P.T)),
    }


def verdict(checks: list[dict[str, Any]], start: FloatArray, scatter: FloatArray) -> dict[str, Any]:
    """Largest deviation and trend of theta from its start, in standard deviations of that."""
    theta = np.array([each["theta"] for each in checks])
    deviation = (theta - start) / scatter
    time_ = np.linspace(0.0, 1.0, len(checks))
    trend = np.polyfit(time_, deviation, 1)[0] if len(checks) > 2 else np.zeros(theta.shape[1])
    return {
        "largest_deviation": float(np.max(np.abs(deviation))),
        "trend": trend.tolist(),
        "sound": all(each["sound"] for each in checks),
        "within_noise": bool(np.max(np.abs(deviation)) <= WITHIN and np.max(np.abs(trend)) <= WITHIN),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--samples", type=float, default=1e9)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--memory", type=float, help="[s]; default the estimator's own")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()

    rng = np.random.default_rng(arguments.seed)
    u, loop = stationary_loop()
    blocks = max(RUN_IN + FIRST + 2, round(arguments.samples / u.size))
    options = {} if arguments.memory is None else {"memory": arguments.memory}
    estimator = pz.HysteresisRLS(SAMPLE_RATE, **options)
    began = time.perf_counter()
    first: list[FloatArray] = []
    checks: list[dict[str, Any]] = []
    for k in range(blocks):
        noise = NOISE * rng.standard_normal(u.size)
        estimator.run(u, loop + noise, every=u.size)
        if k < RUN_IN:
            continue
        if k < RUN_IN + FIRST:
            first.append(estimator.theta)
        if k * CHECKS // blocks > (k - 1) * CHECKS // blocks or k == blocks - 1:
            checks.append(check(estimator))
            seconds = time.perf_counter() - began
            last = checks[-1]
            print(
                f"{last['samples']:.3g} samples, {seconds:.0f} s, theta {estimator.theta}, "
                f"smallest eigenvalue {last['smallest_eigenvalue']:.3g}",
                file=sys.stderr,
            )
    start, scatter = np.mean(first, axis=0), np.std(first, axis=0, ddof=1)
    document = {
        "suite": "soak",
        **origin(began),
        "sample_rate": SAMPLE_RATE,
        "true": TRUE.theta.tolist(),
        "run_in_samples": RUN_IN * u.size,
        "theta_at_the_start": start.tolist(),
        "noise_of_theta": scatter.tolist(),
        "within": WITHIN,
        **verdict(checks, start, scatter),
        "checks": checks,
    }
    put(json_safe(document), arguments.json)
    return 0 if document["sound"] and document["within_noise"] else 1


if __name__ == "__main__":
    sys.exit(main())
