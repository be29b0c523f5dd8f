"""The table of the page `faults`, from piezoest.bench.faults.

Runs at the start of every Sphinx build; by itself: python docs/faults_page.py
"""

from __future__ import annotations

from typing import Any

from paper_page import DOCS, table, write_pieces

from piezoest.bench.faults import FAULTS


def write(app: Any = None) -> None:
    """Write what the page includes: what each fault is, and what becomes of it."""
    body = [
        [name, fault.description, fault.outcome, "yes" if fault.recovers else "no"]
        for name, fault in FAULTS.items()
    ]
    outcomes = table("Faults", ["fault", "what it is", "what happens", "settles"], body)
    write_pieces(DOCS / "generated" / "faults", {"outcomes": outcomes})


if __name__ == "__main__":
    write()
