"""What a Prandtl-Ishlinskii estimator gains over the paper's, on two simulated stages and a recording.

    python benchmarks/beyond_the_paper.py --json docs/data/beyond.json

Both stages stand side by side throughout: `PaperStage` is itself a Prandtl-Ishlinskii operator with
creep, of the estimator's own family; `PreisachStage` is of nobody's. Each case is run with several
seeds, over the cores; of each number the median and the worst are kept.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from beyond_criteria import criteria
from beyond_runs import CASES, RATE, START, Job, Numbers, jobs, play

import piezoest as pz
from piezoest.bench.adaptation import json_safe
from piezoest.bench.executors import in_processes
from piezoest.bench.origin import origin, put

SEEDS = 5
RECORDING_START = pz.ColemanHodgdon(0.5, 8.0, 6.0)
PERIOD = 200  # samples of the recording


def summarise(results: Iterable[tuple[Job, Numbers]]) -> list[dict[str, Any]]:
    """One row for each case and stage, in the order of `CASES`: of each number median, worst, mean, sum."""
    groups: dict[tuple[str, str], list[Numbers]] = {}
    for job, numbers in sorted(results, key=lambda each: CASES[each[0].section].index(each[0].case)):
        groups.setdefault((job.case, job.stage), []).append(numbers)
    return [
        {
            "case": case,
            "stage": stage,
            "numbers": {name: _spread([each[name] for each in some]) for name in some[0]},
        }
        for (case, stage), some in sorted(groups.items(), key=lambda each: list(groups).index(each[0]))
    ]


def _spread(values: list[float]) -> dict[str, float]:
    # No mean of two with an infinite neighbour.
    middle = float(np.quantile(values, 0.5, method="inverted_cdf"))
    return {"median": middle, "worst": max(values), "mean": sum(values) / len(values), "sum": sum(values)}


def recording(folder: Path) -> dict[str, float]:
    """Rms errors [µm] of a model learnt in one pass over recorded data, the sensor one sample late."""
    model_file, test_file = (pz.read_record(folder / name) for name in ("model_1hz.csv", "test_1hz.csv"))
    u, x, rate = test_file.voltage, test_file.displacement, test_file.sample_rate
    late = np.concatenate([u[:1], u[:-1]])

    def learnt(voltage: Any, displacement: Any) -> pz.PrandtlIshlinskiiRLS:
        estimator = pz.PrandtlIshlinskiiRLS(rate, initial_model=RECORDING_START, delay=1.0)
        estimator.run(voltage, displacement)
        return estimator

    def free(estimator: pz.PrandtlIshlinskiiRLS, stop: int) -> Any:
        model = estimator.model
        assert isinstance(model, pz.PrandtlIshlinskii)
        return x[:stop] - model.simulate(late[:stop])

    middle = u.size // 2
    first = free(learnt(u[:middle], x[:middle]), u.size)
    other = free(learnt(model_file.voltage, model_file.displacement), u.size)
    estimator = learnt(u[: 5 * PERIOD], x[: 5 * PERIOD])
    ahead = []
    for start in range(5 * PERIOD, u.size, PERIOD):
        stop = min(start + PERIOD, u.size)
        ahead.append(free(estimator, stop)[start:])
        estimator.run(u[start:stop], x[start:stop])
    rms = {
        "held_out_half_um": first[middle:],
        "other_file_um": other,
        "other_file_without_mean_um": other - other.mean(),
        "one_period_ahead_um": np.concatenate(ahead),
    }
    return {name: float(np.sqrt(np.mean(error**2))) for name, error in rms.items()}


def runs(section: str, seeds: int, processes: int | None) -> list[dict[str, Any]]:
    """Rows of a section, with its progress on stderr."""
    began, results, work = time.perf_counter(), [], jobs(section, seeds)
    for result in in_processes(play, work, processes):
        results.append(result)
        print(
            f"\r{section}: {len(results)} of {len(work)} runs, {time.perf_counter() - began:.0f} s",
            end="",
            file=sys.stderr,
            flush=True,
        )
    print(file=sys.stderr)
    return summarise(results)


def said(criterion: dict[str, Any]) -> str:
    """A criterion in a line."""
    mark = {True: "✓", False: "✗", None: "–"}[criterion["met"]]
    value = "never" if criterion["value"] is None else f"{criterion['value']:.4g}"
    side = "at least" if criterion["least"] else "at most"
    bound = "" if criterion["bound"] is None else f" ({side} {criterion['bound']:g})"
    return f"{mark} {criterion['where']}: {criterion['what']}: {value}{bound}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file to write")
    data = Path(os.environ.get("PIEZOEST_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data")
    parser.add_argument("--data", type=Path, default=data, help="folder of the recordings")
    names = ("recording", *CASES)
    parser.add_argument(
        "--only",
        nargs="*",
        choices=names,
        metavar="PART",
        help=f"of {', '.join(names)}; the file keeps its others",
    )
    parser.add_argument("--seeds", type=int, default=SEEDS, help="runs of each case, at most")
    parser.add_argument("--jobs", type=int, help="processes; default one for each core")
    given = parser.parse_args()
    folder = given.data / "discrete_backlash_operator"
    document: dict[str, Any] = {}
    if given.json and given.json.is_file():
        # Without the recordings, too, what was measured on them stays.
        document = json.loads(given.json.read_text(encoding="utf-8"))
    head = origin()
    document |= {**head, "conditions": {"sample_rate_Hz": RATE, "start": START.to_dict()}}
    parts = document.setdefault("parts", {})
    for name in given.only or names:
        began = time.perf_counter()
        if name == "recording":
            if not folder.is_dir():
                print(f"no recordings in {given.data}: their numbers stay as they are", file=sys.stderr)
                continue
            document[name] = recording(folder)
        else:
            document[name] = json_safe(runs(name, given.seeds, given.jobs))
        parts[name] = {
            "date": head["date"],
            "seeds": 1 if name == "recording" else len({job.seed for job in jobs(name, given.seeds)}),
            "seconds": round(time.perf_counter() - began, 1),
        }
    document["criteria"] = criteria(document)
    for criterion in document["criteria"]:
        print(said(criterion))
    if given.json:
        put(document, given.json)


if __name__ == "__main__":
    main()
