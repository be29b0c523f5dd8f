"""What many runs say together: violations, quantiles, tables and the worst."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from piezoest.bench.origin import json_safe
from piezoest.bench.store import Row
from piezoest.bench.zoo.settling import SEGMENTS

QUANTILES = (0.5, 0.9, 0.95, 0.99, 1.0)
RATIOS = (
    "ratio", "ratio_rms", "cycle_ratio", "last_ratio", "last_ratio_rms", "after_ratio", "after_ratio_rms",
)  # fmt: skip
ENOUGH = 0.95  # of the runs of a cell
SOON, BACK = 2, 3  # periods until it has settled, and until a fault is forgotten


def _over(column: str) -> Callable[[Row], bool]:
    return lambda row: row.get(column) is not None and row[column] > 1.0


# Name of a criterion and whether a row violates it.
CRITERIA: dict[str, Callable[[Row], bool]] = {
    "failed": lambda row: row["failure"] is not None,
    "not finite": lambda row: row.get("finite") is False,
    "outside the limits": lambda row: row.get("within_limits") is False,
    "rests at a limit": lambda row: bool(row.get("rests_at_rail")),
    **{column: _over(column) for column in RATIOS},
}


def summarise(rows: Iterable[Row], worst: int = 10) -> dict[str, Any]:
    """Sum up runs on the zoo."""
    rows = list(rows)
    healthy = [row for row in rows if row["fault"] == "none"]
    ranked = sorted(rows, key=_badness, reverse=True)
    columns = ("seed", "family", "reference", "fault", "mode", "ratio", "last_ratio", "after_ratio", "rail",
               "driver", "failure")  # fmt: skip
    summary = {
        "runs": len(rows),
        "violations": {name: sum(map(broken, rows)) for name, broken in CRITERIA.items()},
        "healthy": {name: sum(map(broken, healthy)) for name, broken in CRITERIA.items()},
        "healthy_runs": len(healthy),
        "quantiles": {name: _quantiles(rows, name) for name in RATIOS},
        "by_family": _groups(rows, "family", "reference"),
        "by_fault": _groups(rows, "fault", "mode"),
        "worst": [{name: row.get(name) for name in columns} for row in ranked[:worst]],
        "microseconds": _median(row.get("microseconds") for row in rows),
    }
    return dict(json_safe(summary))


def _badness(row: Row) -> float:
    """How far a run is from safe; what has no ratio, for it raised or is not finite, is the worst."""
    if row["failure"] is not None or not row["finite"] or not row["within_limits"]:
        return np.inf
    return max(row["ratio"] or 0.0, row["rail"])


def _quantiles(rows: Sequence[Row], column: str) -> dict[str, Any]:
    values = [row[column] for row in rows if row.get(column) is not None]
    return {f"{100 * q:g} %": float(np.quantile(values, q)) if values else None for q in QUANTILES}


def _median(values: Iterable[Any]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def _groups(rows: Sequence[Row], first: str, second: str) -> list[dict[str, Any]]:
    """For each pair of two columns: runs, those over the ratio or at a limit, and what was said."""
    return [
        {
            first: key[0],
            second: key[1],
            "runs": len(group),
            "over": sum(map(CRITERIA["ratio"], group)),
            "over_rms": sum(map(CRITERIA["ratio_rms"], group)),
            "over_last": sum(map(CRITERIA["last_ratio"], group)),
            "over_after": sum(map(CRITERIA["after_ratio"], group)),
            "at_limit": sum(map(CRITERIA["rests at a limit"], group)),
            "ratio": _quantiles(group, "ratio")["50 %"],
            **_told(group),
        }
        for key, group in parted(rows, first, second).items()
    ]


def _told(group: Sequence[Row]) -> dict[str, Any]:
    """How many faults were to be named and were, how soon; and how soon errors were as before."""
    asked = [row for row in group if row.get("named_right") is not None]
    back = [row["recovered"] for row in group if row.get("recovery")]
    return {
        "to_name": len(asked),
        "named": sum(row["named_right"] for row in asked),
        "named_periods": _median(row["named_periods"] for row in asked),
        "to_recover": len(back),
        "recovered_first": sum(each == 1 for each in back),
        "recovered_soon": sum(each is not None and each <= BACK for each in back),
    }


def summarise_cells(rows: Iterable[Row]) -> dict[str, Any]:
    """Sum up the map: shares of runs that settled soon."""
    rows = list(rows)
    asked = [row for row in rows if row["asked"]]
    others = [row for row in rows if not row["asked"]]
    cells = [_shares(group) for group in parted(asked, "family", "amplitude", "frequency").values()]
    return {
        "runs": len(rows),
        "failures": sum(row["failure"] is not None for row in rows),
        "others": len(others),
        "cells": {
            "asked": len(cells),
            "kept": {name: sum(cell[name] >= ENOUGH for cell in cells) for name, _, _ in SEGMENTS},
        },
        "by_family": _by(asked, "family"),
        "by_place": _by(asked, "amplitude", "frequency"),
        "other_places": _by(others, "amplitude", "frequency"),
    }


def parted(rows: Sequence[Row], *names: str) -> dict[tuple[Any, ...], list[Row]]:
    """Rows by the values of some columns, in order."""
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[name] for name in names), []).append(row)
    return dict(sorted(found.items()))


def _by(rows: Sequence[Row], *names: str) -> list[dict[str, Any]]:
    """Shares for each value of some columns."""
    return [
        {**dict(zip(names, key, strict=True)), **_shares(group)}
        for key, group in parted(rows, *names).items()
    ]


def _shares(rows: Sequence[Row]) -> dict[str, Any]:
    """Share of runs that settled within `SOON` periods of each change, and median of the periods."""
    found: dict[str, Any] = {"runs": len(rows)}
    for k, (name, _, _) in enumerate(SEGMENTS):
        periods = [row["segments"][k]["periods"] if row["segments"] else None for row in rows]
        found[name] = float(np.mean([each is not None and each <= SOON for each in periods]))
        median = float(np.median([np.inf if each is None else each for each in periods]))
        found[f"{name} periods"] = None if np.isinf(median) else median
    return found
