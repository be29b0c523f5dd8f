"""Time fits of a recorded log of 50 000 samples.

Absolute times are the machine's; beside them stands how many simulations by 20 plays, compiled, take as long.

    python benchmarks/fits.py [--repeats N] [--json FILE]
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz
from piezoest.bench.origin import origin, put
from piezoest.fitting import FORMS

SAMPLES, RATE = 50_000, 5_000.0


def log(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Voltage and displacement of plays with creep, bent a little, in noise; swings of several sizes."""
    t = np.arange(samples) / RATE
    u = 60.0 + 50.0 * np.sin(2.0 * np.pi * 3.0 * t) * (0.65 + 0.35 * np.sin(0.4 * t))
    creep = pz.Creep.logarithmic(0.01, shortest=0.1, longest=10.0)
    thresholds, weights = np.linspace(2.0, 40.0, 20), np.full(20, 0.003)
    plays = pz.PrandtlIshlinskii(0.1, thresholds, weights, 1.0, creep, sample_rate=RATE)
    x = plays.simulate(u)
    return u, x + 2e-4 * x**2 + 2e-3 * np.random.default_rng(0).standard_normal(samples)


def fastest(work: Callable[[], Any], repeats: int) -> float:
    """Least of several times [s]; the first run, which compiles, does not count."""
    work()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    began = time.perf_counter()
    u, x = log(SAMPLES)
    model = pz.PrandtlIshlinskii(0.1, np.linspace(2.0, 40.0, 20), np.full(20, 0.003))
    simulation = fastest(lambda: model.simulate(u), arguments.repeats)
    cases: dict[str, Callable[[], Any]] = {
        name: lambda name=name: pz.fit(u, x, sample_rate=RATE, model=name) for name in FORMS
    }
    cases["identify, all kinds"] = lambda: pz.identify(u, x, sample_rate=RATE, train=0.9)
    rows = []
    for name, work in cases.items():
        seconds = fastest(work, arguments.repeats)
        rows.append({"name": name, "seconds": seconds, "simulations": seconds / simulation})
        print(f"{name:24s} {seconds:7.3f} s {seconds / simulation:8.0f} simulations")
    document = {"suite": "fits", **origin(began), "samples": SAMPLES, "rows": rows}
    put(document, arguments.json)


if __name__ == "__main__":
    main()
