"""Compare the library's speed with C written by hand, filterpy and padasip, and with its targets.

All that is compared runs in the same rounds, one after the other; figures are medians over the rounds,
ratios are medians of the ratios within a round. Beside each time stands the outcome. Needs gcc.

    python benchmarks/speed.py [--samples N] [--rounds N] [--turns N] [--json FILE] [--figure FILE]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from c_reference import COMMAND, Exported, FloatArray, Reference, ekf_settings, rls_settings
from single_calls import Calls, calls, cold, disturbances
from smoke import SAMPLE_RATE, START, TRUE

import piezoest as pz
from piezoest._files import save_figure, write_text
from piezoest.bench.origin import origin

NOISE, MEMORY, CUTOFF = 1.5e-3, 0.4, 2500.0
LARGEST_DIFFERENCE = 1e-6
Work = Callable[[], Any]


def record(samples: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Reference, voltage and displacement of a triangle."""
    r = np.asarray(pz.signals.triangle(5.0, 5.0, samples * 5.0 / SAMPLE_RATE, SAMPLE_RATE)).copy()
    u = pz.InverseCompensator(TRUE).run(r)
    return r, u, TRUE.simulate(u) + np.random.default_rng(0).normal(scale=NOISE, size=r.size)


def interleaved(
    work: dict[str, Work], rounds: int, clock: Callable[[], float] = time.thread_time
) -> dict[str, FloatArray]:
    """Seconds of each in each round, each after a call to warm up: what ran before leaves no trace.

    The clock is the thread's own, which stands while others have the processor; work on several threads
    needs the wall's.
    """
    seconds: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(rounds):
        for name, function in work.items():
            function()
            began = clock()
            function()
            seconds[name].append(clock() - began)
    return {name: np.array(values) for name, values in seconds.items()}


def rls(u: FloatArray, x: FloatArray, **options: Any) -> FloatArray:
    """Run `HysteresisRLS` over the record, its history kept; theta at the end."""
    estimator = pz.HysteresisRLS(SAMPLE_RATE, initial_model=START, **options)
    return estimator.run(u, x).theta[-1]


def ekf(u: FloatArray, x: FloatArray, estimator: Any) -> FloatArray:
    """(alpha, beta, gamma) at the end of a run."""
    estimator.run(u, x)
    return np.asarray(estimator.theta)


def padasip_rls(u: FloatArray, x: FloatArray) -> FloatArray:
    """Learn from unfiltered differences with padasip's adapt, one call a sample."""
    import padasip

    learner = padasip.filters.FilterRLS(3, mu=float(np.exp(-1.0 / (MEMORY * SAMPLE_RATE))), w="zeros")
    for k in range(1, u.size):
        du = u[k] - u[k - 1]
        phi = np.array([-0.5 * (x[k] + x[k - 1]) * abs(du), du, 0.5 * (u[k] + u[k - 1]) * abs(du)])
        learner.adapt(x[k] - x[k - 1], phi)
    return np.asarray(learner.w)


def bank_scaling(c: Reference, samples: int, rounds: int) -> list[dict[str, Any]]:
    """Nanoseconds per channel and sample against channels and threads, the C bank's, and the default's.

    K rows for N channels, so that K N is about `samples`; but at least 20 ms of signal: what a bank does once
    for every channel, whatever the number of rows, would be a tenth of 4 ms.
    """
    shortest = min(samples // 64, int(0.02 * SAMPLE_RATE))
    settings = rls_settings(SAMPLE_RATE, START, MEMORY, NOISE, CUTOFF, True)
    paper = pz.HysteresisRLS(SAMPLE_RATE, initial_model=START, memory=MEMORY, errors=False)
    usual = pz.HysteresisRLS(SAMPLE_RATE, initial_model=START, errors=False)
    found = []
    for channels in (64, 256, 1024, 8192):
        K = max(shortest, samples // channels)
        _, u, x = record(K)
        u, x = (np.ascontiguousarray(np.tile(v[:, None], (1, channels))) for v in (u, x))
        banks = {
            name: pz.EstimatorBank(estimator, channels, threads=threads)
            for name, estimator, threads in (("1", paper, 1), ("2", paper, 2), ("default, 2", usual, 2))
        }

        def go(bank: pz.EstimatorBank, u: FloatArray = u, x: FloatArray = x, K: int = K) -> None:
            bank.reset()
            bank.run(u, x, every=K)

        work: dict[str, Work] = {name: (lambda bank=bank: go(bank)) for name, bank in banks.items()}
        work["C"] = lambda u=u, x=x: c.bank(u, x, settings)
        seconds = interleaved(work, rounds, time.perf_counter)
        apart = float(np.max(np.abs(banks["2"].theta / c.bank(u, x, settings) - 1.0)))
        found.append(
            {"channels": channels, "samples": K, "difference_from_C": apart}
            | {name: float(1e9 * np.median(values) / u.size) for name, values in seconds.items()}
        )
    return found


def verdict(row: dict[str, Any]) -> dict[str, Any]:
    """Row with whether its figure is within the target."""
    at_least = row.get("at_least", False)
    met = row["figure"] >= row["target"] if at_least else row["figure"] <= row["target"]
    return {**row, "met": bool(met)}


def measure(samples: int, rounds: int, slow: int, turns: int) -> dict[str, Any]:
    """All figures."""
    c = Reference()
    r, u, x = record(samples)
    off, on = (rls_settings(SAMPLE_RATE, START, MEMORY, NOISE, CUTOFF, flag) for flag in (False, True))
    inverse = np.array([TRUE.a, TRUE.b, TRUE.c, 0.0, 0.0])
    inverse[3:] = -100.0, 100.0
    limits = pz.VoltageLimits(-100.0, 100.0)
    thresholds = np.linspace(1.0, 35.0, 12)
    tuning = [0.99995, NOISE**2, 0.01, 1.0, *thresholds]
    plays = np.array([*tuning, *np.ones(14)])
    decays = np.exp(-1.0 / (SAMPLE_RATE * np.array([0.01, 0.1, 1.0])))
    bent_plays = np.array([*tuning, -12.0, 12.0, *decays])
    exported = {
        "policies off": Exported(
            pz.HysteresisRLS(SAMPLE_RATE, initial_model=START, memory=MEMORY, policies=(), errors=False)
        ),
        "default": Exported(pz.HysteresisRLS(SAMPLE_RATE, initial_model=START, errors=False)),
    }
    work: dict[str, Work] = {
        "C, RLS": lambda: c.rls(u, x, off)[-1],
        "C, RLS, bound and dead zone": lambda: c.rls(u, x, on)[-1],
        "HysteresisRLS, policies off": lambda: rls(u, x, memory=MEMORY, policies=(), errors=False),
        "HysteresisRLS, the paper's": lambda: rls(u, x, memory=MEMORY, errors=False),
        "HysteresisRLS, default": lambda: rls(u, x, errors=False),
        "HysteresisRLS, policies off, standard errors": lambda: rls(u, x, memory=MEMORY, policies=()),
        "HysteresisRLS, default, standard errors": lambda: rls(u, x),
        "exported C, policies off": lambda: exported["policies off"](u, x)[-1, :3],
        "exported C, default": lambda: exported["default"](u, x)[-1],
        "C, EKF": lambda: c.ekf(u, x, ekf_settings(SAMPLE_RATE, START))[-1],
        "HysteresisEKF": lambda: ekf(u, x, pz.HysteresisEKF(SAMPLE_RATE, initial_model=START)),
        "C, inverse": lambda: c.inverse(r, inverse)[-1:],
        "InverseCompensator": lambda: pz.InverseCompensator(TRUE, limits=limits).run(r)[-1:],
        "C, 12 plays": lambda: c.plays(u, x, plays)[-1],
        "C, 12 plays, bends, creep": lambda: c.bent_plays(u, x, bent_plays)[-1],
        "PrandtlIshlinskiiRLS": lambda: (
            pz.PrandtlIshlinskiiRLS(SAMPLE_RATE, thresholds=12).run(u, x).theta[-1]
        ),
        "PrandtlIshlinskiiRLS, no bends, no creep": lambda: (
            pz.PrandtlIshlinskiiRLS(SAMPLE_RATE, thresholds=12, bends=0, creep=()).run(u, x).theta[-1]
        ),
    }
    seconds = interleaved(work, rounds)
    outcome = {name: np.asarray(function()).tolist() for name, function in work.items()}
    s = ekf_outcome = outcome["C, EKF"]
    outcome["C, EKF"] = [s[1], s[3] - s[2], s[1] * ekf_outcome[3]]
    times = {name: float(1e9 * np.median(values) / samples) for name, values in seconds.items()}

    def against(name: str, peer: str) -> float:
        return float(np.median(seconds[name] / seconds[peer]))

    u_slow, x_slow = u[:slow], x[:slow]
    peers = interleaved(
        {
            "filterpy EKF": lambda: ekf(u_slow, x_slow, pz.FilterPyEKF(SAMPLE_RATE, initial_model=START)),
            "padasip RLS": lambda: padasip_rls(u_slow, x_slow),
        },
        max(1, min(rounds, 3)),
    )
    for name, values in peers.items():
        times[name] = float(1e9 * np.median(values) / slow)
    theirs = ekf(u_slow, x_slow, pz.FilterPyEKF(SAMPLE_RATE, initial_model=START))
    ours = ekf(u_slow, x_slow, pz.HysteresisEKF(SAMPLE_RATE, initial_model=START, project=False))
    outcome["filterpy EKF"], outcome["padasip RLS"] = theirs.tolist(), padasip_rls(u_slow, x_slow).tolist()
    estimator = pz.HysteresisRLS(SAMPLE_RATE, initial_model=START, memory=MEMORY)
    estimator.step(0.0, 0.0)
    disturbed = disturbances()
    ring_estimator, ring_inverse = estimator.copy(), pz.InverseCompensator(TRUE)

    def turn(reference: float, displacement: float) -> None:
        ring_estimator.step(ring_inverse.step(reference), displacement)

    live = calls(
        {
            "step": Calls(estimator.step, (u, x), max(samples, turns // 10)),
            "ring": Calls(turn, (r, x), turns),
            "ring_without_gc": Calls(turn, (r, x), max(samples, turns // 10), collect=False),
        }
    )
    single, ring = live["step"], live["ring"]
    signal = pz.signals.triangle(5.0, 5.0, 5, SAMPLE_RATE)

    def track() -> Any:
        return pz.track(
            signal,
            stage=pz.PaperStage(SAMPLE_RATE),
            compensator=pz.InverseCompensator(START),
            estimator=pz.HysteresisRLS(SAMPLE_RATE),
        )

    tracked = interleaved({"track": track}, max(1, min(rounds, 5)))["track"]
    bank = bank_scaling(c, 16 * samples, max(1, rounds // 3))
    began = cold()
    rows = [
        {"what": "HysteresisRLS.run, policies off, times C", "target": 1.3,
         "figure": against("HysteresisRLS, policies off", "C, RLS")},
        {"what": "HysteresisRLS.run, the paper's policies, times C", "target": 3.0,
         "figure": against("HysteresisRLS, the paper's", "C, RLS, bound and dead zone")},
        {"what": "HysteresisRLS.run, default policies (memory='period'), times C", "target": 3.0,
         "figure": against("HysteresisRLS, default", "C, RLS, bound and dead zone")},
        {"what": "HysteresisRLS.run, policies off, times the same estimator exported to C", "target": 1.3,
         "figure": against("HysteresisRLS, policies off", "exported C, policies off")},
        {"what": "HysteresisRLS.run, default policies, times the same estimator exported to C", "target": 1.3,
         "figure": against("HysteresisRLS, default", "exported C, default")},
        {"what": "HysteresisRLS.run, policies off, standard errors too, times C", "target": 1.3,
         "figure": against("HysteresisRLS, policies off, standard errors", "C, RLS")},
        {"what": "HysteresisRLS.run, default policies, standard errors too, times C", "target": 3.0,
         "figure": against("HysteresisRLS, default, standard errors", "C, RLS, bound and dead zone")},
        {"what": "HysteresisEKF.run, times C", "target": 1.5, "figure": against("HysteresisEKF", "C, EKF")},
        {"what": "HysteresisEKF.run, times faster than filterpy", "target": 1000.0, "at_least": True,
         "figure": times["filterpy EKF"] / times["HysteresisEKF"]},
        {"what": "step(u, x) from Python, median [µs]", "target": 1.0, "figure": 1e-3 * single["median"]},
        {"what": "step(u, x) from Python, 99.9 % [µs]", "target": 5.0, "figure": 1e-3 * single["p99.9"]},
        {"what": "estimator and inverse, one turn, median [µs]", "target": 2.5,
         "figure": 1e-3 * ring["median"]},
        {"what": "turns within 20 µs [%]", "target": 99.99, "at_least": True,
         "figure": 100.0 * ring["within_20us"]},
        {"what": "InverseCompensator.run, times C", "target": 1.5,
         "figure": against("InverseCompensator", "C, inverse")},
        {"what": "track() on PaperStage, times real time", "target": 30.0, "at_least": True,
         "figure": len(signal) / SAMPLE_RATE / float(np.median(tracked))},
        {"what": "EstimatorBank, slowest of 64-8192 channels [ns per channel and sample]", "target": 10.0,
         "figure": max(entry["2"] for entry in bank)},
        {"what": "PrandtlIshlinskiiRLS.run, 12 thresholds, times C that learns as much", "target": 2.0,
         "figure": against("PrandtlIshlinskiiRLS", "C, 12 plays, bends, creep")},
        {"what": "the same without bends and creep, times C without them", "target": 2.0,
         "figure": against("PrandtlIshlinskiiRLS, no bends, no creep", "C, 12 plays")},
        {"what": "PrandtlIshlinskiiRLS.run with bends and creep, times C without them", "target": 2.0,
         "figure": against("PrandtlIshlinskiiRLS", "C, 12 plays")},
        {"what": "import [s]", "target": 0.15, "figure": began["import"]},
        {"what": "first step, warm cache [s]", "target": 0.7, "figure": began["first step"]},
    ]  # fmt: skip
    pairs = (
        ("HysteresisRLS, policies off", "C, RLS"),
        ("HysteresisRLS, the paper's", "C, RLS, bound and dead zone"),
        ("HysteresisRLS, policies off", "exported C, policies off"),
        ("HysteresisRLS, default", "exported C, default"),
        ("HysteresisEKF", "C, EKF"),
        ("InverseCompensator", "C, inverse"),
    )
    differences = {
        f"{one} and {other}": float(np.max(np.abs(np.array(outcome[one]) / np.array(outcome[other]) - 1.0)))
        for one, other in pairs
    }
    differences["filterpy EKF"] = float(np.max(np.abs(ours / theirs - 1.0)))
    differences["EstimatorBank"] = max(entry["difference_from_C"] for entry in bank)
    return {
        **origin(),
        "compiler": " ".join(COMMAND),
        "samples": samples,
        "rounds": rounds,
        "targets": [verdict(row) for row in rows],
        "nanoseconds_per_sample": times,
        "outcome": outcome,
        "relative_difference": differences,
        **live,
        "disturbances": disturbed,
        "bank": bank,
        "cold": began,
        "scaling": scaling(rounds),
    }


def scaling(rounds: int) -> dict[str, list[list[float]]]:
    """Cost per sample [ns] against samples, and against the number of parameters."""
    by_samples, by_parameters = [], []
    for samples in (100, 1000, 10_000, 100_000):
        _, u, x = record(samples)
        seconds = interleaved({"run": lambda u=u, x=x: rls(u, x, memory=MEMORY)}, rounds)["run"]
        by_samples.append([samples, float(1e9 * np.median(seconds) / samples)])
    rng = np.random.default_rng(0)
    for n in (2, 3, 4, 6, 8, 12, 16):
        learner, phi = pz.RecursiveLeastSquares(n), rng.standard_normal(n)

        def updates(learner: Any = learner, phi: FloatArray = phi) -> None:
            for _ in range(1000):
                learner.update(1.0, phi)

        seconds = interleaved({"update": updates}, rounds)["update"]
        by_parameters.append([n, float(1e6 * np.median(seconds))])
    return {"samples": by_samples, "parameters": by_parameters}


def draw(document: dict[str, Any], path: Path) -> None:
    """Cost against samples, parameters and channels."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.2), layout="constrained")
    axes = figure.subplots(1, 3)
    for place, name, label in ((0, "samples", "samples of a run"), (1, "parameters", "parameters, update()")):
        axes[place].loglog(*np.array(document["scaling"][name]).T, "o-")
        axes[place].set(xlabel=label, ylabel="ns per sample")
    axes[1].set_xscale("linear")  # too few to need decades
    axes[1].set_yscale("linear")
    axes[1].set_ylim(bottom=0.0)
    channels = [entry["channels"] for entry in document["bank"]]
    for name, label in (("1", "one thread"), ("2", "two threads"), ("C", "C, one thread")):
        axes[2].semilogx(channels, [entry[name] for entry in document["bank"]], "o-", label=label)
    axes[2].set(xlabel="channels of a bank", ylabel="ns per channel and sample")
    axes[2].set_ylim(bottom=0.0)
    axes[2].legend(loc="lower left")
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path, dpi=110)


def main() -> int:
    """Print the table; 1 if a result differs from its peer's."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, default=100_000, help="length of the record (default 100000)")
    parser.add_argument("--rounds", type=int, default=15, help="rounds, of which the median counts")
    parser.add_argument("--slow", type=int, default=5_000, help="samples for filterpy and padasip")
    parser.add_argument("--turns", type=int, default=10_000_000, help="turns of the ring from Python")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to this file too")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw cost against size into this file")
    arguments = parser.parse_args()
    document = measure(
        arguments.samples, arguments.rounds, min(arguments.slow, arguments.samples), arguments.turns
    )
    about = {**document["machine"], **document["versions"]}
    print(*(f"{key:>10}: {value}" for key, value in about.items()), sep="\n")
    for name, value in document["nanoseconds_per_sample"].items():
        shown = ", ".join(f"{number:.4g}" for number in document["outcome"].get(name, [])[:4])
        print(f"{name:<40}{value:12.1f} ns   {shown}")
    print(f"\n{'':<72}{'figure':>10}{'target':>10}")
    for row in document["targets"]:
        print(
            f"{row['what']:<72}{row['figure']:10.4g}{row['target']:10.4g}"
            f"  {'met' if row['met'] else 'missed'}"
        )
    if arguments.json is not None:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        write_text(arguments.json, json.dumps(document, indent=2) + "\n")
    if arguments.figure is not None:
        draw(document, arguments.figure)
    differences = document["relative_difference"]
    apart = [f"{name} {value:.1e}" for name, value in differences.items() if not value <= LARGEST_DIFFERENCE]
    if apart:
        print(f"\nnot the result of its peer: {', '.join(apart)}", file=sys.stderr)
    return 1 if apart else 0


if __name__ == "__main__":
    sys.exit(main())
