"""Tables, numbers and figure of the page `controller`, made from docs/data; no number is typed by hand.

Runs at the start of every Sphinx build; by itself, with the figure: python docs/controller_page.py --figure
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces

from piezoest._files import save_figure

DOCS = Path(__file__).resolve().parent
TARGET = DOCS / "generated" / "controller"
FIGURE = DOCS / "figures" / "controller" / "load.png"


def read(name: str) -> Any:
    return json.loads((DOCS / "data" / f"{name}.json").read_text(encoding="utf-8"))


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(read("controller"), read("target")))


def pieces(parity: dict[str, Any], target: dict[str, Any]) -> dict[str, str]:
    """Texts by the name of their file."""
    rows = [
        [
            row["scenario"], row["estimator"], f"{row['samples']:,}".replace(",", " "),
            "0" if row["double_difference"] == 0.0 else f"{row['double_difference']:.1e}",
            f"{1e3 * row['settled_error_um']:.2f}", f"{1e3 * row['settled_error_float_um']:.2f}",
            f"{100.0 * row['float_difference']:.2f} %",
        ]
        for row in parity["rows"]
    ]  # fmt: skip
    heading = ["scenario", "estimator", "samples", "double off by", "settled [nm]", "in float [nm]", "apart"]
    counts = [
        [
            row["controller"], row["precision"], f"{row['instructions_mean']:.0f}",
            str(row["instructions_largest"]), f"{row['cycles_mean']:.0f}", str(row["cycles_largest"]),
            f"{100.0 * row['load_largest']:.0f} %", str(row["flash_controller"]), str(row["ram_state"]),
            str(row["stack"]),
        ]
        for row in target["rows"]
    ]  # fmt: skip
    count_heading = [
        "controller", "numbers", "instructions, mean", "largest", "cycles, mean", "largest",
        "of a 50 kHz sample", "flash [B]", "state [B]", "stack [B]",
    ]  # fmt: skip
    return {
        "parity": table("Generated C against the library", heading, rows),
        "target": table("On a Cortex-M4F", count_heading, counts),
        "verdict": "".join(f"- {sentence}\n" for sentence in verdict(parity, target)),
        "tools": "".join(f"- {line}\n" for line in target["tools"]),
    }


def moved_by_rounding(row: dict[str, Any]) -> float:
    """How far the library's settled error moves when its reference is rounded to float."""
    return float(abs(row["settled_error_of_rounded_reference_um"] / row["settled_error_um"] - 1.0))


def verdict(parity: dict[str, Any], target: dict[str, Any]) -> list[str]:
    """What the figures say, in sentences."""
    largest = max(row["double_difference"] for row in parity["rows"])
    said = "gives the library's voltages to the last bit" if largest == 0.0 else f"is off by {largest:.1e}"
    beyond = [row for row in parity["rows"] if row["float_difference"] > 0.01]
    inside = len(parity["rows"]) - len(beyond)
    sentences = [
        f"In double the controller {said}, in all {len(parity['rows'])} runs.",
        f"In float {inside} of {len(parity['rows'])} runs settle within 1 % of the library's error"
        + "".join(
            f"; {row['scenario']} with {row['estimator']} does not: {100.0 * row['float_difference']:.1f} %, "
            f"where the library itself, in double, moves by {100.0 * moved_by_rounding(row):.1f} % if "
            "only its reference is rounded to float"
            for row in beyond
        )
        + ".",
    ]
    for row in target["rows"]:
        if row["precision"] != "float":
            continue
        load = 100.0 * row["load_largest"]
        if load <= 50.0:
            fits = "fits 50 kHz at 168 MHz with at least half the time left"
        elif load <= 100.0:
            fits = "fits 50 kHz at 168 MHz, with less than half the time left"
        else:
            fits = "does not fit 50 kHz at 168 MHz"
        sentences.append(f"{row['controller']}, in float, {fits}: its longest step takes {load:.0f} %.")
    least = min(row["load_mean"] for row in target["rows"] if row["precision"] == "double")
    sentences.append(
        "In double no controller fits: the core has no unit for it, and the lightest one takes "
        f"{least:.0f} times a sample's time."
    )
    return sentences


def draw() -> None:
    """Draw the load of each controller."""
    from matplotlib.figure import Figure

    rows = [row for row in read("target")["rows"] if row["precision"] == "float"]
    figure = Figure(figsize=(8, 2.8), layout="constrained")
    axes = figure.subplots()
    names = [row["controller"] for row in rows]
    axes.barh(
        names, [100.0 * row["load_largest"] for row in rows], color="C0", alpha=0.4, label="longest step"
    )
    axes.barh(names, [100.0 * row["load_mean"] for row in rows], color="C0", height=0.4, label="mean")
    axes.axvline(50.0, color="0.4", ls="--", lw=1)
    axes.set(xlabel="part of a sample at 50 kHz and 168 MHz [%]", xlim=(0, None))
    axes.invert_yaxis()
    axes.legend(loc="lower right")
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, FIGURE, dpi=130)


if __name__ == "__main__":
    write()
    if "--figure" in sys.argv:
        draw()
