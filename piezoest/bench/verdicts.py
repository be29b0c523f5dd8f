"""What the runs of a ranking say: an order, what is efficient, what each is bad at, and what to take when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.campaign import title, value_of
from piezoest.bench.changes import logarithms, signed_rank
from piezoest.bench.estimators import REFERENCE
from piezoest.bench.runner import Row

# An estimator is said to be bad at what it does this many times worse than the best one.
BAD = 2.0


def overall(rows: Sequence[Row], times: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """One line for each estimator, the one that adapts best first.

    Parameters
    ----------
    rows : sequence of dict
        From `piezoest.bench.ranking.judge`.
    times : dict
        From `piezoest.bench.ranking.costs`.

    Returns
    -------
    list of dict
        ``adapting``, ``settled`` and ``worst`` are errors relative to the amplitude: geometric means over
        the scenarios of the median over the seeds, of the typical error, of the largest of the last
        three periods and of the largest after the change. ``efficient``: none is better in all of
        these and in cost.
    """
    lines = []
    for name in dict.fromkeys(row["estimator"] for row in rows):
        mine = [row for row in rows if row["estimator"] == name]
        times_of = times.get(name, {})
        lines.append(
            {
                "name": name,
                "adapting": _over_scenarios(mine, "mean_error"),
                "settled": _over_scenarios(mine, "settled_max"),
                "worst": _over_scenarios(mine, "worst_error"),
                "settling_time": _median([value_of(row, "settling_time") for row in mine]),
                "runs": len(mine),
                "runs_settled": sum(row["settling_time"] is not None for row in mine),
                "diverged": sum(bool(row["diverged"]) for row in mine),
                "failures": sum(row["failure"] is not None for row in mine),
                **{
                    key: times_of.get(key)
                    for key in ("step_microseconds", "run_microseconds", "longest_step_microseconds")
                },
            }
        )
    judged = [line for line in lines if line["step_microseconds"] is not None]
    numbers = np.array(
        [[line[key] for key in ("adapting", "settled", "worst", "step_microseconds")] for line in judged]
    ).reshape(-1, 4)
    for line in lines:
        line["efficient"] = False
    for line, is_efficient in zip(judged, efficient(numbers), strict=True):
        line["efficient"] = bool(is_efficient)
    return sorted(lines, key=lambda line: line["adapting"])


def efficient(numbers: FloatArray) -> list[bool]:
    """Whether no other point is at least as good in all numbers and better in one: the Pareto front.

    Parameters
    ----------
    numbers : ndarray, shape (N, n)
        Less is better.
    """
    return [
        not np.any(np.all(numbers <= point, axis=1) & np.any(numbers < point, axis=1)) for point in numbers
    ]


def weaknesses(rows: Sequence[Row], lines: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """What each is bad at: where it is far behind the best one.

    Parameters
    ----------
    rows : sequence of dict
        From `piezoest.bench.ranking.judge`.
    lines : sequence of dict
        From `overall`.

    Returns
    -------
    dict
        By name: scenario, number, its value, the best one's and their ratio, the worst first; the
        number ``step_microseconds`` stands without a scenario.
    """
    found: dict[str, list[dict[str, Any]]] = {line["name"]: [] for line in lines if line["name"] != REFERENCE}
    for scenario in dict.fromkeys(map(title, rows)):
        for quantity in ("settled_max", "worst_error"):
            values = {
                name: _median(
                    [
                        value_of(row, quantity)
                        for row in rows
                        if row["estimator"] == name and title(row) == scenario
                    ]
                )
                for name in found
            }
            _add_weaknesses(found, values, scenario, quantity)
    times = {line["name"]: line["step_microseconds"] or math.inf for line in lines if line["name"] in found}
    _add_weaknesses(found, times, None, "step_microseconds")
    for some in found.values():
        some.sort(key=lambda each: -each["ratio"])
    return found


def _add_weaknesses(
    found: dict[str, list[dict[str, Any]]], values: dict[str, float], scenario: str | None, quantity: str
) -> None:
    best = min(values, key=lambda name: values[name])
    for name, value in values.items():
        if values[best] > 0.0 and value >= BAD * values[best]:
            found[name].append(
                {
                    "scenario": scenario,
                    "quantity": quantity,
                    "value": value,
                    "best": values[best],
                    "best_name": best,
                    "ratio": value / values[best],
                }
            )


@dataclass(frozen=True, slots=True)
class Need:
    """Something one may want of an estimator, and the number that tells.

    Parameters
    ----------
    words : str
        What is wanted.
    quantity : str
        Column of the rows that should be small.
    scenarios : tuple of str
        Where it is taken; empty for all, the other stage among them.
    most_microseconds : float
        What a step may cost.
    """

    words: str
    quantity: str
    scenarios: tuple[str, ...] = ()
    most_microseconds: float = math.inf


CHANGES = ("amplitude-switch", "amplitude-drop", "gain-step")
NEEDS = (
    Need("No idea what will come: all scenarios", "mean_error"),
    Need("The same, in a loop of 50 kHz: 20 µs a sample", "mean_error", most_microseconds=20.0),
    Need("No idea of the parameters: a cold start", "mean_error", ("cold-start",)),
    Need("Soon right again after a change of amplitude or gain", "mean_error", CHANGES),
    Need("Small worst error at such a change", "worst_error", CHANGES),
    Need("Least error once settled, one amplitude", "settled_max", ("cold-start",)),
    Need("Minor loops and signals that do not repeat", "settled_max", ("prbs", "random-walk", "two-tone")),
    Need("A gain that drifts", "settled_max", ("drift",)),
    Need("Long rests", "worst_error", ("dwell",)),
    Need("A noisy gauge", "settled_max", ("noise",)),
    Need(
        "A stage nobody tuned for", "mean_error", ("cold-start, other stage", "amplitude-drop, other stage")
    ),
)


def decide(rows: Sequence[Row], lines: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each need the estimators in order, and whether the first is surely better than the second.

    Parameters
    ----------
    rows : sequence of dict
        From `piezoest.bench.ranking.judge`.
    lines : sequence of dict
        From `overall`.

    Returns
    -------
    list of dict
        ``order``: names with their numbers, errors relative to the amplitude; ``linear``: that of linear
        feed-forward; ``p``: of first against second, paired by run (Wilcoxon's signed ranks).
    """
    steps = {line["name"]: line["step_microseconds"] for line in lines}
    found = []
    for need in NEEDS:
        there = [row for row in rows if not need.scenarios or title(row) in need.scenarios]
        values = {
            name: _over_scenarios([row for row in there if row["estimator"] == name], need.quantity)
            for name in dict.fromkeys(row["estimator"] for row in there)
        }
        allowed = [
            name
            for name, step in steps.items()
            if step is not None and step <= need.most_microseconds and name in values
        ]
        order = sorted(allowed, key=lambda name: values[name])
        found.append(
            {
                "need": need.words,
                "quantity": need.quantity,
                "scenarios": list(need.scenarios),
                "order": [{"name": name, "value": values[name]} for name in order],
                "linear": values.get(REFERENCE),
                "p": _first_against_second(there, order, need.quantity),
            }
        )
    return found


def _first_against_second(rows: Sequence[Row], order: Sequence[str], quantity: str) -> float | None:
    if len(order) < 2:
        return None
    by_run = {(title(row), row["seed"], row["estimator"]): row for row in rows}
    pairs = [
        (row, by_run[scenario, seed, order[1]])
        for (scenario, seed, name), row in by_run.items()
        if name == order[0] and (scenario, seed, order[1]) in by_run
    ]
    return signed_rank(logarithms(pairs, quantity))


def _over_scenarios(rows: Sequence[Row], quantity: str) -> float:
    """Geometric mean over the scenarios of the median over the seeds, relative to the amplitude."""
    groups: dict[str, list[float]] = {}
    for row in rows:
        relative = value_of(row, quantity) / row["amplitude"] if row["amplitude"] else math.inf
        groups.setdefault(title(row), []).append(relative)
    return math.exp(float(np.mean(np.log([_median(values) for values in groups.values()]))))


def _median(values: Sequence[float]) -> float:
    """The middle one, the lower of two, as in the summary: a value that occurred, which may be infinite."""
    return sorted(values)[(len(values) - 1) // 2]
