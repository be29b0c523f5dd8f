"""A picture of one run: reference and displacement, voltage, error and loop, beside the lines'."""

from pathlib import Path
from typing import Any

import numpy as np

from piezoest._files import save_figure
from piezoest.bench.store import Row
from piezoest.bench.zoo.judging import Both
from piezoest.bench.zoo.rig import Rig

POINTS = 20_000  # that are drawn, at most


def write_figure(rig: Rig, row: Row, both: Both, path: Path) -> None:
    """Draw a run as PNG. `both`: traces of the controller and of the lines."""
    from matplotlib.figure import Figure

    fitted, learnt = both.lines.fitted, both.lines.learnt
    every = max(1, fitted.reference.size // POINTS)
    time = np.arange(fitted.reference.size)[::every] / rig.sample_rate
    figure = Figure(figsize=(13.0, 9.0), layout="constrained")
    panels: Any = figure.subplot_mosaic(
        [["way", "way", "loop"], ["voltage", "voltage", "loop"], ["error", "error", "last"]]
    )
    way, voltage, error = (panels[name] for name in ("way", "voltage", "error"))
    way.plot(time, fitted.reference[::every], color="k", lw=0.6, label="reference")
    runs = {"line in hindsight": fitted, "learnt line": learnt, "controller": both.run}
    for (name, run), colour in zip(runs.items(), ("#0072B2", "#009E73", "#D55E00"), strict=True):
        if run is None:
            continue
        style = {"color": colour, "lw": 0.7}
        way.plot(time, run.displacement[::every], label=name, **style)
        voltage.plot(time, run.voltage[::every], **style)
        error.plot(time, run.error[::every], **style)
        panels["loop"].plot(run.voltage[::every], run.displacement[::every], **{**style, "lw": 0.4})
        last = slice(-min(2 * rig.plain.cycle, run.error.size), None)
        panels["last"].plot(np.arange(run.error.size)[last] / rig.sample_rate, run.error[last], **style)
    way.legend(loc="upper right", fontsize=8)
    for axes in (way, voltage, error):
        axes.axvline(rig.judged_from / rig.sample_rate, color="0.5", lw=0.8)
        if rig.fault.mode != "none":
            axes.axvspan(row["fault_start"], row["fault_stop"], color="0.9", zorder=0)
    labels = {
        "way": "displacement [µm]", "voltage": "voltage [V]", "error": "error [µm]",
        "loop": "displacement [µm]", "last": "error of the last two cycles [µm]",
    }  # fmt: skip
    for name, label in labels.items():
        panels[name].set(xlabel="voltage [V]" if name == "loop" else "time [s]", ylabel=label)
    # The errors that are judged, not those of the start.
    if both.run is not None and (largest := max(row.get("worst") or 0.0, row.get("line_worst") or 0.0)) > 0.0:
        error.set_ylim(-1.2 * largest, 1.2 * largest)
    said = row.get("failure") or row.get("named") or "nothing said"
    figure.suptitle(
        f"seed {rig.seed}: {rig.family}, {rig.plain.kind}, fault {rig.fault.kind} {rig.fault.mode}; {said}"
    )
    save_figure(figure, path, dpi=100, metadata={"Software": None})
