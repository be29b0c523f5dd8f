"""The rows that take no part in the calibration: the PRBS row and Table III."""

from __future__ import annotations

from typing import Any

import numpy as np
import ring
import targets

PRBS = np.array([3.32e-2, 1.36e-1, 6.15e-3, 0.154, 0.71, 0.30])
PRBS_REDUCTION = 59.0  # %
BOUNDS = np.array([0.15, 0.03, 0.15, 0.03, 0.10, 0.20])
REDUCTION_BOUND = 6.0  # points
# Row applied, row of the parameters, error [µm]: Table III.
CROSSED = ((0, 3, 0.28), (3, 0, 0.67))
CROSSED_BOUND = 0.20


def numbers(stage: Any, rows: Any) -> dict[str, Any]:
    """Ours for the held-out rows; `rows` are the calibration rows, whose parameters Table III swaps."""
    found = ring.numbers(stage, ring.prbs())
    crossed = _crossed(stage, rows)
    published = _crossed(stage, targets.PAPER)
    return {
        "prbs": found.tolist(),
        "prbs_error_reduction": float(targets.reductions(found[None])[0]),
        "prbs_ratios": (found / PRBS).tolist(),
        "table_3": crossed,
        "table_3_ratios": _ratios(crossed),
        "table_3_ratios_with_published_parameters": _ratios(published),
    }


def _crossed(stage: Any, rows: Any) -> list[float]:
    """Table III: each row with the other's parameters, which `rows` has."""
    return [
        ring.with_parameters_of(stage, ring.triangle(*targets.ROWS[applied]), rows[other][:3])
        for applied, other, _ in CROSSED
    ]


def _ratios(crossed: list[float]) -> list[float]:
    return [error / paper for error, (_, _, paper) in zip(crossed, CROSSED, strict=True)]


def worst(held_out: dict[str, Any]) -> float:
    """The largest deviation in parts of its bound."""
    prbs = np.abs(np.array(held_out["prbs_ratios"]) - 1.0) / BOUNDS
    reduction = abs(held_out["prbs_error_reduction"] - PRBS_REDUCTION) / REDUCTION_BOUND
    crossed = np.abs(np.array(held_out["table_3_ratios"]) - 1.0) / CROSSED_BOUND
    return float(max(prbs.max(), reduction, crossed.max()))


def report(steps: list[dict[str, Any]]) -> str:
    """The trade-off as a table in Markdown."""
    head = """# Smoothness against agreement

Written by `calibrate_paper_stage.py`. Each line is the smoothest stage for one weight of the
smoothness. The worst deviation is that of the calibration rows, in parts of its tolerance, measured
in the ring; the choice (in bold) is by that column alone: the largest weight whose worst deviation is
at most 0.95. The columns to its right were computed after the choice and took no part in it: ratios of
ours to the paper's for the PRBS row, its error reduction (paper: 59 %), the two ratios of Table III, and
the worst of these in parts of its bound. The last two columns drive the stage with the parameters that
the paper's Table I prints instead of its own: they tell an error of the stage from one of the parameters.

| weight | roughness | worst deviation | PRBS α | β | γ | K | linear | compensated | reduction [%] | III: 2.5 µm | III: 7.5 µm | worst held out | III: 2.5 µm, published | III: 7.5 µm, published |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|
"""  # noqa: E501
    lines = []
    for step in steps:
        other = step["held_out"]
        cells = [
            f"{step['weight']:.3g}",
            f"{step['roughness']:.1f}",
            f"{step['worst_deviation']:.3f}",
            *(f"{ratio:.3f}" for ratio in other["prbs_ratios"]),
            f"{other['prbs_error_reduction']:.1f}",
            *(f"{ratio:.2f}" for ratio in other["table_3_ratios"]),
            f"{worst(other):.2f}",
            *(f"{ratio:.2f}" for ratio in other["table_3_ratios_with_published_parameters"]),
        ]
        lines.append("| " + " | ".join(f"**{cell}**" if step["chosen"] else cell for cell in cells) + " |")
    return head + "\n".join(lines) + "\n"
