"""Tables of the page `tuning`, made from docs/data/tuning.json; no number is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/tuning_page.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces

DOCS = Path(__file__).resolve().parent
SOURCE = DOCS / "data" / "tuning.json"
TARGET = DOCS / "generated" / "tuning"


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def pieces(document: dict[str, Any]) -> dict[str, str]:
    """Texts by the name of their file."""
    conditions = document["conditions"]
    values = {
        "date": document["date"][:10],
        "machine": document["machine"]["cpu"],
        "signal": f"{conditions['amplitude_um']:g} µm at {conditions['frequency_Hz']:g} Hz",
        "rate": f"{conditions['sample_rate_Hz']:g} Hz",
    }
    return {
        "numbers": "".join(f".. |tuning {name}| replace:: {value}\n" for name, value in values.items()),
        "memories": memories(document["memories"]),
        "noises": noises(document["noises"]),
        "excitation": excitation(document["excitation"]),
        "delays": delays(document["delays"]),
    }


def memories(rows: list[dict[str, Any]]) -> str:
    """Worst and settled error after a step of the gain."""
    body = []
    for row in rows:
        periods = row["settling_periods"]
        body.append(
            [
                row["estimator"] if row["memory_s"] else f"{row['estimator']}, default",
                f"{row['worst_um']:.2f}",
                f"{row['settled_um']:.3f}",
                "not in the run" if periods is None else f"{periods:.0f}",
            ]
        )
    heading = ["estimator", "worst [µm]", "settled [µm]", "settles after [periods]"]
    return table("The gain falls by 20 %", heading, body)


def noises(rows: list[dict[str, Any]]) -> str:
    """Settled error against the sensor's noise."""
    memories = [key for key in rows[0] if key.startswith("memory_")]
    heading = ["noise [nm rms]", "default", "default, noise= told"]
    heading += [key.removesuffix("_um").replace("_", "=") for key in memories]
    body = [
        [f"{1e3 * row['noise_um']:g}"]
        + [f"{1e3 * row[key]:.0f}" for key in ("untold_um", "told_um", *memories)]
        for row in rows
    ]
    return table("Largest settled error [nm]", heading, body)


def excitation(rows: list[dict[str, Any]]) -> str:
    """Learnt on one trajectory, judged on all."""
    judged = [name for name in rows[0] if name not in ("estimator", "learnt")]
    body = [[row["estimator"], row["learnt"], *(f"{1e3 * row[name]:.0f}" for name in judged)] for row in rows]
    title = "Largest error [nm] with the model frozen: learnt on ↓, used on →"
    return table(title, ["estimator", "learnt on", *judged], body)


def delays(rows: list[dict[str, Any]]) -> str:
    """A sensor that lags, told and untold."""
    body = [
        [f"{row['lag_samples']:g}", f"{1e3 * row['untold_um']:.0f}", f"{1e3 * row['told_um']:.0f}"]
        for row in rows
    ]
    return table("Largest error [nm]", ["lag [samples]", "delay=0", "delay= as it is"], body)


if __name__ == "__main__":
    write()
