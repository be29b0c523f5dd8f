"""Tables and numbers of the page `paper`, made from docs/data/paper.json; no number is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/paper_page.py
"""

from __future__ import annotations

import csv
import io
import json
from importlib import resources
from pathlib import Path
from typing import Any

from piezoest._files import write_text
from piezoest.bench import paper_report as report

DOCS = Path(__file__).resolve().parent
SOURCE = DOCS / "data" / "paper.json"
TARGET = DOCS / "generated" / "paper"


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def write_pieces(target: Path, texts: dict[str, str]) -> None:
    """Write texts by the name of their file; untouched where nothing changed, so that no rebuild follows."""
    target.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        path = target / f"{name}.inc"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            write_text(path, text)


def pieces(document: dict[str, Any]) -> dict[str, str]:
    """Texts by the name of their file."""
    entries = document["tables"]
    found = {
        f"table{k}": table(report.TITLES[number], *report.table(entries, number))
        for k, number in enumerate(report.TITLES, 1)
    }
    found["adaptation"] = table(report.TRANSIENTS, *report.transients(document["adaptation"]))
    found["memory"] = table(document["memory"][0]["row"], *report.memories(document["memory"]))
    found["verdict"] = "".join(f"- {sentence}\n" for sentence in report.verdict(entries))
    found["stage"] = table("Parts of the stage", ["part", "where its numbers come from"], origins())
    found["numbers"] = numbers(document)
    return found


def table(title: str, heading: list[str], body: list[list[str]]) -> str:
    """A csv-table; ✗ in bold."""
    written = io.StringIO()
    writer = csv.writer(written, lineterminator="\n", quoting=csv.QUOTE_ALL)
    writer.writerows([f"**{cell}**" if cell.endswith("✗") else cell for cell in cells] for cells in body)
    header = io.StringIO()
    csv.writer(header, lineterminator="", quoting=csv.QUOTE_ALL).writerow(
        [name.replace("\n", " ") for name in heading]
    )
    rows = "".join(f"   {line}\n" for line in written.getvalue().splitlines())
    return f".. csv-table:: {title}\n   :header: {header.getvalue()}\n   :widths: auto\n\n{rows}"


def origins() -> list[list[str]]:
    """What the stage's data file says of itself."""
    text = resources.files("piezoest.stage").joinpath("paper_stage.json").read_text(encoding="utf-8")
    return [
        [name, section["origin"]]
        for name, section in json.loads(text).items()
        if isinstance(section, dict) and "origin" in section
    ]


def numbers(document: dict[str, Any]) -> str:
    """Substitutions for numbers that stand in sentences."""
    conditions, machine = document["conditions"], document["machine"]
    values = {
        "date": document["date"][:10],
        "machine": f"{machine['cpu']}, {machine['cores']} cores, {machine['python']}",
        "library": document["versions"]["piezoest"],
        "seconds": f"{document['seconds']:.0f} s",
        "memory": f"{conditions['memory_s']:g} s",
        "seed": conditions["seed"],
        "start": ", ".join(
            f"{symbol} = {conditions['start'][name]:g}"
            for symbol, name in (("α", "alpha"), ("β", "beta"), ("γ", "gamma"))
        ),
        "start_gain": f"{conditions['linear_start']['gain']:g} µm/V",
    }
    return "".join(f".. |{name}| replace:: {value}\n" for name, value in values.items())


if __name__ == "__main__":
    write()
