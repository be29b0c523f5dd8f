"""Tables and numbers of the page `paper`, from docs/data/paper.json."""

import json
from importlib import resources

from page_parts import Document, replacements, table

from piezoest.bench import paper_report as report
from piezoest.bench.paper import SETTLED

UNSETTLED = "it does not settle in the first half of the run."


def pieces(document: Document) -> dict[str, str]:
    entries = document["tables"]
    tables = {
        f"table{k}": table(report.TITLES[number], *report.table(entries, number))
        for k, number in enumerate(report.TITLES, 1)
    }
    return tables | {
        "adaptation": table(report.TRANSIENTS, *report.transients(document["adaptation"]), UNSETTLED),
        "memory": table(document["memory"][0]["row"], *report.memories(document["memory"]), UNSETTLED),
        "verdict": table(report.WITHIN, *report.verdict(entries)),
        "stage": table("Where the numbers of the stage come from", ["part", "source"], origins()),
        "numbers": numbers(document),
    }


def origins() -> list[list[str]]:
    """What the stage's data file says of itself."""
    text = resources.files("piezoest.stage").joinpath("paper_stage.json").read_text(encoding="utf-8")
    parts = json.loads(text).items()
    return [[name, part["origin"]] for name, part in parts if isinstance(part, dict) and "origin" in part]


def numbers(document: Document) -> str:
    conditions = document["conditions"]
    start = conditions["start"]
    values = {
        "library": document["versions"]["piezoest"],
        "seconds": f"{document['seconds']:.0f} s",
        "memory": f"{conditions['memory_s']:g} s",
        "seed": conditions["seed"],
        "settled": f"{SETTLED:g}",
        "start": f"α = {start['alpha']:g}, β = {start['beta']:g}, γ = {start['gamma']:g}",
        "start gain": f"{conditions['linear_start']['gain']:g} µm/V",
    }
    return replacements("paper", values, document)
