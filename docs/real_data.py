"""A recorded stage, as the page `real_data` shows it; writes docs/data/real_data.json and its figures.

The recordings are not part of this repository: PIEZOEST_DATA, or --data, names their folder. Without them the
files stay as they are.

    python docs/real_data.py [--data DIR] [--json FILE] [--figures DIR]
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz
from piezoest._files import save_figure
from piezoest.bench.origin import origin, put

FILE = Path("discrete_backlash_operator") / "test_1hz.csv"


def figures_of(file: Path) -> tuple[dict[str, Any], pz.Identification, pz.ModelChoice]:
    """What the page says of a recording."""
    record = pz.read_record(file)
    found, choice = pz.identify(record), pz.choose_model(record)
    streamed = pz.identify_stream(pz.stream_record(file, rows=1000))
    document = {
        **origin(),
        "samples": len(record),
        "sample_rate_Hz": record.sample_rate,
        "voltage_V": [float(np.nanmin(record.voltage)), float(np.nanmax(record.voltage))],
        "displacement_um": float(np.ptp(record.displacement)),
        "identify": {
            "table": found.table(),
            "held_out": found.held_out.to_dict(),
            "line_held_out": found.line_held_out.to_dict(),
            "left_out_s": found.left_out / record.sample_rate,
            "advice": list(found.advice),
        },
        "stream": {"table": streamed.table(), "held_out": streamed.held_out.to_dict()},
        "choice": {
            "reason": choice.reason,
            "candidates": [
                {
                    "name": item.name,
                    "parameters": item.parameters,
                    "held_out": item.held_out.to_dict(),
                    "best": item is choice.best,
                }
                for item in choice.candidates
            ],
        },
    }
    return document, found, choice


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    docs = Path(__file__).resolve().parent
    data = Path(os.environ.get("PIEZOEST_DATA") or docs.parents[1] / "shared" / "data")
    parser.add_argument("--data", type=Path, default=data)
    parser.add_argument("--json", type=Path, default=docs / "data" / "real_data.json")
    parser.add_argument("--figures", type=Path, default=docs / "figures")
    given = parser.parse_args()
    if not (given.data / FILE).is_file():
        print(f"no recordings in {given.data}: {given.json.name} stays as it is", file=sys.stderr)
        return
    document, found, choice = figures_of(given.data / FILE)
    put(document, given.json)
    for name, drawn in (("real_data", found), ("real_data_choice", choice)):
        save_figure(drawn.plot(), given.figures / f"{name}.png", dpi=90)


if __name__ == "__main__":
    main()
