"""Compare the compiled filter with filterpy's over 10 s at 50 kHz, missing samples in between.

Prints the largest relative difference of each quantity and the ratio of speeds; a difference above
1e-9 is an error. filterpy takes a minute or two for the half million samples.

    python benchmarks/filterpy_parity.py [--seconds S] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
from smoke import machine

import piezoest as pz
from piezoest._files import write_text

SAMPLE_RATE = 50_000.0
TRUE = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
NOISE, SEED = 1e-3, 0
MISSING = 0.01  # of the samples, at random, beside one gap of 0.1 s
LARGEST_DIFFERENCE = 1e-9
EVERY = 50  # samples between two that are compared


def main() -> int:
    """Print the comparison; 1 if the two filters differ."""
    parser = argparse.ArgumentParser(
        description="Compare HysteresisEKF(project=False) with filterpy's ExtendedKalmanFilter.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("--seconds", type=float, default=10.0, help="length of the record at 50 kHz")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write figures and machine to this file too"
    )
    arguments = parser.parse_args()

    rng = np.random.default_rng(SEED)
    u = pz.signals.triangle(33.0, 5.0, 5.0 * arguments.seconds, SAMPLE_RATE).values
    x = TRUE.simulate(u) + NOISE * rng.standard_normal(u.size)
    x[rng.random(u.size) < MISSING] = np.nan
    x[u.size // 2 : u.size // 2 + int(0.1 * SAMPLE_RATE)] = np.nan

    pz.HysteresisEKF(SAMPLE_RATE).run(u[:100], x[:100])
    compiled, baseline = pz.HysteresisEKF(SAMPLE_RATE, project=False), pz.FilterPyEKF(SAMPLE_RATE)
    seconds = []
    traces = []
    for estimator in (compiled, baseline):
        began = time.perf_counter()
        traces.append(estimator.run(u, x, every=EVERY, record=("y", "S", "P")))
        seconds.append(time.perf_counter() - began)
    differences = {}
    for name in ("theta", "y", "S", "P"):
        ours, theirs = (getattr(trace, name) for trace in traces)
        differences[name] = float(np.max(np.abs(ours - theirs) / np.abs(theirs).max(axis=0)))
    figures = {
        "samples": u.size,
        "missing": compiled.status.missing,
        "largest_relative_difference": differences,
        "compiled_microseconds_per_sample": 1e6 * seconds[0] / u.size,
        "filterpy_microseconds_per_sample": 1e6 * seconds[1] / u.size,
        "times_faster": seconds[1] / seconds[0],
    }
    about = machine()
    print(*(f"{key:>10}: {value}" for key, value in about.items()), sep="\n")
    print(f"\n{u.size} samples at 50 kHz, {compiled.status.missing} of them missing")
    for name, value in differences.items():
        print(f"largest difference of {name:<6} {value:.1e} of its largest value")
    print(
        f"HysteresisEKF {figures['compiled_microseconds_per_sample']:.3f} µs a sample, "
        f"FilterPyEKF {figures['filterpy_microseconds_per_sample']:.1f} µs: "
        f"{figures['times_faster']:.0f} times faster"
    )
    if arguments.json is not None:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        document = {"machine": about, "seed": SEED, **figures}
        write_text(arguments.json, json.dumps(document, indent=2) + "\n")
    apart = [name for name, value in differences.items() if not value <= LARGEST_DIFFERENCE]
    if apart:
        print(f"\ndiffers from filterpy: {', '.join(apart)}", file=sys.stderr)
    return 1 if apart else 0


if __name__ == "__main__":
    sys.exit(main())
