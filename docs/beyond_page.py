"""Tables and numbers of the page `beyond`, made from docs/data/beyond.json; none is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/beyond_page.py
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces

DOCS = Path(__file__).resolve().parent
SOURCE = DOCS / "data" / "beyond.json"
TARGET = DOCS / "generated" / "beyond"

PAPERS, OURS = "HysteresisRLS", "PrandtlIshlinskiiRLS"
Rows = list[dict[str, Any]]
Table = tuple[list[str], list[list[str]]]


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def pieces(document: dict[str, Any]) -> dict[str, str]:
    """Texts by the name of their file."""
    return {
        "numbers": numbers(document),
        "criteria": table("Asked and measured, by the worst seed", *criteria(document["criteria"])),
        "settled": table("Largest error of the last two periods [nm]", *settled(document["settled"])),
        "amplitudes": table("Largest error after a step up [nm]", *amplitudes(document["amplitudes"])),
        "scenarios": table("Adaptation scenarios", *scenarios(document["scenarios"])),
        "faults": table("Largest error of the last three periods [nm]", *faults(document["faults"])),
        "lead": table(
            "Largest (rms) error of the last two periods [nm]", *lead(document["near_the_resonance"])
        ),
        "small": table("Triangle of 2.5 µm at 5 Hz [nm]", *small(document["small_triangle"])),
        "recording": table("Rms error [µm]", *recording(document["recording"])),
    }


def numbers(document: dict[str, Any]) -> str:
    """Substitutions for numbers that stand in sentences."""
    parts = document["parts"]
    zones = {(row["case"], row["stage"]): row["numbers"]["left"]["median"] for row in document["dead_zones"]}
    small = {(row["case"], row["stage"]): row["numbers"]["rms_um"] for row in document["small_triangle"]}
    plain, with_delay = (small[case, "PaperStage"]["median"] for case in ("as it is", "sensor's delay told"))
    again = {row["case"]: row["numbers"] for row in document["amplitudes"] if row["stage"] == "PaperStage"}[
        OURS
    ]
    values = {
        "date": document["date"][:10],
        "machine": document["machine"]["cpu"],
        "seeds": parts["settled"]["seeds"],
        "fewest": min(parts[name]["seeds"] for name in ("scenarios", "faults")),
        "plain zones": percent(zones["none", "PreisachStage"]),
        "zones on the sum": percent(zones["on the sum of the plays", "PreisachStage"]),
        "zones on each": percent(zones["on each play", "PreisachStage"]),
        "gauge": f"{nm(math.sqrt(max(plain**2 - with_delay**2, 0.0)))} nm",
        "rise": f"{nm(again['second_rise_um']['median'])} nm",
        "rest": f"{nm(again['second_rest_um']['median'])} nm",
        "again settled": f"{nm(again['second_settled_um']['median'])} nm",
    }
    return "".join(f".. |beyond {name}| replace:: {value}\n" for name, value in values.items())


def nm(value: float) -> str:
    return f"{1e3 * value:.0f}" if value >= 0.01 else f"{1e3 * value:.1f}"


def percent(value: float) -> str:
    """Of a small part with one digit after the point."""
    return f"{100.0 * value:.0f} %" if value >= 0.1 else f"{100.0 * value:.1f} %"


def spread(numbers: dict[str, Any], name: str) -> str:
    """Median, and the worst in brackets, in nm."""
    each = numbers[name]
    return f"{nm(each['median'])} ({nm(each['worst'])})"


UNITS = {
    "%": lambda value: f"{100.0 * value:.1f} %",
    "nm": lambda value: f"{nm(value)} nm",
    "µm": lambda value: f"{value:.3f} µm",
    "": lambda value: f"{value:.2g}" if value % 1.0 else f"{value:.0f}",
}


def criteria(entries: Rows) -> Table:
    body = []
    for entry in entries:
        unit = UNITS[entry["unit"]]
        side = "at least" if entry["least"] else "at most"
        body.append(
            [
                entry["where"],
                entry["what"],
                "reported" if entry["bound"] is None else f"{side} {unit(entry['bound'])}",
                "—" if entry["value"] is None else unit(entry["value"]),
                {True: "✓", False: "✗", None: ""}[entry["met"]],
            ]
        )
    return ["where", "what", "asked", "measured", "verdict"], body


def settled(rows: Rows) -> Table:
    heading = ["reference", "stage", "linear", PAPERS, "reduction", OURS, "reduction"]
    body = []
    for row in rows:
        found = row["numbers"]
        cells = [row["case"], row["stage"], spread(found, "linear_um")]
        for name in (PAPERS, OURS):
            left = found[f"{name}_left"]
            cells += [spread(found, f"{name}_um"), f"{100.0 * (1.0 - left['worst']):.1f} %"]
        body.append(cells)
    return heading, body


def amplitudes(rows: Rows) -> Table:
    heading = ["stage", "estimator", "first time: rise", "rest of the period", "settled"]
    heading += ["second time: rise", "rest of the period", "settled"]
    names = [f"{time}_{motion}_um" for time in ("first", "second") for motion in ("rise", "rest", "settled")]
    return heading, [
        [row["stage"], row["case"], *(spread(row["numbers"], name) for name in names)] for row in rows
    ]


def scenarios(rows: Rows) -> Table:
    heading = ["scenario", "stage", "estimator", "settles [periods]", "worst [nm]", "settled [nm]"]
    body = []
    for row in rows:
        for name in ("linear feed-forward", PAPERS, OURS):
            found = row["numbers"]
            periods = (found[f"{name}_periods"][level] for level in ("median", "worst"))
            median, worst = ("never" if each is None else f"{each:.0f}" for each in periods)
            errors = [spread(found, f"{name}_{what}_um") for what in ("worst", "settled")]
            body.append([row["case"], row["stage"], name, f"{median} ({worst})", *errors])
    return heading, body


def faults(rows: Rows) -> Table:
    body = []
    for row in rows:
        found = row["numbers"]
        sound = "✗" if found["broken"]["sum"] else "✓"
        body.append([row["case"], row["stage"], spread(found, "last_um"), sound])
    return ["fault", "stage", OURS, "within bounds"], body


def lead(rows: Rows) -> Table:
    body = []
    for row in rows:
        found = row["numbers"]
        cells = [
            f"{nm(found[f'{way}_max_um']['worst'])} ({nm(found[f'{way}_rms_um']['worst'])})"
            for way in ("without", "lead")
        ]
        body.append([row["case"], row["stage"], *cells])
    return ["reference", "stage", "without", "with lead"], body


def small(rows: Rows) -> Table:
    body = [
        [row["case"], row["stage"], spread(row["numbers"], "max_um"), spread(row["numbers"], "rms_um")]
        for row in rows
    ]
    return ["case", "stage", "largest error", "rms"], body


def recording(found: dict[str, float]) -> Table:
    rows = [[name.removesuffix("_um").replace("_", " "), f"{value:.3f}"] for name, value in found.items()]
    return ["", OURS], rows


if __name__ == "__main__":
    write()
