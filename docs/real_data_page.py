"""Tables of the page `real_data`, made from docs/data/real_data.json; no number is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/real_data_page.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces
from which_estimator_page import percent, replacements

DOCS = Path(__file__).resolve().parent
SOURCE = DOCS / "data" / "real_data.json"
TARGET = DOCS / "generated" / "real_data"


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def pieces(document: dict[str, Any]) -> dict[str, str]:
    """Texts by the name of their file."""
    found = document["identify"]
    return {
        "numbers": numbers(document),
        "parameters": parameters(found["chosen"], found["table"]),
        "advice": "".join(f"- {sentence}\n" for sentence in found["advice"]),
        "models": models(found["candidates"]),
        "reason": f"{found['reason']}\n",
    }


def numbers(document: dict[str, Any]) -> str:
    """Substitutions for numbers that stand in sentences."""
    found, other = document["identify"], document["other"]
    lengths = {
        "held": found["held_out"], "line": found["line_held_out"], "stream": document["stream"]["held_out"],
        "other": other["error"], "other without mean": other["without_mean"],
    }  # fmt: skip
    values = {
        "date": document["date"][:10],
        "machine": document["machine"]["cpu"],
        "samples": document["samples"],
        "rate": f"{document['sample_rate_Hz']:g} Hz",
        "voltage": f"{document['voltage_V'][0]:.2g} to {document['voltage_V'][1]:.2g} V",
        "travel": f"{document['displacement_um']:.0f} µm",
        "noise": f"{found['noise_floor_um']:.2f} µm",
        "interval": f"{found['interval_um']:.2f} µm",
        "covered": percent(found["covered"]),
        "other file": f"``{other['source']}``",
        **{name: f"{each['rms_um']:.2f} µm" for name, each in lengths.items()},
    }
    return replacements({f"recording {name}": value for name, value in values.items()})


def parameters(model: str, rows: list[Any]) -> str:
    """Parameters of the chosen model."""
    body = [
        [name, f"{value:.4g}", f"± {error:.1g}" if error > 0.0 else "—", unit]
        for name, value, error, unit in rows
    ]
    return table(model, ["parameter", "value", "standard error", "unit"], body)


def models(candidates: list[dict[str, Any]]) -> str:
    """Errors of all kinds."""
    body = [
        [
            f"▸ {item['label']}" if item["chosen"] else item["label"], f"{item['parameters']}",
            *(f"{item[name]:.3f}" for name in ("cross_validated_um", "ahead_um")),
            f"{item['held_out']['rms_um']:.3f}", f"{item['held_out']['max_um']:.2f}",
        ]
        for item in candidates
    ]  # fmt: skip
    heading = ["model", "parameters", "blocks", "ahead", "held out", "held out, largest"]
    return table("Free-running error [µm], rms but for the last column", heading, body)


if __name__ == "__main__":
    write()
