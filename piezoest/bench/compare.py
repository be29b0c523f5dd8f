"""What changed between two campaigns, and whether beyond the noise: `piezoest bench compare`."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from piezoest._checks import FloatArray
from piezoest.bench.origin import json_safe
from piezoest.bench.statistics import LEVEL, signed_rank

RUN = ["stage", "scenario", "estimator", "seed"]
QUANTITIES = ("typical", "settled", "worst", "settles")
RELEVANT = 0.01  # a smaller median change is negligible, however sure it is
ALL = "all scenarios"


def compare(first: pd.DataFrame, second: pd.DataFrame) -> dict[str, Any]:
    """Compare the runs of two campaigns with the same settings, pair by pair.

    Returns for each estimator and number the pairs, how many changed, the median ratio of these, p, q (p with
    the other comparisons allowed for) and a verdict; at "too few seeds" not even a change of all pairs would
    be told from noise.
    """
    both = first.merge(second, on=RUN, suffixes=("", "_after"))
    rows = [
        {"scenario": scenario, "estimator": estimator, "quantity": quantity}
        | _test(_logarithms(pairs, quantity))
        for (scenario, estimator), pairs in _groups(both)
        for quantity in QUANTITIES
    ]
    _judge(rows)
    rows.sort(key=lambda row: (row["scenario"] != ALL, row["q"] is None, row["q"] or 0.0))
    return {
        "level": LEVEL,
        "relevant": RELEVANT,
        "pairs": len(both),
        "rows": json_safe(rows),
        "counts": dict(Counter(row["verdict"] for row in rows)),
        "notes": _notes(first, second, both),
    }


def check_conditions(first: Mapping[str, Any], second: Mapping[str, Any]) -> None:
    """Refuse to compare campaigns whose runs differ in more than the code."""
    one, other = first["conditions"], second["conditions"]
    differing = [
        f"{name} is {one.get(name)} in A and {other.get(name)} in B"
        for name in dict.fromkeys([*one, *other])
        if one.get(name) != other.get(name)
    ]
    if differing:
        raise ValueError(f"A and B cannot be compared: {'; '.join(differing)}")


def _groups(both: pd.DataFrame) -> Iterable[tuple[tuple[str, str], pd.DataFrame]]:
    """Pairs by scenario and estimator, after those of all scenarios where there are several."""
    place = both["scenario"] + both["stage"].map(lambda name: "" if name in ("", "paper") else f", {name}")
    named = both.assign(place=place)
    if place.nunique() > 1:
        yield from (((ALL, str(name)), group) for name, group in named.groupby("estimator", sort=False))
    for (scenario, estimator), group in named.groupby(["place", "estimator"], sort=False):
        yield (str(scenario), str(estimator)), group


def _logarithms(pairs: pd.DataFrame, quantity: str) -> FloatArray:
    """Logarithm of after over before, for each pair; infinite where one of them is."""
    a, b = (pairs[name].to_numpy(float, na_value=np.inf) for name in (quantity, f"{quantity}_after"))
    same = (a == b) | (np.isinf(a) & np.isinf(b))
    # A run may settle at once: so is the ratio of two of them one, and that to another infinite.
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(same, 0.0, np.log(b) - np.log(a))


def _test(d: FloatArray) -> dict[str, Any]:
    changed = d[d != 0.0]
    return {
        "pairs": int(d.size),
        "changed": int(changed.size),
        # Of the pairs that changed, or one would not see what became of them.
        "ratio": math.exp(float(np.median(changed))) if changed.size else 1.0,
        "p": signed_rank(d) if changed.size else None,
        "q": None,
    }


def _judge(rows: list[dict[str, Any]]) -> None:
    """Allow for the number of comparisons, and give each its verdict.

    What is the same to the last bit does not count among them: under the hypothesis of no change the signs of
    the differences are random whatever their sizes are, zero among these.
    """
    from scipy.stats import false_discovery_control

    tested = [row for row in rows if row["p"] is not None]
    for row, q in zip(tested, false_discovery_control([row["p"] for row in tested]), strict=True):
        row["q"] = float(q)
    for row in rows:
        row["verdict"] = _verdict(row)


def _verdict(row: dict[str, Any]) -> str:
    if row["p"] is None:
        return "same"
    if row["q"] > LEVEL:
        # The least p that so many pairs can have.
        return "too few seeds" if 2.0 ** (1 - row["changed"]) > LEVEL else "within noise"
    if 1.0 / (1.0 + RELEVANT) < row["ratio"] < 1.0 + RELEVANT:
        return "negligible"
    return "better" if row["ratio"] < 1.0 else "worse"


def _notes(first: pd.DataFrame, second: pd.DataFrame, both: pd.DataFrame) -> list[str]:
    notes = []
    for side, runs, others in (("A", first, second), ("B", second, first)):
        found = runs.merge(others[RUN], on=RUN, how="left", indicator="where")
        only = found[found["where"] == "left_only"]
        if len(only):
            names = ", ".join(only["estimator"].unique())
            notes.append(f"{len(only)} runs are in {side} only ({names}); they are not compared.")
    failed, fails = both["failure"].notna(), both["failure_after"].notna()
    for _, run in both[failed != fails].iterrows():
        what = f"{run['scenario']}, seed {run['seed']}, {run['estimator']}"
        now = run["failure_after"]
        notes.append(f"fails no longer: {what}" if pd.isna(now) else f"fails now: {what}: {now}")
    return notes
