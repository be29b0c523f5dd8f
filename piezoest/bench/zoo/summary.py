"""What many runs say together: violations, quantiles, groups and the worst."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from piezoest.bench.origin import json_safe
from piezoest.bench.store import Row

QUANTILES = (0.5, 0.9, 0.95, 0.99, 1.0)
RATIOS = ("ratio", "cycle_ratio", "last_ratio", "after_ratio")
BACK = 3  # cycles until a fault is forgotten


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


def grouped(
    rows: Iterable[Row], *names: str, of: Callable[[list[Row]], dict[str, Any]]
) -> list[dict[str, Any]]:
    """What a function says of the rows with the same values of some columns, in the order of these."""
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[name] for name in names), []).append(row)
    return [{**dict(zip(names, key, strict=True)), **of(group)} for key, group in sorted(found.items())]


def values(rows: Iterable[Row], column: str) -> list[Any]:
    """What is known of a column."""
    return [row[column] for row in rows if row.get(column) is not None]


def median(known: Sequence[float]) -> float | None:
    """None if nothing is known."""
    return float(np.median(known)) if known else None


def failures(rows: Sequence[Row]) -> int:
    """Runs that raised an error."""
    return sum(map(CRITERIA["failed"], rows))


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
        "quantiles": {name: _quantiles(values(rows, name)) for name in RATIOS},
        "by_family": grouped(rows, "family", "reference", of=counts),
        "by_fault": grouped(rows, "fault", "mode", of=counts),
        "worst": [{name: row.get(name) for name in columns} for row in ranked[:worst]],
        "microseconds": median(values(rows, "microseconds")),
    }
    return json_safe(summary)


def _badness(row: Row) -> float:
    """How far a run is from safe; what has no ratio, for it raised or is not finite, is the worst."""
    if row["failure"] is not None or not row["finite"] or not row["within_limits"]:
        return np.inf
    return max(row["ratio"] or 0.0, row["rail"])


def _quantiles(known: Sequence[float]) -> dict[str, Any]:
    return {f"{100 * q:g} %": float(np.quantile(known, q)) if known else None for q in QUANTILES}


def counts(rows: Sequence[Row]) -> dict[str, Any]:
    """Runs over the ratio or at a limit; faults to be named that were; errors that were as before."""
    ratios, asked = values(rows, "ratio"), values(rows, "named_right")
    back = [row["recovered"] for row in rows if row.get("recovery")]
    over = {"over": "ratio", "over_last": "last_ratio", "at_limit": "rests at a limit"}
    return {
        "runs": len(rows),
        "judged": len(ratios),
        **{name: sum(map(CRITERIA[criterion], rows)) for name, criterion in over.items()},
        "ratio": median(ratios),
        "to_name": len(asked),
        "named": sum(asked),
        "named_periods": median(values(rows, "named_periods")),
        "to_recover": len(back),
        "recovered_first": sum(each == 1 for each in back),
        "recovered_soon": sum(each is not None and each <= BACK for each in back),
    }
