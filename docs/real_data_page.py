"""Tables of the page `real_data`, made from docs/data/real_data.json; no number is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/real_data_page.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces

DOCS = Path(__file__).resolve().parent
SOURCE = DOCS / "data" / "real_data.json"
TARGET = DOCS / "generated" / "real_data"


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def pieces(document: dict[str, Any]) -> dict[str, str]:
    """Texts by the name of their file."""
    found, stream = document["identify"], document["stream"]
    values = {
        "date": document["date"][:10],
        "machine": document["machine"]["cpu"],
        "samples": document["samples"],
        "rate": f"{document['sample_rate_Hz']:g} Hz",
        "voltage": f"{document['voltage_V'][0]:.2g} to {document['voltage_V'][1]:.2g} V",
        "travel": f"{document['displacement_um']:.0f} µm",
        "held": f"{found['held_out']['rms_um']:.2f} µm",
        "line": f"{found['line_held_out']['rms_um']:.2f} µm",
        "stream": f"{stream['held_out']['rms_um']:.2f} µm",
    }
    parameters = [
        [name, f"{value:.4g}", f"± {error:.1g}" if error > 0.0 else "—", unit]
        for name, value, error, unit in found["table"]
    ]
    models = [
        [
            f"▸ {item['name']}" if item["best"] else item["name"],
            f"{item['parameters']}",
            f"{item['held_out']['rms_um']:.3f}",
            f"{item['held_out']['max_um']:.2f}",
        ]
        for item in document["choice"]["candidates"]
    ]
    return {
        "numbers": "".join(f".. |recording {name}| replace:: {value}\n" for name, value in values.items()),
        "parameters": table("Coleman-Hodgdon model", ["parameter", "value", "error", "unit"], parameters),
        "advice": "".join(f"- {sentence}\n" for sentence in found["advice"]),
        "models": table(
            "Free-running error, held-out half [µm]", ["model", "parameters", "rms", "largest"], models
        ),
        "reason": f"{document['choice']['reason']}\n",
    }


if __name__ == "__main__":
    write()
