"""Tables of the page `beyond`, made from docs/data/beyond.json; no number is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/beyond_page.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces

DOCS = Path(__file__).resolve().parent
SOURCE = DOCS / "data" / "beyond.json"
TARGET = DOCS / "generated" / "beyond"


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def pieces(document: dict[str, Any]) -> dict[str, str]:
    """Texts by the name of their file."""
    found = {
        "settled": table("Largest error of the last two periods [nm]", *settled(document["settled"])),
        "amplitudes": table("Worst error of the first period [nm]", *amplitudes(document["amplitudes"])),
        "scenarios": table("Adaptation scenarios, PaperStage [nm]", *scenarios(document["scenarios"])),
        "lead": table(
            "Largest (rms) error of the last two periods [nm]", *lead(document["near_the_resonance"])
        ),
        "small": table("Triangle of 2.5 µm at 5 Hz, PaperStage [nm]", *small(document["small_triangle"])),
        "numbers": f".. |beyond date| replace:: {document['date'][:10]}\n"
        f".. |beyond machine| replace:: {document['machine']['cpu']}\n",
    }
    recording = document["recording"] or {}
    rows = [[name.removesuffix("_um").replace("_", " "), f"{value:.3f}"] for name, value in recording.items()]
    found["recording"] = table("Rms error [µm]", ["", "PrandtlIshlinskiiRLS"], rows)
    return found


def nm(value: float) -> str:
    return f"{1e3 * value:.0f}" if value >= 0.01 else f"{1e3 * value:.1f}"


def settled(entries: list[dict[str, Any]]) -> tuple[list[str], list[list[str]]]:
    heading = [
        "reference",
        "stage",
        "linear",
        "HysteresisRLS",
        "reduction",
        "PrandtlIshlinskiiRLS",
        "reduction",
    ]
    body = []
    for entry in entries:
        errors = entry["max_error_um"]
        cells = [entry["reference"], entry["stage"], nm(errors["linear"])]
        for name in ("HysteresisRLS", "PrandtlIshlinskiiRLS"):
            cells += [nm(errors[name]), f"{100.0 * (1.0 - errors[name] / errors['linear']):.1f} %"]
        body.append(cells)
    return heading, body


def amplitudes(entries: list[dict[str, Any]]) -> tuple[list[str], list[list[str]]]:
    heading = ["stage", "estimator", "first time", "settled", "second time", "settled"]
    body = []
    for entry in entries:
        name = entry["estimator"] + (", range known" if entry["range_known"] else "")
        cells = [entry["stage"], name]
        for time in ("first_time", "second_time"):
            cells += [nm(entry[time]["first_um"]), nm(entry[time]["settled_um"])]
        body.append(cells)
    return heading, body


def scenarios(entries: list[dict[str, Any]]) -> tuple[list[str], list[list[str]]]:
    body = [
        [entry["scenario"], entry["estimator"], nm(entry["worst_um"]), nm(entry["settled_um"])]
        for entry in entries
    ]
    return ["scenario", "estimator", "worst after the change", "settled"], body


def lead(entries: list[dict[str, Any]]) -> tuple[list[str], list[list[str]]]:
    body = []
    for entry in entries:
        errors = [entry["error"][way] for way in ("without", "lead")]
        cells = [f"{nm(error['max_um'])} ({nm(error['rms_um'])})" for error in errors]
        body.append([f"{entry['shape']} {entry['frequency_Hz']:.0f} Hz", entry["stage"], *cells])
    return ["reference", "stage", "without", "with lead"], body


def small(entries: list[dict[str, Any]]) -> tuple[list[str], list[list[str]]]:
    body = [[entry["case"], nm(entry["max_um"]), nm(entry["rms_um"])] for entry in entries]
    return ["case", "largest error", "rms"], body


if __name__ == "__main__":
    write()
