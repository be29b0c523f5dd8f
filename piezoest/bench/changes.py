"""What changed between two campaigns, and whether beyond the noise.

Runs are paired by scenario, estimator and seed: the same start, noise and moment of change on both
sides, so that what a seed brings with it cancels. A number is compared by the Wilcoxon signed-rank test
on the logarithm of its ratio, which asks nothing of the distribution and can count a run that failed as
infinite; with few pairs its null distribution is taken in full. That many comparisons are made at a
time is allowed for by the false discovery rate.

F. Wilcoxon, Biometrics Bulletin 1 (1945) 80-83; Y. Benjamini, Y. Hochberg, Journal of the Royal
Statistical Society B 57 (1995) 289-300.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.adaptation import json_safe
from piezoest.bench.campaign import QUANTITIES, title, value_of
from piezoest.bench.runner import Row

LEVEL = 0.05  # false discovery rate
RELEVANT = 0.01  # a median change by less is none, however sure it is
EXACT = 13  # pairs up to which all signs are tried: 2¹³ of them
ALL = "all scenarios"

Pair = tuple[Row, Row]


def compare(
    first: Iterable[Row], second: Iterable[Row], *, level: float = LEVEL, relevant: float = RELEVANT
) -> dict[str, Any]:
    """Compare the runs of two campaigns with the same settings.

    Parameters
    ----------
    first, second : iterable of dict
        Rows of `piezoest.bench.runner.play`, before and after.
    level : float
        False discovery rate: the part of the changes found that may be none.
    relevant : float
        Least median change, in parts.

    Returns
    -------
    dict
        ``rows``: for each estimator and number, over all scenarios and for each, the number of pairs
        and of those that changed, the median ratio of the latter, p, q (p with the other comparisons
        allowed for) and the verdict; ``pairs``, ``counts`` and ``notes``. A verdict is "same" (to the
        last bit), "within noise", "negligible", "better", "worse", or "too few seeds": not even a
        change of all pairs in one direction would be told from noise.
    """
    ours, theirs = _by_run(first), _by_run(second)
    common = [(ours[run], theirs[run]) for run in ours if run in theirs]
    rows: list[Row] = []
    for (scenario, estimator), pairs in _groups(common).items():
        for quantity in QUANTITIES:
            rows.append(
                {"scenario": scenario, "estimator": estimator, "quantity": quantity}
                | _test(logarithms(pairs, quantity))
            )
    _judge(rows, level, relevant)
    rows.sort(key=lambda row: (row["scenario"] != ALL, row["q"] is None, row["q"] or 0.0))
    return {
        "level": level,
        "relevant": relevant,
        "pairs": len(common),
        "rows": [dict(json_safe(row)) for row in rows],
        "counts": dict(Counter(row["verdict"] for row in rows)),
        "notes": _notes(ours, theirs, common),
    }


def check_settings(first: Mapping[str, Any], second: Mapping[str, Any]) -> None:
    """Refuse to compare campaigns whose runs differ in more than the code.

    Parameters
    ----------
    first, second : mapping
        Documents of `piezoest.bench.suite.describe`.

    Raises
    ------
    ValueError
        If their settings differ; names them.
    """
    one, other = first["settings"], second["settings"]
    differing = [
        f"{name} is {one.get(name)} in A and {other.get(name)} in B"
        for name in dict.fromkeys([*one, *other])
        if one.get(name) != other.get(name)
    ]
    if differing:
        raise ValueError(f"A and B cannot be compared: {'; '.join(differing)}")


def logarithms(pairs: Sequence[Pair], quantity: str) -> FloatArray:
    """Logarithm of second over first, for each pair; infinite where one of them is.

    Parameters
    ----------
    pairs : sequence of (dict, dict)
        Rows.
    quantity : str
        A column of them.

    Returns
    -------
    ndarray, shape (N,)
    """
    values = np.array([[value_of(row, quantity) for row in pair] for pair in pairs]).reshape(-1, 2)
    a, b = values[:, 0], values[:, 1]
    same = (a == b) | (np.isinf(a) & np.isinf(b))
    # A settling time may be zero: so is the ratio of two of them one, and that to another infinite.
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(same, 0.0, np.log(b) - np.log(a))


def signed_rank(d: FloatArray) -> float:
    """Two-sided p of the Wilcoxon signed-rank test; zeros are left out (Wilcoxon 1945).

    Parameters
    ----------
    d : ndarray, shape (N,)
        Differences, infinite ones larger than all others.

    Returns
    -------
    float
        1 if all but one are zero.
    """
    from scipy.stats import permutation_test, rankdata, wilcoxon

    d = d[d != 0.0]
    if d.size < 2:
        return 1.0
    finite = np.abs(d[np.isfinite(d)])
    beyond = 1.0 + float(np.max(finite, initial=0.0))
    d = np.clip(d, -beyond, beyond)
    if d.size > EXACT:
        return float(wilcoxon(d).pvalue)
    ranks = np.sign(d) * rankdata(np.abs(d))
    return float(
        permutation_test(
            (ranks,), np.sum, permutation_type="samples", vectorized=True, n_resamples=2**EXACT
        ).pvalue
    )


def _by_run(rows: Iterable[Row]) -> dict[tuple[str, str, int], Row]:
    return {(title(row), row["estimator"], row["seed"]): row for row in rows}


def _groups(pairs: Iterable[Pair]) -> dict[tuple[str, str], list[Pair]]:
    """Pairs by scenario and estimator, and those of all scenarios where there are several."""
    single: dict[tuple[str, str], list[Pair]] = {}
    every: dict[tuple[str, str], list[Pair]] = {}
    for pair in pairs:
        name, estimator = title(pair[0]), pair[0]["estimator"]
        single.setdefault((name, estimator), []).append(pair)
        every.setdefault((ALL, estimator), []).append(pair)
    return {**(every if len({name for name, _ in single}) > 1 else {}), **single}


def _test(d: FloatArray) -> Row:
    changed = bool(np.any(d != 0.0))
    return {
        "pairs": int(d.size),
        "changed": int(np.count_nonzero(d)),
        # Of the pairs that changed, or one would not see what became of them.
        "ratio": math.exp(float(np.median(d[d != 0.0]))) if changed else 1.0,
        "p": signed_rank(d) if changed else None,
        "q": None,
    }


def _judge(rows: list[Row], level: float, relevant: float) -> None:
    """Allow for the number of comparisons, and give each its verdict.

    What is the same to the last bit does not count among them: under the hypothesis of no change the
    signs of the differences are random whatever their sizes are, zero among these.
    """
    from scipy.stats import false_discovery_control

    tested = [row for row in rows if row["p"] is not None]
    if tested:
        for row, q in zip(tested, false_discovery_control([row["p"] for row in tested]), strict=True):
            row["q"] = float(q)
    for row in rows:
        row["verdict"] = _verdict(row, level, relevant)


def _verdict(row: Row, level: float, relevant: float) -> str:
    if row["p"] is None:
        return "same"
    if row["q"] > level:
        # The least p that so many pairs can have.
        return "too few seeds" if 2.0 ** (1 - row["changed"]) > level else "within noise"
    if 1.0 / (1.0 + relevant) < row["ratio"] < 1.0 + relevant:
        return "negligible"
    return "better" if row["ratio"] < 1.0 else "worse"


def _notes(
    ours: Mapping[tuple[str, str, int], Row],
    theirs: Mapping[tuple[str, str, int], Row],
    common: Sequence[Pair],
) -> list[str]:
    notes = []
    for where, these, others in (("A", ours, theirs), ("B", theirs, ours)):
        if only := [run for run in these if run not in others]:
            estimators = ", ".join(dict.fromkeys(estimator for _, estimator, _ in only))
            notes.append(f"{len(only)} runs are in {where} only ({estimators}); they are not compared.")
    for before, after in common:
        if (before["failure"] is None) != (after["failure"] is None):
            run = f"{title(after)}, seed {after['seed']}, {after['estimator']}"
            failure = after["failure"]
            notes.append(f"fails no longer: {run}" if failure is None else f"fails now: {run}: {failure}")
    return notes
