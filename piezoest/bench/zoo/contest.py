"""Whether the controller is as good as one with the best of its estimators, on each stage and reference.

The rigs are healthy and ideal: what is left of the error is what a model does not know of the hysteresis.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from piezoest.bench.origin import json_safe
from piezoest.bench.store import Row
from piezoest.bench.zoo.contenders import CANDIDATES
from piezoest.bench.zoo.families import FAMILIES
from piezoest.bench.zoo.references import SHAPES
from piezoest.bench.zoo.summary import failures, grouped
from piezoest.bench.zoo.tasks import Task, runs

FLOOR, ALLOWED = 0.001, 1.3  # of the amplitude; settled error over that of the best single estimator
IDEAL: dict[str, Any] = {
    "sample_rate": 10_000.0, "frequency": 20.0, "mechanics": "none", "delay": 0, "noise": 0.0,
    "resolution": 0.0, "volts": 0.0, "slew": float("inf"), "creep": 0.0, "hum": 0.0, "drift": 0.0,
    "fault": "none", "block": 10,
}  # fmt: skip
REFERENCES = tuple(kind for kind in SHAPES if kind != "beyond")  # there the limits decide


def contest(controller: str, seeds: range) -> list[Task]:
    """All runs of a controller, and of the default one with each estimator alone."""
    return [
        task
        for name in (controller, *CANDIDATES)
        for family in FAMILIES
        for reference in REFERENCES
        for task in runs(name, seeds, {**IDEAL, "family": family, "reference": reference})
    ]


def summarise_contest(rows: Iterable[Row], controller: str) -> dict[str, Any]:
    """Compare settled errors in each cell with those of the best single estimator."""
    rows = list(rows)
    cells = grouped(rows, "family", "reference", of=partial(_compared, controller))
    ratios = [cell["ratio"] for cell in cells]
    return {
        "runs": len(rows),
        "failures": failures(rows),
        "seeds": len({row["seed"] for row in rows}),
        "allowed": ALLOWED,
        "floor": FLOOR,
        "cells": cells,
        "kept": sum(ratio is not None and ratio <= ALLOWED for ratio in ratios),
    }


def _compared(controller: str, rows: Sequence[Row]) -> dict[str, Any]:
    errors: dict[str, list[float]] = {}
    for row in rows:
        settled = row.get("settled")
        relative = np.inf if settled is None else max(settled / row["amplitude"], FLOOR)
        errors.setdefault(row["controller"], []).append(relative)
    medians = {name: float(np.median(each)) for name, each in errors.items()}
    own = medians[controller]
    best = min((name for name in CANDIDATES if name in medians), key=medians.__getitem__)
    ratio = own / medians[best] if np.isfinite(own) else np.inf
    found = {"settled": own, "best": best, "best_settled": medians[best], "ratio": ratio}
    return json_safe(found)
