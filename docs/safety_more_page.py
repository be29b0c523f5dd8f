"""Tables of the page `safety` about what else is asked: names of faults, to settle, to choose."""

from __future__ import annotations

from typing import Any

from paper_page import table
from which_estimator_page import listed, percent, short

Document = dict[str, Any]

CHANGES = {
    "cold-start": "cold start", "switch": "60 % of the amplitude", "drop": "20 %", "switch-back": "all of it",
    "gain-step": "gain steps by 30 %",
}  # fmt: skip
MODES = {"from-start": "from the start", "transient": "for a time", "permanent": "for good"}
HEADS = {"amplitude": "amplitude [µm]", "frequency": "frequency [Hz]"}
YES = {True: "yes", False: "no"}
ASKED = {"by_family": "asked for", "by_place": "asked for", "other_places": "not asked for"}


def of_all(count: int, runs: int) -> str:
    """A count, of how many, and in per cent."""
    return f"{count} of {runs} ({percent(count / runs)})" if runs else "—"


def besides(document: Document) -> list[str]:
    """What else is asked of it: names for faults, to settle soon, to be as good as the best estimator."""
    rows = document["controller"]["told"]
    asked, named, to_recover, recovered = (
        sum(row[name] for row in rows) for name in ("to_name", "named", "to_recover", "recovered_soon")
    )
    said = [
        f"Of the faults that are to be named, {of_all(named, asked)} were, by their right name. After a "
        f"fault for a time the error is as it was within three cycles in {of_all(recovered, to_recover)}."
    ]
    if on_map := document["map"]:
        counts = [f"{title}: {on_map['cells']['kept'][name]}" for name, title in CHANGES.items()]
        said.append(
            f"It settles within {document['criteria']['soon']} periods in at least "
            f"{percent(document['criteria']['enough'])} of the runs of a cell, in so many of "
            f"{on_map['cells']['asked']} cells: {listed(counts)}."
        )
    if rested := document.get("dwell"):
        said.append(
            f"After a rest of {rested['duration']:g} s the error is as before in the very first period in "
            f"{of_all(rested['kept'], rested['runs'])} runs."
        )
    if alone := document["singles"]:
        said.append(
            f"The median settled error is within {alone['allowed']:g} times that of the best single "
            f"estimator in {of_all(alone['kept'], len(alone['cells']))} cells of stage and reference."
        )
    return said


def told(document: Document) -> str:
    """How many faults were named, how soon, and how many errors were as before how soon."""
    body = []
    for row in document["controller"]["told"]:
        if row["to_name"] or row["to_recover"]:
            back = (of_all(row[name], row["to_recover"]) for name in ("recovered_first", "recovered_soon"))
            named = of_all(row["named"], row["to_name"])
            body.append([row["fault"], MODES[row["mode"]], named, short(row["named_periods"]), *back])
    heading = ["fault", "there", "named", "in periods", "as before in the first cycle", "in the first three"]
    return table("Faults that were named, and errors that were as before", heading, body)


def places(document: Document, part: str, *names: str) -> str:
    """Share of runs that settled soon after each change."""
    rows = document["map"][part] if document["map"] else []
    if not rows:
        return "There are none.\n"
    body = [
        [
            *(row[name] if isinstance(row[name], str) else short(row[name]) for name in names),
            str(row["runs"]),
            *(percent(row[name]) for name in CHANGES),
        ]
        for row in rows
    ]
    title = f"Runs that settled within {document['criteria']['soon']} periods, where it is {ASKED[part]}"
    return table(title, [*(HEADS.get(name, name) for name in names), "runs", *CHANGES.values()], body)


def singles(document: Document) -> str:
    """Settled errors beside those of the best single estimator."""
    found = document["singles"]
    if not found:
        return "The estimators have not been played one by one.\n"
    body = [
        [
            row["family"], row["reference"], percent(row["settled"]), percent(row["best_settled"]),
            row["best"], short(row["ratio"]),
        ]
        for row in found["cells"]
    ]  # fmt: skip
    heading = ["family", "reference", "settled error", "best single one", "which", "ratio"]
    title = f"Settled errors relative to the amplitude, medians of {found['seeds']} seeds"
    return table(title, heading, body)


def dwell(document: Document) -> str:
    """How it goes on after a long rest."""
    found = document.get("dwell")
    if not found:
        return "No rests have been played.\n"
    columns = ("first", "second", "third", "largest", "excursion", "farthest")
    body = [
        [
            *(YES[row[name]] for name in ("creep", "feedback", "noise")),
            of_all(row["kept"], row["runs"]),
            *(short(row[name]) for name in columns),
        ]
        for row in found["groups"]
    ]
    heading = [
        "creep", "feedback", "noise", "as before in the first period", "first", "second", "third",
        "largest first", "way", "longest way",
    ]  # fmt: skip
    title = f"After a rest of {found['duration']:g} s, {found['rigs']} rigs"
    return table(title, heading, body)
