"""The picture and the table of the README, from docs/data; no number is typed by hand.

python docs/readme.py            # rewrites the table
python docs/readme.py --figure   # and draws docs/figures/effect.png, in some seconds
"""

from __future__ import annotations

import argparse
import textwrap
from pathlib import Path
from typing import Any

from page_parts import DOCS, read

from piezoest._files import save_figure, write_text
from piezoest.bench import report

README = DOCS.parent / "README.md"
FIGURE = DOCS / "figures" / "effect.png"
BEGIN, END = "<!-- figures: made by docs/readme.py -->\n", "<!-- end of figures -->\n"
ROW = "5.0 µm @ 5.0 Hz"  # of the paper's tables
TEXT = """
Largest errors in % of the amplitude, on the simulated stage of the paper; other stages: {stages}.
Settles: periods after a change until every further error is below 1.2 %, and the share of runs that
settle. Geometric means over the scenarios of the medians over {seeds} seeds; a step is one sample from
Python. {machine}, {date}.

The paper measured {linear_theirs:g} µm with linear feed-forward and {theirs:g} µm with compensation;
its procedure gives {linear_ours:.2g} µm and {ours:.2g} µm here. On a recording of a real stage with
{travel:.0f} µm of travel, the identified model misses {missed:.2f} µm rms on the half it has not seen,
a straight line {line:.2f} µm.
"""


def figures() -> str:
    """Tables and sentences between the marks."""
    runs, paper, recording = read("table"), read("paper"), read("real_data")
    ours, theirs = (paper_row(paper, key) for key in ("ours", "value"))
    found = recording["identify"]
    values = {
        "stages": ", ".join(runs["plan"]["stages"][1:]),
        "seeds": runs["plan"]["seeds"],
        "machine": runs["machine"]["cpu"],
        "date": runs["date"][:10],
        "linear_theirs": theirs[0],
        "theirs": theirs[1],
        "linear_ours": ours[0],
        "ours": ours[1],
        "travel": recording["displacement_um"],
        "missed": found["held_out"]["rms_um"],
        "line": found["line_held_out"]["rms_um"],
    }
    needs, overview = (markdown(*table(runs)) for table in (report.needs_table, report.overview_table))
    said = [textwrap.fill(" ".join(part.split()), 118) for part in TEXT.format(**values).split("\n\n")]
    return "\n".join([*needs, "", *overview, "", "\n\n".join(said), ""])


def markdown(heading: list[str], body: list[list[str]]) -> list[str]:
    """Lines of a table, numbers to the right."""
    rows = [[name.replace("\n", " ") for name in heading], *body]
    rows.insert(1, ["---", "---" if len(body[0][1]) > 12 else "---:", *["---:"] * (len(heading) - 2)])
    return [f"| {' | '.join(row)} |" for row in rows]


def paper_row(document: dict[str, Any], key: str) -> tuple[float, float]:
    """Errors with linear feed-forward and with compensation [µm], of one row of Table II."""
    found = {
        entry["quantity"]: entry[key]
        for entry in document["tables"]
        if entry["table"] == "II" and entry["row"] == ROW
    }
    return found["linear_max_error"], found["compensated_max_error"]


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
