"""Pictures of the table of runs: how fast each adapts, where each is weak, and error against cost."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

from piezoest._files import save_figure
from piezoest.bench.estimators import LINEAR
from piezoest.bench.metrics import SETTLED
from piezoest.bench.report import best_first

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

DPI = 130
# Okabe and Ito's colours, told apart by all eyes, and black.
COLOURS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00",
    "#56B4E9", "#000000", "#8C6D31", "#7A68A6", "#882255",
)  # fmt: skip
MARKERS = "osD^vPX*h<"
WIDTH = 6.0  # inches: letters of ten points are read on a telephone too
GREY = "0.55"
FARTHEST = 50.0  # times the best one's error, where the colours end

Document = dict[str, Any]  # from `piezoest.bench.table.describe`


def new_figure(width: float, height: float) -> Figure:
    """Figure of this size in inches, whose parts keep out of each other's way."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def drawings(document: Document) -> dict[str, Figure]:
    """Draw all pictures of a campaign, by name."""
    found = {"overview": overview(document), "settled": profile(document), "cost": cost(document)}
    if any(cell["transient"] and cell["stage"] for cell in document["cells"]):
        found["adaptation"] = adaptation(document)
    return found


def write_figures(drawn: dict[str, Figure], folder: Path, *, quiet: bool) -> None:
    """Write figures as PNG, and say where; `quiet`: on stderr. `folder`: made if it is not there."""
    for name, figure in drawn.items():
        path = folder / f"{name}.png"
        # No date nor version within, so that the same numbers give the same file.
        save_figure(figure, path, dpi=DPI, metadata={"Software": None})
        typer.echo(f"Figure: {path}", err=quiet)


def _styles(document: Document) -> dict[str, dict[str, Any]]:
    """Colour and marker of each estimator but the tuned ones, whose lines lie on those of the untuned.

    Linear feed-forward is grey.
    """
    tuned = {each["chosen"] for each in document.get("tuned", ()) if each["chosen"] != each["default"]}
    names = [name for name in document["estimators"] if name not in {LINEAR, *tuned}]
    styles = itertools.cycle(zip(COLOURS, MARKERS, strict=True))
    looks = {
        name: {"color": color, "marker": marker} for name, (color, marker) in zip(names, styles, strict=False)
    }
    return {LINEAR: {"color": GREY, "marker": "_"}, **looks}


def overview(document: Document) -> Figure:
    """First and settled error of each estimator, with the interval that other seeds would lie in; narrow."""
    rows = [row for row in best_first(document) if row["typical"]][::-1]
    figure = new_figure(5.2, 0.4 * len(rows) + 1.5)
    axes = figure.subplots()
    shown = {
        "first": ("first period after a change", "#D55E00", "o"),
        "settled": ("settled", "#0072B2", "s"),
        "others": ("settled, stages of other families", "#009E73", "^"),
    }
    for quantity, (said, color, marker) in shown.items():
        known = [(k, row[quantity]) for k, row in enumerate(rows) if row[quantity]]
        if not known:
            continue
        middle, low, high = 100.0 * np.array([value for _, value in known]).T
        axes.errorbar(
            middle, [k for k, _ in known], xerr=[middle - low, high - middle], ls="", marker=marker,
            color=color, label=said,
        )  # fmt: skip
    axes.axvline(100.0 * SETTLED, color="0.3", ls=":", lw=1)
    axes.set_yticks(range(len(rows)), [document["estimators"][row["estimator"]]["name"] for row in rows])
    axes.set(xscale="log", xlabel="largest error [% of the amplitude]")
    _plain_numbers(axes.xaxis)
    axes.grid(alpha=0.3)
    _legend(figure, axes, 1)
    return figure


def cost(document: Document) -> Figure:
    """Settled and first error against the cost of a step, with the interval that other seeds would lie in."""
    figure = new_figure(WIDTH, 4.8)
    style = _styles(document)
    shown = {"first": "first period after a change", "settled": "once settled"}
    for axes, (quantity, said) in zip(figure.subplots(1, 2, sharex=True), shown.items(), strict=True):
        for row in document["overview"]:
            if row["estimator"] not in style:
                continue
            about, value = document["estimators"][row["estimator"]], row[quantity]
            if row["estimator"] == LINEAR and value:
                axes.axhline(100.0 * value[0], color=GREY, ls="--", lw=1, label=LINEAR)
            elif value and about.get("step_us"):
                middle, low, high = (100.0 * each for each in value)
                spread = [[middle - low], [high - middle]]
                axes.errorbar(
                    about["step_us"], middle, spread, ls="", ms=8, label=about["name"],
                    **style[row["estimator"]],
                )  # fmt: skip
        axes.set(title=said, xlabel="one step [µs]", xscale="log", yscale="log")
        low, high = axes.dataLim.intervalx
        if low == high:
            # By itself Matplotlib may leave no width around one point.
            axes.set_xlim(0.5 * low, 2.0 * high)
        _plain_numbers(axes.xaxis, (1.0,))
        _plain_numbers(axes.yaxis)
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("largest error [% of amplitude]")
    _legend(figure, figure.axes[0], 2)
    return figure


def profile(document: Document) -> Figure:
    """What each is weak at: its settled error in each scenario, relative to the best one's there."""
    from matplotlib.colors import LogNorm

    names = [row["estimator"] for row in best_first(document)]
    stage = document["plan"]["stages"][0]
    cells = [cell for cell in document["cells"] if cell["stage"] in (stage, "")]
    scenarios = list(dict.fromkeys(cell["scenario"] for cell in cells))
    settled = {(cell["scenario"], cell["estimator"]): cell["settled"][0] for cell in cells}
    table = np.array(
        [[settled.get((scenario, name), np.nan) for scenario in scenarios] for name in names], dtype=float
    )
    ratio = table / np.nanmin(table, axis=0)
    figure = new_figure(WIDTH, 0.32 * len(names) + 1.2)
    axes = figure.subplots()
    axes.imshow(np.clip(ratio, 1.0, FARTHEST), norm=LogNorm(1.0, FARTHEST), cmap="YlOrRd", aspect="auto")
    for (i, k), value in np.ndenumerate(ratio):
        text = "—" if not np.isfinite(value) else f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"
        dark = value > FARTHEST**0.6
        axes.text(k, i, text, ha="center", va="center", fontsize=9, color="white" if dark else "black")
    axes.set_xticks(range(len(scenarios)), scenarios, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), [document["estimators"][name]["name"] for name in names])
    return figure


def adaptation(document: Document) -> Figure:
    """Largest error of each period after the change, of every estimator: a panel for each scenario."""
    cells = [cell for cell in document["cells"] if cell["transient"] and cell["stage"]]
    scenarios = list(dict.fromkeys(cell["scenario"] for cell in cells))
    style = _styles(document)
    columns = 2
    rows = -(-len(scenarios) // columns)
    figure = new_figure(WIDTH, 2.1 * rows + 1.3)
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, scenario in zip(panels, scenarios, strict=False):
        mine = [cell for cell in cells if cell["scenario"] == scenario]
        for cell in (cell for cell in mine if cell["estimator"] in style):
            errors: list[Any] = [None if error is None else 100.0 * error for error in cell["transient"]]
            looks = {**style[cell["estimator"]], "lw": 1.2, "ms": 3.5}
            if cell["estimator"] == LINEAR:
                looks |= {"marker": None, "ls": "--", "zorder": 1}
            name = document["estimators"][cell["estimator"]]["name"]
            axes.plot(range(1, len(errors) + 1), errors, label=name, **looks)
        axes.axhline(100.0 * SETTLED, color="0.3", ls=":", lw=1)
        axes.set(title=scenario, xlabel=f"period ({mine[0]['period']:.3g} s each)", yscale="log")
        _plain_numbers(axes.yaxis)
        axes.grid(alpha=0.3)
        axes.xaxis.get_major_locator().set_params(integer=True)
    for axes in panels[len(scenarios) :]:
        axes.remove()
    for axes in panels[: len(scenarios) : columns]:
        axes.set_ylabel("error [%]")
    _legend(figure, panels[0], 2, "outside upper center")
    return figure


def _legend(figure: Figure, axes: Axes, columns: int, place: Any = "outside lower center") -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc=place, ncols=columns, frameon=False)


def _plain_numbers(axis: Axis, digits: tuple[float, ...] = (1.0, 2.0, 5.0)) -> None:
    """Mark a logarithmic axis with 1, 2, 5, 10 and so on, written as such."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=digits))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
