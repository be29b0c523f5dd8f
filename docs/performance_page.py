"""Tables of the page `performance`, made from docs/data/speed.json; no number is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/performance_page.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from paper_page import DOCS, table, write_pieces

SOURCE = DOCS / "data" / "speed.json"
TARGET: Path = DOCS / "generated" / "performance"


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def pieces(document: dict[str, Any]) -> dict[str, str]:
    """Texts by the name of their file."""
    machine = document["machine"]
    targets = [
        [row["what"], f"{row['figure']:.3g}", f"{row['target']:g}", "✓" if row["met"] else "✗"]
        for row in document["targets"]
    ]
    times = [
        [name, f"{value:.1f}", ", ".join(f"{number:.4g}" for number in document["outcome"].get(name, [])[:3])]
        for name, value in document["nanoseconds_per_sample"].items()
    ]
    bank = [
        [str(row["channels"]), *(f"{row[name]:.1f}" for name in ("1", "2", "C"))] for row in document["bank"]
    ]
    return {
        "targets": table("Figures and targets", ["what", "figure", "target", "met"], targets),
        "times": table("Time per sample, and what came out", ["what", "ns", "first numbers"], times),
        "bank": table(
            "A bank: ns per channel and sample", ["channels", "one core", "two cores", "C, one core"], bank
        ),
        "conditions": (
            f"{machine['cpu']}, {machine['cores']} cores, Python {machine['python']}, "
            f"Numba {machine['numba']}; "
            f"C by ``{document['compiler']}``; medians of {document['rounds']} interleaved rounds of "
            f"{document['samples']} samples. ``warmup()`` took {document['cold']['warmup']:.2f} s with a "
            "warm cache.\n"
        ),
    }


if __name__ == "__main__":
    write()
