"""Tables and sentences of the pages `adaptation_targets` and `adaptation_policies`, from docs/data.

No number is typed by hand. Runs at the start of every Sphinx build; by itself:
python docs/adaptation_page.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces
from which_estimator_page import listed, percent, replacements, short

from piezoest.bench import targets
from piezoest.bench.combinations import COMBINATIONS
from piezoest.bench.scenarios import SCENARIOS

DOCS = Path(__file__).resolve().parent
DATA = DOCS / "data"
TARGETS, POLICIES = DOCS / "generated" / "adaptation_targets", DOCS / "generated" / "adaptation_policies"

Document = dict[str, Any]


def read(name: str) -> Document:
    found: Document = json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))
    return found


def write(app: Any = None) -> None:
    """Write what the pages include."""
    write_pieces(TARGETS, pieces(read("adaptation")))
    write_pieces(POLICIES, policies_pieces(read("policies")))


# ---------------------------------------------------------------- asked, measured, verdict


def pieces(document: Document) -> dict[str, str]:
    """Texts by the name of their file."""
    rows = {(row["scenario"], row["estimator"]): row for row in document["summary"]}
    body = []
    for one in document["criteria"]:
        side = "≥" if one["least"] else "≤"
        body.append(
            [
                one["what"], f"{side} {figure(one, one['bound'])}", figure(one, one["value"]),
                "✓" if one["met"] else "✗",
            ]
        )  # fmt: skip
    return {
        "criteria": table("Asked and measured", ["", "asked", "measured", "verdict"], body),
        "reasons": "".join(f"- {sentence}\n" for sentence in reasons(document, rows)),
        "spread": spread_table(document, rows),
        "hindsight": hindsight_table(rows),
        "paper_rate": paper_rate(rows),
        "numbers": replacements(
            {
                **origin(document, "target"),
                "target seeds": document["seeds"],
                "target few": min(document["seeds"], targets.FEW),
                "target rate": f"{document['conditions']['sample_rate']:g} Hz",
                "target paper rate": f"{targets.PAPER_RATE:g} Hz",
                "target memories": listed([f"{memory:g}" for memory in targets.FIXED_MEMORIES]),
            }
        ),
    }


def figure(one: Document, value: float | None) -> str:
    """A number as its criterion has it: a share in per cent, a ratio as such."""
    return (
        short(value)
        if one["kind"] in ("hindsight", "divergence") or "over last" in one["what"]
        else percent(value)
    )


def origin(document: Document, of: str) -> dict[str, str]:
    """When and on what."""
    machine = document["machine"]
    return {
        f"{of} date": document["date"][:10],
        f"{of} machine": f"{machine['cpu']}, {machine['cores']} cores, {machine['python']}",
    }


def reasons(document: Document, rows: dict[tuple[str, str], Document]) -> list[str]:
    """Why what is not met is not."""
    missed = {one["kind"] for one in document["criteria"] if not one["met"]}
    sentences = []
    if "settling" in missed or "hindsight" in missed:
        for name in targets.CHANGES:
            row = rows[name, targets.DEFAULT]
            best = targets.best_fixed(rows, name)
            said = "" if best is None else (
                f", with the best fixed memory, ``{best['estimator']}``, {percent(best['settled_soon'])}"
            )  # fmt: skip
            sentences.append(f"*{name}*: {percent(row['settled_soon'])} of the runs settle in time{said}.")
    if "linear" in missed:
        sentences.append(
            "That far below linear feed-forward is beyond a Coleman-Hodgdon model on this stage: its loop "
            "has another shape than the stage's. ``PrandtlIshlinskiiRLS``, which learns plays, comes further."
        )
    if "rest" in missed:
        sentences += at_rest(rows)
    if "divergence" in missed:
        sentences.append(diverged(document, rows))
    return sentences


def diverged(document: Document, rows: dict[tuple[str, str], Document]) -> str:
    """Where the default did worse than linear feed-forward after the first period, with nobody to watch."""
    mine = {name: row for (name, estimator), row in rows.items() if estimator == targets.DEFAULT}
    counts = listed(
        [f"{row['diverged']} of {row['runs']} runs of *{n}*" for n, row in mine.items() if row["diverged"]]
    )
    return (
        f"Without the guard {counts} are worse than linear feed-forward by more than half in the period "
        "after the change, and settle all the same. A gain that falls at once makes the reading "
        "jump, which is first taken for a fault of the sensor, and then for an offset."
    )


def at_rest(rows: dict[tuple[str, str], Document]) -> list[str]:
    """What moves the parameters during a rest, and the error after it."""
    with_it, without = (rows[name, targets.DEFAULT] for name in ("dwell", targets.WITHOUT_CREEP))
    linear = rows["dwell", "linear feed-forward"]
    later = [percent(row["rest_excursion_later"]["q95"]) for row in (with_it, without)]
    first = [short(row["first_after_rest"]["median"]) for row in (with_it, without)]
    errors = [nm(row["worst_error"]["median"]) for row in (with_it, linear)]
    return [
        "In the first hundredth of a second of the rest the stage still follows the last of the motion, and "
        f"the parameters with it. From then on they move by {later[0]} in the sixty seconds, and by "
        f"{later[1]} on a stage that does not creep.",
        "Creep moves the stage itself during the rest, by what no model without creep can know: the first "
        f"error after it is {first[0]} times the last before, {first[1]} times on a stage that does not "
        f"creep (medians). Linear feed-forward's is larger still, {errors[1]} where this one is {errors[0]}.",
    ]


def paper_rate(rows: dict[tuple[str, str], Document]) -> str:
    """How many runs settle in time where the stage has its filters, in a sentence."""
    shares = []
    for triangle in targets.TRIANGLES:
        row = rows[targets.triangle_title(*triangle), targets.DEFAULT]
        shares.append(f"{percent(row['settled_soon'])} ({triangle[0]:g} µm at {triangle[1]:g} Hz)")
    return (
        f"At {targets.PAPER_RATE:g} Hz the stage has the paper's filters, and their delay costs: from "
        f"a cold start the default settles within {targets.SOON} periods in {listed(shares)} of the runs.\n"
    )


def nm(value: float | None) -> str:
    return "—" if value is None else f"{1e3 * value:.3g} nm"


def pair(values: Document, say: Any) -> str:
    return f"{say(values['median'])} ({say(values['q95'])})"


def spread_table(document: Document, rows: dict[tuple[str, str], Document]) -> str:
    """What the runs were like, with the defaults and linear feed-forward."""
    heading = [
        "scenario", "estimator", "runs", f"settled within {targets.SOON}", "settles, periods", "worst",
        "settled", "over linear", "diverged",
    ]  # fmt: skip
    body = []
    for name in document["scenarios"]:
        for estimator in ("linear feed-forward", targets.DEFAULT, targets.OUTPUT_ERROR):
            row = rows.get((name, estimator))
            if row is None:
                continue
            body.append(
                [
                    name, estimator, str(row["runs"]), percent(row["settled_soon"]),
                    pair(row["settling_periods"], short), pair(row["worst_error"], nm),
                    pair(row["settled_max"], nm), pair(row["ratio"], percent), str(row["diverged"]),
                ]
            )  # fmt: skip
    return table("Median, and in parentheses the 95 % quantile over the seeds", heading, body)


def hindsight_table(rows: dict[tuple[str, str], Document]) -> str:
    """Settled error of each fixed memory, beside the default's."""
    body = [
        [
            estimator.removeprefix(targets.DEFAULT).strip("()") or "default",
            *(
                f"{nm(rows[name, estimator]['settled_max']['median'])}; "
                f"{percent(rows[name, estimator]['settled_soon'])}"
                for name in targets.CHANGES
            ),
        ]
        for estimator in (targets.DEFAULT, *targets.FIXED)
    ]
    title = f"Settled error (median); part of the runs that settle within {targets.SOON} periods"
    return table(title, ["HysteresisRLS", *targets.CHANGES], body)


# ---------------------------------------------------------------- policies


def policies_pieces(document: Document) -> dict[str, str]:
    """Texts by the name of their file."""
    rows = {(row["scenario"], row["estimator"]): row for row in document["summary"]}
    scenarios = list(document["scenarios"])
    body = []
    measured = [one for one in COMBINATIONS if (scenarios[0], one.estimator) in rows]
    for one in measured:
        for said, quantity, say in (
            ("settles", "settling_periods", short), ("worst", "worst_error", nm_alone),
            ("settled", "settled_max", nm_alone),
        ):  # fmt: skip
            name = f"{one.name}: {one.said}" if said == "settles" else ""
            values = [rows[scenario, one.estimator][quantity]["median"] for scenario in scenarios]
            body.append([name, said, *(say(value) for value in values)])
    written = [[one.name, one.said, f"``{one.estimator}``"] for one in measured]
    return {
        "table": table("Settles: periods; worst and settled error: nm; medians", ["", "", *scenarios], body),
        "combinations": table("As they were written", ["policy", "with", "estimator"], written),
        "scenarios": "".join(f"- *{name}*. {SCENARIOS[name].description}\n" for name in scenarios),
        "numbers": replacements(
            {
                **origin(document, "policies"),
                "policies seeds": document["seeds"],
                "policies rate": f"{document['conditions']['sample_rate']:g} Hz",
            }
        ),
    }


def nm_alone(value: float | None) -> str:
    return "—" if value is None else short(1e3 * value) if value < 100.0 else f"{1e3 * value:.0e}"


if __name__ == "__main__":
    write()
