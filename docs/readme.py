"""The picture and the table of the README, from docs/data; no number is typed by hand.

python docs/readme.py            # rewrites the table
python docs/readme.py --figure   # and draws docs/figures/effect.png, in some seconds
"""

from __future__ import annotations

import argparse
import json
import textwrap
from pathlib import Path
from typing import Any

from piezoest._files import save_figure, write_text

DOCS = Path(__file__).resolve().parent
README = DOCS.parent / "README.md"
FIGURE = DOCS / "figures" / "effect.png"
BEGIN, END = "<!-- figures: made by docs/readme.py -->\n", "<!-- end of figures -->\n"
ROW = "5.0 µm @ 5.0 Hz"  # of the paper's tables


def read(name: str) -> dict[str, Any]:
    return dict(json.loads((DOCS / "data" / f"{name}.json").read_text(encoding="utf-8")))


def figures() -> str:
    """Table and sentences between the marks."""
    estimators, paper, recording = read("estimators"), read("paper"), read("real_data")
    scenario, machine = estimators["scenario"], estimators["machine"]
    lines = [
        "| | largest settled error | settles after | one step |",
        "|---|---:|---:|---:|",
    ]
    for row in estimators["rows"]:
        if row["failure"] is None:
            name = row["name"] if " " in row["name"] else f"`{row['name']}`"
            lines.append(
                f"| {name} | {1e3 * row['settled_error']:.0f} nm | {periods(row['settling_periods'])} "
                f"| {short(row['step_microseconds'])} µs |"
            )
    ours, theirs = (paper_row(paper, key) for key in ("ours", "value"))
    found = recording["identify"]
    text = (
        f"The simulated stage, {scenario['amplitude_um']:g} µm at {scenario['frequency_hz']:g} Hz, all at "
        f"{scenario['sample_rate']:g} Hz, from the same wrong parameters; noise and quantisation on. "
        f"{machine['cpu']}, {estimators['date'][:10]}. The paper measured {theirs[0]:g} µm with linear "
        f"feed-forward and {theirs[1]:g} µm with compensation; its procedure gives {ours[0]:.2g} µm and "
        f"{ours[1]:.2g} µm here. On a recording of a real stage with {recording['displacement_um']:.0f} µm "
        f"of travel, the identified model misses {found['held_out']['rms_um']:.2f} µm rms on the half it has "
        f"not seen, a straight line {found['line_held_out']['rms_um']:.2f} µm."
    )
    return "\n".join([*lines, "", textwrap.fill(text, 118), ""])


def paper_row(document: dict[str, Any], key: str) -> tuple[float, float]:
    """Errors with linear feed-forward and with compensation [µm], of one row of Table II."""
    found = {
        entry["quantity"]: entry[key]
        for entry in document["tables"]
        if entry["table"] == "II" and entry["row"] == ROW
    }
    return found["linear_max_error"], found["compensated_max_error"]


def periods(number: int | None) -> str:
    """How long it takes, in words."""
    if number is None:
        return "never"
    return f"{number} period{'s' if number != 1 else ''}"


def short(value: float) -> str:
    """Two or three digits."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.1f}"


def parts(text: str) -> tuple[str, str, str]:
    """What is before the marks, between them, and behind them."""
    before, rest = text.split(BEGIN)
    inside, behind = rest.split(END)
    return before + BEGIN, inside, END + behind


def draw(path: Path) -> None:
    """Linear feed-forward and adaptive compensation, as the demonstration runs them."""
    import matplotlib.pyplot as plt
    import numpy as np

    from piezoest.demo import AMPLITUDE, FREQUENCY, SAMPLE_RATE, SETTLED_PERIODS, run_demo

    result = run_demo(periods=8)
    ways = (("linear feed-forward", result.linear, "0.55"), ("adaptive compensation", result.adaptive, "C0"))
    figure, (loop, series) = plt.subplots(
        1, 2, figsize=(10, 3.7), width_ratios=[1, 1.9], layout="constrained"
    )
    last = slice(-(result.linear.period or 0), None)
    thin = slice(None, None, 20)
    for name, record, color in ways:
        reference, time = record.reference[last], np.arange(record.error.size) / SAMPLE_RATE
        loop.plot(reference[thin], record.displacement[last][thin], color=color, lw=1.6, label=name)
        largest = record.max_error(SETTLED_PERIODS)
        series.plot(
            time[thin], record.error[thin], color=color, lw=0.9, label=f"{name}: {largest:.3f} µm at last"
        )
    loop.set(xlabel="where it should be [µm]", ylabel="where it is [µm]", title="settled")
    loop.set_aspect("equal")
    series.set(
        xlabel="time [s]", ylabel="error [µm]", title=f"a triangle of {AMPLITUDE:g} µm at {FREQUENCY:g} Hz",
        ylim=(-1.1, 1.1),
    )  # fmt: skip
    series.legend(loc="upper right")
    for axes in (loop, series):
        axes.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--figure", action="store_true", help="draw the picture too")
    given = parser.parse_args()
    if given.figure:
        draw(FIGURE)
    before, _, behind = parts(README.read_text(encoding="utf-8"))
    write_text(README, before + figures() + behind)


if __name__ == "__main__":
    main()
