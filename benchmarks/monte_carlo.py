"""Look for divergence: thousands of random runs over memory, amplitude, frequency, noise and scenario.

A run diverges if its largest tracking error after the first period is above 1.5 times that of linear
feed-forward on an identical stage. Every run follows from its number alone. Lengths are in periods and a
period has always as many samples, so that a slow reference costs no more than a fast one.

    python benchmarks/monte_carlo.py [--runs N] [--jobs N] [--estimator NAME] [--file FILE]

Finished runs are appended to FILE; started again with it, the rest is done.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from piezoest.bench.adaptation import follow
from piezoest.bench.metrics import DIVERGED, measure
from piezoest.bench.origin import origin, put
from piezoest.bench.scenarios import SCENARIOS

MEMORY = (0.02, 5.0)  # s
AMPLITUDE = (0.5, 10.0)  # µm
FREQUENCY = (0.5, 20.0)  # Hz
NOISE = (1e-4, 3e-2)  # µm
PERIOD = 2000  # samples: 10 kHz at 5 Hz
BEFORE, AFTER = 6, 10
LONG_PERIODS = 4  # where a period of the errors is five of the wave's
REST, DRIFT = 20, 20  # periods of dwell and of drift
UPDATES = 50  # of the compensator's model, in a period
TUNED = "HysteresisRLS(memory={memory:.4g})"


def draw(number: int, estimator: str) -> dict[str, Any]:
    """Everything about a run, from its number; scenarios take turns."""
    rng = np.random.default_rng([number, 20120805])
    memory, amplitude, frequency, noise = (
        float(np.exp(rng.uniform(*np.log(span)))) for span in (MEMORY, AMPLITUDE, FREQUENCY, NOISE)
    )
    scenario = list(SCENARIOS)[number % len(SCENARIOS)]
    long = SCENARIOS[scenario].is_long
    return {
        "number": number,
        "scenario": scenario,
        "memory": memory,
        "estimator": estimator.format(memory=memory),
        "conditions": {
            "sample_rate": PERIOD * frequency,
            "amplitude": amplitude,
            "frequency": frequency,
            "noise": noise,
            "before": BEFORE,
            "updates": UPDATES,
            "after": LONG_PERIODS if long else AFTER,
            "rest": REST / frequency,
            # One per cent a second is the scenario; only its length is in periods.
            "drift": min(30.0, DRIFT / frequency),
        },
    }


def one(run: dict[str, Any]) -> dict[str, Any]:
    """Run it."""
    case = SCENARIOS[run["scenario"]].build(run["number"], **run["conditions"])
    linear = follow(case, None)
    try:
        metrics = measure(follow(case, run["estimator"]), linear, case)
    except Exception as error:
        return {**run, "failure": f"{type(error).__name__}: {error}", "diverged": True}
    return {
        **run,
        "run_ratio": metrics.run_ratio if math.isfinite(metrics.run_ratio) else None,
        "worst_ratio": metrics.worst_ratio if math.isfinite(metrics.worst_ratio) else None,
        "ratio": metrics.ratio if math.isfinite(metrics.ratio) else None,
        "diverged": metrics.diverged,
        "diverged_in_a_period": metrics.diverged_in_a_period,
        "settling_periods": metrics.settling_periods,
    }


def finished(path: Path | None, estimator: str) -> dict[int, dict[str, Any]]:
    """Runs that are in the file already, of the same estimator."""
    if path is None or not path.exists():
        return {}
    found = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            run = json.loads(line)
        except json.JSONDecodeError:
            continue  # the last line of a run that was killed
        if run == {**run, **draw(run["number"], estimator)}:
            found[run["number"]] = run
    return found


def results(todo: list[dict[str, Any]], jobs: int) -> Iterator[dict[str, Any]]:
    if jobs == 1:
        yield from map(one, todo)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(one, todo, chunksize=4)


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Divergences in all and by scenario, and the worst runs to look at."""
    return {
        "runs": len(runs),
        "diverged": sum(run["diverged"] for run in runs),
        "diverged_in_a_period": sum(run.get("diverged_in_a_period", True) for run in runs),
        "failures": sum("failure" in run for run in runs),
        "by_scenario": {
            name: sum(run["diverged"] for run in runs if run["scenario"] == name) for name in SCENARIOS
        },
        "worst": sorted(runs, key=lambda run: -(run.get("run_ratio") or math.inf))[:10],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--estimator", default=TUNED,
        help="{memory} stands for the memory drawn; default %(default)s. HysteresisRLS: the default one",
    )  # fmt: skip
    parser.add_argument("--file", type=Path, help="one run a line, to be resumed")
    parser.add_argument("--json", type=Path, help="summary")
    arguments = parser.parse_args()

    began = time.perf_counter()
    runs = {
        number: run
        for number, run in finished(arguments.file, arguments.estimator).items()
        if number < arguments.runs
    }
    if runs:
        print(f"{len(runs)} of {arguments.runs} are done already", file=sys.stderr)
    todo = [draw(n, arguments.estimator) for n in range(arguments.runs) if n not in runs]
    log = arguments.file.open("a", encoding="utf-8") if arguments.file else None
    try:
        for done, run in enumerate(results(todo, arguments.jobs), 1):
            runs[run["number"]] = run
            if log is not None:
                log.write(json.dumps(run, allow_nan=False) + "\n")
                log.flush()
            if done * 50 // len(todo) > (done - 1) * 50 // len(todo):
                diverged = sum(each["diverged"] for each in runs.values())
                seconds = time.perf_counter() - began
                print(f"{done} of {len(todo)}, {seconds:.0f} s; diverged: {diverged}", file=sys.stderr)
    finally:
        if log is not None:
            log.close()
    document = {
        "suite": "monte-carlo",
        **origin(began),
        "estimator": arguments.estimator,
        "diverged_above": DIVERGED,
        "spans": {"memory": MEMORY, "amplitude": AMPLITUDE, "frequency": FREQUENCY, "noise": NOISE},
        **summary([runs[number] for number in sorted(runs)]),
    }
    put(document, arguments.json)
    return 1 if document["diverged"] else 0


if __name__ == "__main__":
    sys.exit(main())
