"""The document that a campaign comes down to: settings, machine, versions, and medians of every number."""

from __future__ import annotations

import json
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from piezoest._checks import dictionary
from piezoest._files import read_json, write_text
from piezoest.bench.adaptation import json_safe
from piezoest.bench.campaign import failures, keys_of, summarise
from piezoest.bench.machine import fingerprint
from piezoest.bench.recorded import described
from piezoest.bench.runner import Row, Settings, Task
from piezoest.bench.scenarios import SCENARIOS
from piezoest.bench.store import Store

DOCUMENT = "suite.json"
HEAD = ("date", "machine", "versions", "code", "runs")
# What is asked of the three numbers in the overview, each the median of its scenarios' medians.
OVERVIEW = ("settled_max", "worst_error", "settling_time", "microseconds")


def describe(
    tasks: Sequence[Task], store: Store, settings: Settings, origin: dict[str, Any]
) -> dict[str, Any]:
    """Sum up a finished campaign.

    Parameters
    ----------
    tasks : sequence of Task
        All of it.
    store : Store
        With their rows.
    settings : Settings
        What all runs shared.
    origin : dict
        Date, machine, versions and seconds.

    Returns
    -------
    dict
        JSON-safe.
    """
    keys = keys_of(tasks)
    names = dict.fromkeys(task.scenario for task in tasks)
    summary = summarise(store.rows(keys))
    return {
        "suite": "campaign",
        **origin,
        "settings": asdict(settings),
        "code": fingerprint(),
        "scenarios": described(list(names), {name: each.description for name, each in SCENARIOS.items()}),
        "estimators": list(dict.fromkeys(task.estimator for task in tasks)),
        "seeds": sorted({task.seed for task in tasks}),
        "runs": len(keys),
        "overview": overview(summary),
        "summary": summary,
        "failures": failures(store.rows(keys)),
    }


def overview(summary: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row for each estimator: of each number the median over the scenarios.

    Parameters
    ----------
    summary : iterable of dict
        From `piezoest.bench.campaign.summarise`.

    Returns
    -------
    list of dict
        Errors relative to the amplitude; null stands for infinite.
    """
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in summary:
        groups.setdefault(row["estimator"], []).append(row)
    return [dict(json_safe(_over_scenarios(name, rows))) for name, rows in groups.items()]


def _over_scenarios(estimator: str, rows: list[Row]) -> Row:
    found: Row = {"estimator": estimator}
    for name in ("runs", "settled", "diverged", "failures"):
        found[name] = sum(row[name] for row in rows)
    for name in OVERVIEW:
        values = [_value(row, name) for row in rows if name in row]
        found[name] = statistics.median_high(values) if values else None
    return found


def _value(row: Row, name: str) -> float:
    median = row[name]["median"]
    if median is None:
        return float("inf")
    of = row["amplitude"] if name in ("settled_max", "worst_error") else 1.0
    return float(median / of)


def write(document: dict[str, Any], path: Path) -> None:
    """Write a document as JSON.

    Parameters
    ----------
    document : dict
        JSON-safe.
    path : Path
        To write to.
    """
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    write_text(path, text + "\n")


def read(folder: Path) -> dict[str, Any]:
    """Document of a campaign's folder.

    Parameters
    ----------
    folder : Path
        Where `piezoest bench --output` wrote to.

    Raises
    ------
    ValueError
        If there is none, for the campaign is not finished, or if it holds something else.
    """
    path = folder / DOCUMENT
    if not path.exists():
        raise ValueError(f"{folder} holds no {DOCUMENT}: no campaign of piezoest bench was finished there")
    document = dictionary(read_json(path))
    if not dictionary(document.get("settings")):
        document = {}
    if missing := [name for name in (*HEAD, "settings") if name not in document]:
        raise ValueError(f"{path} is not what piezoest bench writes: it lacks {', '.join(missing)}")
    return dict(document)
