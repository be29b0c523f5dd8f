"""Calibrate `piezoest.PaperStage` to the triangle rows of the paper's Tables I and II.

    make calibrate          (or: python calibration/calibrate_paper_stage.py)

Sought is the smoothest stage that agrees with the paper: of all Prandtl-Ishlinskii
operators with creep whose 24 numbers and four error reductions lie within 95 % of their
tolerances, the one whose log density of thresholds has the least curvature. The weight of
the smoothness rises step by step; at each, the surrogate is corrected by the ring and the
search repeated; the last shape that passes in the ring is taken. It takes some ten minutes.

The PRBS row and Table III are held out. They are evaluated after the stage's file has been
written, for every step, only to report them: `trade_off.md`, `trade_off.json`. The form (a spline
over these knots, creep of the whole displacement with these time constants) and the estimator's
memory were settled on the calibration rows too.
"""

from __future__ import annotations

import json
import time
import warnings
from pathlib import Path
from typing import Any

import held_out
import numpy as np
import ring
import search
import shape
import surrogate
import targets

import piezoest as pz
from piezoest._files import write_text

FOLDER = Path(__file__).parent
STAGE = FOLDER.parent / "piezoest" / "stage" / "paper_stage.json"
WEIGHTS = 0.02 * 2.0 ** np.arange(9)
WITHIN = 0.95  # of every tolerance, in the ring
AIMED = 0.90  # on the surrogate, so that the ring stays within
ROUNDS = 2  # of search and correction at each weight
ENOUGH = 1.25  # worst deviation at which a larger weight is no longer tried


def main() -> None:
    """Search, check with the ring, write the stage, then look at the held-out rows."""
    warnings.filterwarnings("ignore", message=".*not in scope.*")
    steps = trade_off()
    passed = [step for step in steps if step["worst"] <= WITHIN]
    chosen = passed[-1] if passed else min(steps, key=lambda step: step["worst"])
    write_stage(chosen)
    for step in steps:  # only now
        step["held_out"] = held_out.numbers(stage_of(step["p"]), step["rows"])
    write_report(steps, chosen)


def trade_off() -> list[dict[str, Any]]:
    """The smoothest shape for each weight, with its numbers in the ring."""
    began = time.perf_counter()
    lags = surrogate.lags(pz.PaperStage())
    correction = np.ones_like(targets.PAPER[:, :6])
    p = search.approach(shape.start(), lags, correction, 1.0, 20)
    correction = ring_rows(p) / search.rows(p, lags, targets.PAPER, 25)
    p = search.approach(p, lags, correction, 1.5, 15)
    steps: list[dict[str, Any]] = []
    for weight in WEIGHTS:
        best: dict[str, Any] | None = None
        for _ in range(ROUNDS):
            p = search.smooth(p, lags, correction, weight, AIMED, 12)
            found = ring_rows(p)
            correction = found / search.rows(p, lags, targets.PAPER, 25)
            step = {"weight": weight, "p": p, "rows": found, "worst": targets.worst(found)}
            if best is None or step["worst"] < best["worst"]:
                best = step
        assert best is not None
        steps.append(best)
        print(
            f"{time.perf_counter() - began:5.0f} s  weight {weight:7.3f}"
            f"  roughness {shape.roughness(best['p']):7.1f}"
            f"  worst deviation {best['worst']:.3f} of its tolerance",
            flush=True,
        )
        if best["worst"] > ENOUGH:
            break
    return steps


def stage_of(p: Any) -> pz.SimulatedStage:
    """The whole stage: the fitted parts, the assumed ones as they stand in the file."""
    plant, paper = shape.plant(p), pz.PaperStage()
    return pz.SimulatedStage(
        paper.sample_rate,
        pz.PrandtlIshlinskii(*rounded(plant)["hysteresis"]),
        creep=pz.Creep(*rounded(plant)["creep"]),
        mechanics=paper.mechanics,
        amplifier=paper.amplifier,
        gauge=paper.gauge,
    )


def rounded(plant: surrogate.Plant) -> dict[str, Any]:
    """Hysteresis and creep to six digits, as the file has them."""

    def six(values: Any) -> Any:
        return [float(f"{value:.6g}") for value in values]

    return {
        "hysteresis": (six([plant.gain])[0], six(plant.thresholds), six(plant.weights)),
        "creep": (six(plant.creep_gains), six(plant.time_constants)),
    }


def ring_rows(p: Any) -> Any:
    """Numbers (4, 6) of the calibration rows in the ring."""
    stage = stage_of(p)
    return np.array([ring.numbers(stage, ring.triangle(*row)) for row in targets.ROWS])


def write_stage(chosen: dict[str, Any]) -> None:
    """Put the fitted numbers into the stage's file."""
    data = json.loads(STAGE.read_text(encoding="utf-8"))
    plant = rounded(shape.plant(chosen["p"]))
    gain, thresholds, weights = plant["hysteresis"]
    data["hysteresis"] = {
        "origin": (
            "Fitted to Tables I and II of Eielsen, Gravdahl and Pettersen (2012), the four triangle rows "
            "only, by calibration/calibrate_paper_stage.py: the smoothest threshold density (log density "
            "a cubic spline over the threshold) whose 24 numbers and four error reductions lie within "
            f"{WITHIN:.0%} of their tolerances in the ring. The PRBS row and Table III were not used."
        ),
        "gain": gain,
        "thresholds": thresholds,
        "weights": weights,
    }
    gains, time_constants = plant["creep"]
    data["creep"] = {
        "origin": (
            "Gains: fitted with the hysteresis, to the same rows. Time constants: from an earlier fit to "
            "the same rows, then held."
        ),
        "gains": gains,
        "time_constants": time_constants,
    }
    data["calibration"] = {
        "origin": "calibration/calibrate_paper_stage.py; the other shapes tried: calibration/trade_off.md",
        "memory": ring.MEMORY,
        "worst_deviation": round(chosen["worst"], 4),
        "columns": list(targets.COLUMNS),
        "rows": {
            f"triangle {amplitude:g} µm {frequency:g} Hz": [
                *(float(f"{value:.4g}") for value in found),
                round(float(reduction), 2),
            ]
            for (amplitude, frequency), found, reduction in zip(
                targets.ROWS, chosen["rows"], targets.reductions(chosen["rows"]), strict=True
            )
        },
    }
    write_text(STAGE, json.dumps(data, indent=1, ensure_ascii=False) + "\n")


def write_report(steps: list[dict[str, Any]], chosen: dict[str, Any]) -> None:
    """The trade-off as data and as a table."""
    table = [
        {
            "weight": step["weight"],
            "roughness": shape.roughness(step["p"]),
            "worst_deviation": step["worst"],
            "creep_gains": (shape.CREEP_UNIT * np.maximum(step["p"][shape.CREEP], 0.0)).tolist(),
            "density": np.exp(step["p"][shape.DENSITY]).tolist(),
            "gain": float(np.exp(step["p"][0])),
            "rows": step["rows"].tolist(),
            "held_out": step["held_out"],
            "chosen": step is chosen,
        }
        for step in steps
    ]
    data = {
        "rule": f"the largest weight whose worst deviation in the ring is at most {WITHIN:g}, by the "
        "calibration rows alone",
        "knots": shape.KNOTS.tolist(),
        "memory": ring.MEMORY,
        "steps": table,
    }
    write_text(FOLDER / "trade_off.json", json.dumps(data, indent=1, ensure_ascii=False) + "\n")
    write_text(FOLDER / "trade_off.md", held_out.report(table))


if __name__ == "__main__":
    main()
