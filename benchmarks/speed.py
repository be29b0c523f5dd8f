"""Compare the library's speed with C written by hand, its own export to C, filterpy and padasip.

All that is compared runs in the same rounds, one after the other; times are medians over the rounds, ratios
medians of the ratios within a round. Ours must come to its peer's result. Needs gcc, and a quiet machine.

    python benchmarks/speed.py [--samples N] [--slow N] [--rounds N] [--turns N] [--json FILE] [--figure FILE]

It takes some minutes.
"""

import itertools
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import peers
import typer
from peers import MEMORY, NOISE, SAMPLE_RATE, START, FloatArray

import piezoest as pz
from piezoest._files import save_figure
from piezoest.bench.figures import new_figure
from piezoest.bench.origin import origin, put
from piezoest.policies import Forgetting

TRUE = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
LIMITS = pz.VoltageLimits(-100.0, 100.0)
LARGEST_DIFFERENCE = 1e-6
LATE = 20_000  # [ns], a sample at 50 kHz
Work = Callable[[], Any]
Row = dict[str, Any]


@dataclass(frozen=True)
class Pair:
    """One of ours and who it is compared with: how many times as long it may take, and what is not alike."""

    ours: str
    peer: str
    at_most: float | None
    peer_does: str
    is_same: bool = True  # whether both come to the same numbers


RLS, EKF, PLAYS = "HysteresisRLS.run", "HysteresisEKF.run", "PrandtlIshlinskiiRLS.run"
BARE_RLS, FREE_EKF = f"{RLS}, policies off", f"{EKF}, not projected"
BOUNDED, FILTERPY, PADASIP = "C, bound and dead zone", "filterpy's EKF, bare loop", "padasip's RLS, bare loop"
FAST = (
    Pair(BARE_RLS, "C, the bare law", 1.3, "less: no look for missing samples, no status"),
    Pair(f"{RLS}, the paper's", BOUNDED, 3.0, "less: no look for missing samples, no status"),
    Pair(f"{RLS}, default", "exported C", 1.3, "the same, compiled by gcc"),
    Pair(f"{RLS}, default", BOUNDED, 3.0, "less: no outliers, no level, no noise measured", False),
    Pair(f"{RLS}, default, with errors", "exported C", 1.3, "less: no standard errors"),
    Pair(EKF, "C, EKF", 1.5, "less: P - K S K', not Joseph's form; no projection, no checks"),
    Pair("InverseCompensator.run", "C, inverse", 1.5, "the same series; less: no look for NaN, no count"),
    Pair(f"{PLAYS}, plain", "C, 12 plays", 2.0, "more: learns at each sample; less: a fixed grid", False),
    Pair(PLAYS, "C, 12 plays, bends, creep", 2.0, "as in the line above", False),
)
SLOW = (
    Pair(FREE_EKF, FILTERPY, 0.001, "less: no look for missing samples; it keeps copies of x and P"),
    Pair("HysteresisEKF.step, not projected", FILTERPY, None, "the same peer; ours called from Python, too"),
    Pair(FREE_EKF, "FilterPyEKF.run", None, "filterpy with this library's checks and histories"),
    Pair(FREE_EKF, "filterpy's UKF, bare loop", None, "more: nine sigma points, no Jacobian", False),
    Pair("RecursiveLeastSquares.update", PADASIP, None, "less: no checks; both are called from Python"),
    Pair(BARE_RLS, PADASIP, None, "less: is given regressors, unfiltered", False),
)


our_rls = partial(pz.HysteresisRLS, SAMPLE_RATE, initial_model=START)
our_ekf = partial(pz.HysteresisEKF, SAMPLE_RATE, initial_model=START)
our_plays = partial(pz.PrandtlIshlinskiiRLS, SAMPLE_RATE, thresholds=12)


def record(samples: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Reference, voltage and displacement of a triangle."""
    r = np.asarray(pz.signals.triangle(5.0, 5.0, samples * 5.0 / SAMPLE_RATE, SAMPLE_RATE)).copy()
    u = pz.InverseCompensator(TRUE).run(r)
    return r, u, TRUE.simulate(u) + np.random.default_rng(0).normal(scale=NOISE, size=r.size)


def learnt(estimator: Any, u: FloatArray, x: FloatArray) -> FloatArray:
    """Parameters at the end of a run, its history kept."""
    return np.asarray(estimator.run(u, x).theta[-1])


def stepped(estimator: Any, u: FloatArray, x: FloatArray) -> FloatArray:
    """Parameters after a step from Python for each sample."""
    step = estimator.step
    for voltage, reading in zip(u.tolist(), x.tolist(), strict=True):
        step(voltage, reading)
    return np.asarray(estimator.theta)


def updated(z: FloatArray, phi: FloatArray) -> FloatArray:
    """Parameters that `RecursiveLeastSquares` learns with padasip's settings."""
    learner = pz.RecursiveLeastSquares(3, P=peers.VARIANCE, policies=(Forgetting(MEMORY * SAMPLE_RATE),))
    for output, regressor in zip(z.tolist(), phi, strict=True):
        learner.update(output, regressor)
    return learner.theta


def fast_work(c: peers.Reference, r: FloatArray, u: FloatArray, x: FloatArray) -> dict[str, Work]:
    """What takes nanoseconds a sample, by name."""
    off, on = peers.rls_settings(bounded=False), peers.rls_settings(bounded=True)
    tuning = [0.99995, NOISE**2, 0.01, 1.0, *np.linspace(1.0, 35.0, 12)]
    plays = np.array([*tuning, *np.ones(14)])
    decays = np.exp(-1.0 / (SAMPLE_RATE * np.array([0.01, 0.1, 1.0])))
    bent_plays = np.array([*tuning, -12.0, 12.0, *decays])
    inverse = np.array([TRUE.a, TRUE.b, TRUE.c, LIMITS.minimum, LIMITS.maximum])
    kalman = peers.ekf_settings()
    exported = peers.Exported(our_rls(errors=False))
    return {
        BARE_RLS: lambda: learnt(our_rls(memory=MEMORY, policies=(), errors=False), u, x),
        "C, the bare law": lambda: c.run("rls", 3, off, u, x)[-1],
        f"{RLS}, the paper's": lambda: learnt(our_rls(memory=MEMORY, errors=False), u, x),
        BOUNDED: lambda: c.run("rls", 3, on, u, x)[-1],
        f"{RLS}, default": lambda: learnt(our_rls(errors=False), u, x),
        f"{RLS}, default, with errors": lambda: learnt(our_rls(), u, x),
        "exported C": lambda: exported(u, x)[-1],
        EKF: lambda: learnt(our_ekf(), u, x),
        "C, EKF": lambda: peers.loop_parameters(c.run("ekf", 4, kalman, u, x)[-1]),
        "InverseCompensator.run": lambda: pz.InverseCompensator(TRUE, limits=LIMITS).run(r)[-1:],
        "C, inverse": lambda: c.run("inverse", 1, inverse, r)[-1],
        f"{PLAYS}, plain": lambda: learnt(our_plays(bends=0, creep=()), u, x),
        "C, 12 plays": lambda: c.run("plays", 14, plays, u, x)[-1],
        PLAYS: lambda: learnt(our_plays(), u, x),
        "C, 12 plays, bends, creep": lambda: c.run("bent_plays", 43, bent_plays, u, x)[-1],
    }


def slow_work(u: FloatArray, x: FloatArray) -> dict[str, Work]:
    """What takes microseconds a sample, and ours on the same short record."""
    z, phi = peers.regression(u, x)
    return {
        FREE_EKF: lambda: learnt(our_ekf(project=False), u, x),
        "HysteresisEKF.step, not projected": lambda: stepped(our_ekf(project=False), u, x),
        "FilterPyEKF.run": lambda: learnt(pz.FilterPyEKF(SAMPLE_RATE, initial_model=START), u, x),
        FILTERPY: lambda: peers.loop_parameters(peers.filterpy_ekf(u, x)),
        "filterpy's UKF, bare loop": lambda: peers.loop_parameters(peers.filterpy_ukf(u, x)),
        BARE_RLS: lambda: learnt(our_rls(memory=MEMORY, policies=(), errors=False), u, x),
        "RecursiveLeastSquares.update": lambda: updated(z, phi),
        PADASIP: lambda: peers.padasip_rls(z, phi),
    }


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


def compared(pairs: tuple[Pair, ...], work: dict[str, Work], samples: int, rounds: int) -> list[Row]:
    """Rows of the table: times, ratio, and how far the results of both are apart."""
    seconds = interleaved(work, rounds)
    rows = []
    for pair in pairs:
        ours, peer = seconds[pair.ours], seconds[pair.peer]
        ns, peer_ns = (1e9 * float(np.median(each)) / samples for each in (ours, peer))
        times = {"ns": ns, "peer_ns": peer_ns, "ratio": float(np.median(ours / peer)), "difference": None}
        if pair.is_same:
            times["difference"] = float(np.max(np.abs(work[pair.ours]() / work[pair.peer]() - 1.0)))
        rows.append(asdict(pair) | times)
    return rows


def bank(c: peers.Reference, samples: int, rounds: int) -> list[Row]:
    """Nanoseconds per channel and sample of banks, and of C's.

    At least 20 ms of signal: what a bank does once for every channel would be a tenth of 4 ms.
    """
    shortest = min(samples // 64, int(0.02 * SAMPLE_RATE))
    settings = peers.rls_settings(bounded=True)
    found = []
    for channels in (64, 1024, 8192):
        K = max(shortest, samples // channels)
        _, u, x = (np.ascontiguousarray(np.tile(v[:, None], (1, channels))) for v in record(K))
        banks = {
            name: pz.EstimatorBank(our_rls(errors=False, **options), channels, threads=threads)
            for name, options, threads in (
                ("one thread", {"memory": MEMORY}, 1),
                ("two threads", {"memory": MEMORY}, 2),
                ("the default, two threads", {}, 2),
            )
        }

        def go(bank: pz.EstimatorBank, u: FloatArray = u, x: FloatArray = x) -> None:
            bank.reset()
            bank.run(u, x, every=len(u))

        work: dict[str, Work] = {name: partial(go, each) for name, each in banks.items()}
        work["C, one thread"] = partial(c.bank, u, x, settings)
        seconds = interleaved(work, rounds, time.perf_counter)
        apart = float(np.max(np.abs(banks["two threads"].theta / c.bank(u, x, settings) - 1.0)))
        times = {name: float(1e9 * np.median(values) / u.size) for name, values in seconds.items()}
        found.append({"channels": channels, "samples": K, "difference": apart, "ns": times})
    return found


def single_calls(function: Callable[..., Any], columns: tuple[FloatArray, ...], count: int) -> Row:
    """Times of single calls [ns], less the clock's own; a call is late after a sample at 50 kHz."""
    clock = time.perf_counter_ns
    rows = itertools.cycle(list(zip(*(column.tolist() for column in columns), strict=True)))
    times = np.empty(count)
    began_all = clock()
    for k, row in enumerate(itertools.islice(rows, count)):
        began = clock()
        function(*row)
        times[k] = clock() - began
    seconds = 1e-9 * (clock() - began_all)
    own = float(np.median([-(clock() - clock()) for _ in range(1000)]))
    median, rare = np.percentile(times - own, [50.0, 99.9]).tolist()
    return {"median": median, "p99.9": rare, "late_per_second": int(np.sum(times > LATE)) / seconds}


def live(r: FloatArray, u: FloatArray, x: FloatArray, turns: int) -> dict[str, Row]:
    """Single calls from Python, as a live loop makes them, and of a function that does nothing."""
    estimator, inverse = our_rls(memory=MEMORY), pz.InverseCompensator(TRUE)
    estimator.step(0.0, 0.0)

    def turn(reference: float, displacement: float) -> None:
        estimator.step(inverse.step(reference), displacement)

    controller = pz.AdaptiveFeedforward(SAMPLE_RATE, limits=pz.VoltageLimits(-50.0, 100.0))
    again, stage = controller.copy(), pz.PaperStage(SAMPLE_RATE, seed=0)
    measured = pz.track(r, stage=stage, controller=controller, sample_rate=SAMPLE_RATE).measured

    def whole(reference: float, displacement: float) -> None:
        again.learn(again.step(reference), displacement)

    return {
        "HysteresisRLS.step": single_calls(estimator.step, (u, x), turns),
        "InverseCompensator.step and HysteresisRLS.step": single_calls(turn, (r, x), turns),
        "AdaptiveFeedforward.step and learn": single_calls(whole, (r, measured), turns),
        "a function that does nothing": single_calls(lambda r, x: None, (r, x), turns),
    }


def in_seconds(rounds: int) -> dict[str, float]:
    """Seconds of what happens once, the first three in new processes with a warm cache."""
    programs = {
        "import": "import piezoest as pz",
        "first step": "import piezoest as pz; pz.HysteresisRLS(5e4).step(0.0, 0.0)",
        "warmup": "import piezoest as pz; pz.warmup()",
    }
    found = {}
    for name, program in programs.items():
        code = f"import time; s = time.perf_counter(); {program}; print(time.perf_counter() - s)"
        command = [sys.executable, "-c", code]
        texts = [subprocess.run(command, capture_output=True, check=True).stdout for _ in range(1 + rounds)]
        found[name] = float(np.median([float(text) for text in texts[1:]]))  # the first may have compiled
    signal = pz.signals.triangle(5.0, 5.0, 5, SAMPLE_RATE)

    def track() -> Any:
        stage, inverse = pz.PaperStage(SAMPLE_RATE), pz.InverseCompensator(START)
        return pz.track(signal, stage=stage, compensator=inverse, estimator=pz.HysteresisRLS(SAMPLE_RATE))

    found["one second of track()"] = float(np.median(interleaved({"track": track}, rounds)["track"]))
    return found


def draw(rows: list[Row], path: Path) -> None:
    """Time of a sample, of ours and of its peers."""
    times = {row["ours"]: (row["ns"], "#D55E00") for row in reversed(rows)}
    times |= {row["peer"]: (row["peer_ns"], "0.6") for row in reversed(rows)}
    names = sorted(times, key=lambda name: -times[name][0])
    figure = new_figure(6.0, 0.27 * len(names) + 0.6)
    axes = figure.subplots()
    axes.barh(names, [times[name][0] for name in names], color=[times[name][1] for name in names])
    axes.set(xscale="log", xlabel="ns per sample; of this library in colour")
    save_figure(figure, path, dpi=130)


def main(
    samples: int = 100_000, slow: int = 30_000, rounds: int = 15, turns: int = 2_000_000,
    json: Path | None = None, figure: Path | None = None,
) -> None:  # fmt: skip
    """Compare the speed; fails if a result differs from its peer's.

    SAMPLES in the record, SLOW of them for filterpy and padasip; ROUNDS, of which the median counts; TURNS
    single calls from Python. All figures are written to JSON, the times drawn into FIGURE.
    """
    few = max(1, rounds // 5)
    c, (r, u, x) = peers.Reference(), record(samples)
    began, load = time.perf_counter(), os.getloadavg()[0]
    against_c = compared(FAST, fast_work(c, r, u, x), samples, rounds)
    against_python = compared(SLOW, slow_work(u[:slow], x[:slow]), slow, few)
    rows = against_c + against_python
    for row in rows:
        apart = "" if row["difference"] is None else f"  {row['difference']:.0e} apart"
        print(
            f"{row['ours']:<40}{row['ns']:8.1f} ns  {row['peer']:<28}{row['peer_ns']:9.1f} ns"
            f"  {row['ratio']:.3g} times as long, asked {row['at_most'] or '-'}{apart}"
        )
    document = {
        "suite": "speed", "compiler": " ".join(peers.COMMAND), "samples": samples, "slow": slow,
        "rounds": rounds, "against_c": against_c, "against_python": against_python,
        "bank": bank(c, 16 * samples, few), "calls": live(r, u, x, turns), "once": in_seconds(few),
        "load": load, **origin(began),
    }  # fmt: skip
    for name in ("bank", "calls", "once", "machine", "versions"):
        print(f"{name}: {document[name]}")
    if json is not None:
        put(document, json)
    if figure is not None:
        draw(rows, figure)
    if not max(each["difference"] or 0.0 for each in rows + document["bank"]) <= LARGEST_DIFFERENCE:
        sys.exit("not the result of its peer")


if __name__ == "__main__":
    typer.run(main)
