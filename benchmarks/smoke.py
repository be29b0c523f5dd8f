"""Time the compiled loops against plain NumPy loops of the same law, in the same run.

Absolute times are the machine's; the ratios travel. Each row also compares the results, and a
difference beyond rounding is an error: a fast loop of another law would say nothing.

    python benchmarks/smoke.py [--samples N] [--repeats N] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.special import lambertw

import piezoest as pz
from piezoest._files import write_text

FloatArray = NDArray[np.float64]

SAMPLE_RATE = 50_000.0
TRUE = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
START = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
# The settings of HysteresisRLS that the NumPy loop repeats.
MEMORY, UNCERTAINTY, NOISE, CUTOFF = 0.4, 0.5, 1.5e-3, 2500.0
LARGEST_DIFFERENCE = 1e-6


@dataclass(frozen=True)
class Row:
    """One comparison: times per sample, and how far the results are apart."""

    name: str
    samples: int
    nanoseconds: float
    numpy_nanoseconds: float
    ratio: float
    relative_difference: float


def numpy_rls(u: FloatArray, x: FloatArray) -> FloatArray:
    """Learn theta as HysteresisRLS does, in physical units: (18)-(20) behind W_p, discrete law."""
    pole = np.exp(-2.0 * np.pi * CUTOFF / SAMPLE_RATE)
    forgetting = np.exp(-1.0 / (MEMORY * SAMPLE_RATE))
    R = NOISE**2 * 2.0 * (1.0 - pole) ** 2 / (1.0 + pole)
    theta = START.theta
    P = np.diag((UNCERTAINTY * theta) ** 2)
    filtered = np.zeros(4)
    raw = np.empty(4)
    for k in range(1, u.size):
        du = u[k] - u[k - 1]
        travel = abs(du)
        raw[0] = -0.5 * (x[k] + x[k - 1]) * travel
        raw[1] = du
        raw[2] = 0.5 * (u[k] + u[k - 1]) * travel
        raw[3] = x[k] - x[k - 1]
        filtered = raw + pole * (filtered - raw)
        phi = filtered[:3]
        P_phi = P @ phi
        S = phi @ P_phi + forgetting * R
        theta = theta + P_phi * ((filtered[3] - theta @ phi) / S)
        P = (P - np.outer(P_phi, P_phi) / S) / forgetting
    return theta


def numpy_inverse(r: FloatArray) -> FloatArray:
    """Voltage for r by the closed form (C7), (C10) in increments, with SciPy's Lambert W."""
    a, b, c = TRUE.a, TRUE.b, TRUE.c
    voltage = np.empty_like(r)
    u = w_h = 0.0
    for k in range(r.size):
        dr = r[k] - (c * u + w_h)
        s = np.sign(dr)
        e = (b + s * a * w_h) / c
        d = a * np.abs(dr) / c
        travel = d + e + lambertw(-e * np.exp(-(d + e))).real
        decay = np.exp(-travel)
        w_h = w_h * decay - s * (b / a) * (1.0 - decay)
        u = u + s * travel / a
        voltage[k] = u
    return voltage


def estimator() -> pz.HysteresisRLS:
    """Make the estimator whose law `numpy_rls` repeats."""
    return pz.HysteresisRLS(
        SAMPLE_RATE,
        initial_model=START,
        memory=MEMORY,
        uncertainty=UNCERTAINTY,
        noise=NOISE,
        cutoff=CUTOFF,
    )


def run_rls(u: FloatArray, x: FloatArray) -> FloatArray:
    """Learn theta by one `run`."""
    learner = estimator()
    learner.run(u, x)
    return learner.theta


def step_rls(u: list[float], x: list[float]) -> FloatArray:
    """Learn theta by one `step` a sample, as in a live loop."""
    learner = estimator()
    step = learner.step
    for u_k, x_k in zip(u, x, strict=True):
        step(u_k, x_k)
    return learner.theta


def step_inverse(r: list[float]) -> FloatArray:
    """Voltage by one `step` a sample."""
    step = pz.InverseCompensator(TRUE).step
    return np.array([step(r_k) for r_k in r])


def best(function: Callable[[], FloatArray], repeats: int) -> tuple[float, FloatArray]:
    """Return the shortest time [s] of so many calls, after one to warm up, and the result."""
    result = function()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - start)
    return min(times), result


def compare(samples: int, repeats: int) -> list[Row]:
    """Time every loop on one triangle of `samples` samples."""
    periods = samples * 5.0 / SAMPLE_RATE
    r = np.asarray(pz.signals.triangle(5.0, 5.0, periods, SAMPLE_RATE))
    u = pz.InverseCompensator(TRUE).run(r)
    x = TRUE.simulate(u) + np.random.default_rng(0).normal(scale=NOISE, size=r.size)
    u_list, x_list, r_list = u.tolist(), x.tolist(), r.tolist()

    rls_peer = best(lambda: numpy_rls(u, x), 1)
    inverse_peer = best(lambda: numpy_inverse(r), 1)
    cases: list[tuple[str, Callable[[], FloatArray], tuple[float, FloatArray]]] = [
        ("HysteresisRLS.run", lambda: run_rls(u, x), rls_peer),
        ("HysteresisRLS.step", lambda: step_rls(u_list, x_list), rls_peer),
        ("InverseCompensator.run", lambda: pz.InverseCompensator(TRUE).run(r), inverse_peer),
        ("InverseCompensator.step", lambda: step_inverse(r_list), inverse_peer),
    ]
    rows = []
    for name, function, (peer_seconds, expected) in cases:
        seconds, result = best(function, repeats)
        rows.append(
            Row(
                name=name,
                samples=r.size,
                nanoseconds=1e9 * seconds / r.size,
                numpy_nanoseconds=1e9 * peer_seconds / r.size,
                ratio=peer_seconds / seconds,
                relative_difference=float(np.max(np.abs(result - expected)) / np.max(np.abs(expected))),
            )
        )
    return rows


def cpu_name() -> str:
    """Name of the processor, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def machine() -> dict[str, Any]:
    """Describe what the times depend on."""
    return {
        "platform": platform.platform(),
        "cpu": cpu_name(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "piezoest": pz.__version__,
    }


def main() -> int:
    """Print the table; 1 if a result is not that of the NumPy loop."""
    parser = argparse.ArgumentParser(
        description="Time the compiled loops against plain NumPy loops of the same law.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("--samples", type=int, default=50_000, help="length of the signal")
    parser.add_argument("--repeats", type=int, default=3, help="the best of so many counts")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write table and machine to this file too")
    arguments = parser.parse_args()

    about = machine()
    rows = compare(arguments.samples, arguments.repeats)
    print(*(f"{key:>10}: {value}" for key, value in about.items()), sep="\n")
    print(f"\n{'per sample':<26}{'ns':>9}{'NumPy loop, ns':>17}{'times faster':>15}{'difference':>13}")
    for row in rows:
        print(
            f"{row.name:<26}{row.nanoseconds:9.1f}{row.numpy_nanoseconds:17.0f}{row.ratio:15.0f}"
            f"{row.relative_difference:13.1e}"
        )
    if arguments.json is not None:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        document = {"machine": about, "rows": [asdict(row) for row in rows]}
        write_text(arguments.json, json.dumps(document, indent=2) + "\n")
    apart = [row.name for row in rows if not row.relative_difference <= LARGEST_DIFFERENCE]
    if apart:
        print(f"\nnot the result of the NumPy loop: {', '.join(apart)}", file=sys.stderr)
    return 1 if apart else 0


if __name__ == "__main__":
    sys.exit(main())
