"""The picture and the table of the README, from docs/data; no number is typed by hand.

python docs/readme.py            # rewrites the table
python docs/readme.py --figure   # and draws docs/figures/effect.png, in some seconds
"""

import textwrap
from pathlib import Path
from typing import Any

import typer
from page_parts import DOCS, NEEDS, UNSETTLED, cold_start, part_of, read, since, speed_table

import piezoest as pz
from piezoest._files import save_figure, write_text
from piezoest.bench import report
from piezoest.bench.figures import new_figure
from piezoest.bench.metrics import SETTLED

README = DOCS.parent / "README.md"
FIGURE = DOCS / "figures" / "effect.png"
BEGIN, END = "<!-- figures: made by docs/readme.py -->\n", "<!-- end of figures -->\n"
ROW = "5.0 µm @ 5.0 Hz"  # of the paper's tables
TEXT = """
The first table names the best estimator over {stages} simulated stages. Its errors are means over all of
them, in % of the amplitude. The first three rows give the geometric mean of the largest errors of all periods
after the change. *A small first error* and *Rests* give the largest error of the first period, the other rows
the settled error.

The second table is for the simulated stage of the paper, except *others settle*. *Settles*: periods after a
change until every further error is below {level:g} % of the amplitude (median of the runs whose reference
repeats), and the share of these runs that settle; *others settle*: this share on the other stages. *First*:
largest error in the first period after the change. This is a mean over the kinds of change: after a cold
start it is {cold} % for AdaptiveFeedforward. *Settled*: largest error in the last half of the periods. Both
are the median over {seeds} seeds ({slow} for the slow estimators), then the geometric mean over the
scenarios. *Step*: mean time of one sample, called from Python; for AdaptiveFeedforward one `step` and one
`learn`. The stage of the paper is a sum of plays (elements with backlash), as is the model of
PrandtlIshlinskiiRLS; one of the other stages is of the family of a model inside AdaptiveFeedforward. Real
stages are neither. Measured on {machine} on {date}{since}. A dash: {dash}

With a resonance, late readings or backlash the error on your rig is larger, and it takes longer to settle: of
{cells} combinations of stage, amplitude and frequency, with a resonance, {soon} settle within {periods:g}
periods after a cold start. On {rigs} simulated rigs drawn at random, half of them with a fault, the voltage
never left its limits. On {share:.1f} % of them the error was at some time clearly larger than that of a
straight line, and on {end:.1f} % at the end. See *Safety on unknown rigs* in the documentation.

The paper measured a largest error of {linear_theirs:g} µm with linear feed-forward and {theirs:g} µm with
compensation. The same procedure gives {linear_ours:.2g} µm and {ours:.2g} µm on the simulated stage. On a
recording of a real stage that moves by {stroke:.0f} µm, the error of the identified model is {missed:.2f}
µm rms on the half that it has not seen, and that of a straight line {line:.2f} µm.
"""


def figures() -> str:
    """Tables and sentences between the marks."""
    runs, paper, recording = read("table"), read("paper"), read("real_data")
    safety = read("safety")
    rigs, cells = safety["controller"]["all"], safety["map"]["cells"]
    found = recording["identify"]
    row = {
        entry["quantity"]: entry for entry in paper["tables"] if (entry["table"], entry["row"]) == ("II", ROW)
    }
    linear, compensated = row["linear_max_error"], row["compensated_max_error"]
    values = {
        "cold": cold_start(runs),
        "dash": UNSETTLED,
        "level": 100.0 * SETTLED,
        "seeds": runs["plan"]["seeds"],
        "slow": runs["plan"]["slow_seeds"],
        "stages": len(runs["plan"]["stages"]),
        "machine": runs["machine"]["cpu"],
        "date": runs["date"][:10],
        "since": since(runs),
        "rigs": rigs["runs"],
        "cells": cells["asked"],
        "soon": cells["kept"]["cold-start"],
        "periods": safety["criteria"]["soon"],
        "share": 100.0 * rigs["violations"]["ratio"] / rigs["runs"],
        "end": 100.0 * rigs["violations"]["last_ratio"] / rigs["runs"],
        "linear_theirs": linear["value"],
        "theirs": compensated["value"],
        "linear_ours": linear["ours"],
        "ours": compensated["ours"],
        "stroke": recording["displacement_um"],
        "missed": found["held_out"]["rms_um"],
        "line": found["line_held_out"]["rms_um"],
    }
    needs = markdown(*part_of(report.needs_table(runs), NEEDS))
    speed = markdown(*speed_table(runs))
    said = [textwrap.fill(" ".join(part.split()), 118) for part in TEXT.format(**values).split("\n\n")]
    return "\n".join([*needs, "", *speed, "", "\n\n".join(said), ""])


def markdown(heading: list[str], body: list[list[str]]) -> list[str]:
    """Lines of a table, numbers to the right."""
    rule = ["---", "---" if len(body[0][1]) > 12 else "---:", *["---:"] * (len(heading) - 2)]
    return [f"| {' | '.join(row)} |" for row in (heading, rule, *body)]


def parts(text: str) -> tuple[str, str, str]:
    """What is before the marks, between them, and behind them."""
    before, rest = text.split(BEGIN)
    inside, behind = rest.split(END)
    return before + BEGIN, inside, END + behind


def draw(path: Path) -> None:
    """The error of a straight line whose gain is learnt, and of the controller, which is told the limits."""
    r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=8, sample_rate=50_000.0)
    gain, limits = pz.LinearGain(0.12), pz.VoltageLimits(-50.0, 100.0)
    learner = pz.HysteresisRLS(r.sample_rate, initial_model=gain)
    ways: dict[str, dict[str, Any]] = {
        "linear feed-forward": {"compensator": pz.LinearCompensator(gain), "estimator": learner},
        "AdaptiveFeedforward": {"controller": pz.AdaptiveFeedforward(r.sample_rate, limits=limits)},
    }
    figure = new_figure(6.4, 3.4)
    series, loop = figure.subplots(1, 2, width_ratios=[1.6, 1])
    for (name, loops), color in zip(ways.items(), ("0.55", "C0"), strict=True):
        record = pz.track(r, stage=pz.PaperStage(r.sample_rate, seed=0), **loops)
        label = f"{name}: {record.max_error(last_periods=2):.3f} µm at last"
        series.plot(record.time[::20], record.error[::20], color=color, lw=0.9, label=label)
        last = slice(-int(r.period), None, 20)
        loop.plot(record.reference[last], record.displacement[last], color=color, lw=1.6)
    loop.set(xlabel="where it should be [µm]", ylabel="where it is [µm]", title="settled", aspect="equal")
    series.set(xlabel="time [s]", ylabel="error [µm]", title="a triangle of 5 µm at 5 Hz")
    figure.legend(loc="outside lower center", frameon=False)
    for axes in (loop, series):
        axes.grid(alpha=0.3)
    save_figure(figure, path, dpi=130)


def main(figure: bool = False) -> None:
    """Rewrite the table, and draw the picture with --figure."""
    if figure:
        draw(FIGURE)
    before, _, behind = parts(README.read_text(encoding="utf-8"))
    write_text(README, before + figures() + behind)


if __name__ == "__main__":
    typer.run(main)
