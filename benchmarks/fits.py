"""Time fits of a recorded log of 50 000 samples, and of one that is read in blocks.

Absolute times are the machine's; beside them stands how many simulations by 20 plays, compiled, take as long.

    python benchmarks/fits.py [--repeats N] [--rows N] [--json FILE]

With --rows a log of so many rows is written to a temporary folder and streamed by a process of its own, whose
largest memory is shown (Linux only).
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz
from piezoest.bench.origin import origin, put
from piezoest.fitting import FORMS

SAMPLES, RATE = 50_000, 5_000.0
AT_ONCE = 1_000_000  # rows that are written together


def log(samples: int, first: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Voltage and displacement of plays with creep, bent a little, in noise; swings of several sizes."""
    t = (first + np.arange(samples)) / RATE
    u = 60.0 + 50.0 * np.sin(2.0 * np.pi * 3.0 * t) * (0.65 + 0.35 * np.sin(0.4 * t))
    creep = pz.Creep.logarithmic(0.01, shortest=0.1, longest=10.0)
    thresholds, weights = np.linspace(2.0, 40.0, 20), np.full(20, 0.003)
    plays = pz.PrandtlIshlinskii(0.1, thresholds, weights, 1.0, creep, sample_rate=RATE)
    x = plays.simulate(u)
    return u, x + 2e-4 * x**2 + 2e-3 * np.random.default_rng(first).standard_normal(samples)


def fastest(work: Callable[[], Any], repeats: int) -> float:
    """Least of several times [s]; the first run, which compiles, does not count."""
    work()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def written(folder: Path, rows: int) -> Path:
    """A CSV of time, voltage and displacement."""
    path = folder / "log.csv"
    with path.open("w") as file:
        file.write("time_s,voltage_V,displacement_um\n")
        for first in range(0, rows, AT_ONCE):
            u, x = log(min(AT_ONCE, rows - first), first)
            t = (first + np.arange(u.size)) / RATE
            np.savetxt(file, np.column_stack([t, u, x]), fmt="%.6f,%.5f,%.5f")
    return path


def streamed(path: str, results: Any) -> None:
    """Time a streamed identification, in a process of its own."""
    began = time.perf_counter()
    found = pz.identify_stream(pz.stream_record(path))
    results.put({
        "rows": found.samples,
        "seconds": time.perf_counter() - began,
        "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "chosen": found.chosen,
        "held_out_um": found.held_out.rms,
    })  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--rows", type=int, default=0, help="of a log that is streamed")
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
    stream = None
    if arguments.rows:
        with tempfile.TemporaryDirectory() as folder:
            path = written(Path(folder), arguments.rows)
            context = multiprocessing.get_context("spawn")
            results = context.Queue()
            process = context.Process(target=streamed, args=(str(path), results))
            process.start()
            stream = results.get()
            process.join()
        print(f"streamed: {stream}")
    document = {"suite": "fits", **origin(began), "samples": SAMPLES, "rows": rows, "stream": stream}
    put(document, arguments.json)


if __name__ == "__main__":
    main()
