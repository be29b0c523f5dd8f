"""Tables and sentences of the page `faults`, from docs/data/faults.json and piezoest.bench.faults.

No number is typed by hand. Runs at the start of every Sphinx build; by itself:
python docs/faults_page.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces
from which_estimator_page import listed, replacements, short

from piezoest.bench.faults import FAULTS

DOCS = Path(__file__).resolve().parent
SOURCE = DOCS / "data" / "faults.json"
TARGET = DOCS / "generated" / "faults"

Document = dict[str, Any]


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def pieces(document: Document) -> dict[str, str]:
    """Texts by the name of their file."""
    machine = document["machine"]
    return {
        "outcomes": outcomes(),
        "errors": errors(document),
        "bounds": bounds(document),
        "numbers": replacements(
            {
                "faults date": document["date"][:10],
                "faults machine": f"{machine['cpu']}, {machine['cores']} cores, {machine['python']}",
                "faults rate": f"{document['sample_rate']:g} Hz",
            }
        ),
    }


def outcomes() -> str:
    """What each fault is, and what becomes of it."""
    body = [
        [name, fault.description, fault.outcome, "yes" if fault.recovers else "no"]
        for name, fault in FAULTS.items()
    ]
    return table("Faults", ["fault", "what it is", "what happens", "settles"], body)


def errors(document: Document) -> str:
    """Worst and last error of each estimator under each fault."""
    rows = {(row["fault"], row["estimator"]): row for row in document["rows"]}
    names = list(dict.fromkeys(row["estimator"] for row in document["rows"]))
    body = [
        [fault, *(cell(rows[fault, name]) for name in names)]
        for fault in dict.fromkeys(row["fault"] for row in document["rows"])
    ]
    return table("Worst error, and that of the last periods [µm]", ["fault", *names], body)


def cell(row: Document) -> str:
    if row["failure"] is not None:
        return f"failed: {row['failure']}"
    return f"{short(row['worst'])}; {short(row['after'])}" + (" ✓" if row["recovered"] else "")


def bounds(document: Document) -> str:
    """Whether anything left its bounds, in a sentence."""
    rows = document["rows"]
    broken = [
        f"{row['fault']} with ``{row['estimator']}``"
        for row in rows
        if row["failure"] is not None or not (row["finite"] and row["admissible"])
    ]
    largest = max(row["largest_voltage"] for row in rows if row["failure"] is None)
    sound = (
        f"In all {len(rows)} runs parameters and covariance stay finite and the model admissible"
        if not broken
        else f"Not so in {listed(broken)}"
    )
    limit = short(document["limits"][1])
    return f"{sound}; the largest voltage is {short(largest)} V, the limits are ±{limit} V.\n"


if __name__ == "__main__":
    write()
