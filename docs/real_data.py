"""Identify the recording that comes with the package; writes docs/data/real_data.json and its figure.

The model also predicts another recording of the same stage, which does not come with the package.
PIEZOEST_DATA, or --data, names its folder. Without it, the old numbers of that recording are kept.

    python docs/real_data.py [--data DIR] [--json FILE] [--figures DIR]
"""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from page_parts import DOCS

import piezoest as pz
from piezoest._files import save_figure
from piezoest.bench.origin import origin, put

OTHER = Path("discrete_backlash_operator") / "model_1hz.csv"


def figures_of(other: Path | None) -> tuple[dict[str, Any], pz.Identification]:
    """What the page says of the recording, and of another one that its model predicts."""
    record = pz.read_record(pz.records.example_log())
    found = pz.identify(record, validate=[] if other is None else [other])
    streamed = pz.identify_stream(pz.stream_record(pz.records.example_log(), rows=1000))
    document = {
        **origin(),
        "samples": len(record),
        "sample_rate_Hz": record.sample_rate,
        "voltage_V": [float(np.nanmin(record.voltage)), float(np.nanmax(record.voltage))],
        "displacement_um": float(np.ptp(record.displacement)),
        "identify": {
            "table": found.table(),
            "chosen": found.best.label,
            "reason": found.reason,
            "held_out": found.held_out.to_dict(),
            "line_held_out": found.line_held_out.to_dict(),
            "noise_floor_um": found.noise_floor,
            "interval_um": found.fit.spread.within,
            "covered": covered(found),
            "advice": list(found.advice),
            "candidates": [
                each.to_dict() | {"label": each.label, "chosen": each is found.best}
                for each in found.candidates
            ],
        },
        "stream": {"held_out": streamed.held_out.to_dict()},
    }
    if found.validations:
        document["other"] = found.validations[0].to_dict() | {"source": OTHER.name}
    return document, found


def covered(found: pz.Identification) -> float:
    """Part of the held-out readings that lie within the interval of 95 %."""
    predicted = found.predict()
    inside = (found.record.displacement >= predicted.lower) & (found.record.displacement <= predicted.upper)
    return float(np.mean(inside[found.trained :][np.isfinite(found.residual[found.trained :])]))


def main(
    data: Annotated[Path, typer.Option(envvar="PIEZOEST_DATA")] = DOCS.parents[1] / "shared" / "data",
    json_to: Annotated[Path, typer.Option("--json")] = DOCS / "data" / "real_data.json",
    figures: Path = DOCS / "figures",
) -> None:
    """Identify the recording that comes with the package; DATA has another one of the same stage."""
    other = data / OTHER
    document, found = figures_of(other if other.is_file() else None)
    if "other" not in document:
        print(f"no {OTHER} in {data}: what is said of it stays as it is", file=sys.stderr)
        document["other"] = json.loads(json_to.read_text(encoding="utf-8"))["other"]
    put(document, json_to)
    save_figure(found.plot(), figures / "real_data.png", dpi=90)


if __name__ == "__main__":
    typer.run(main)
