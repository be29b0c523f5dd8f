"""Pictures of a ranking and of a campaign: what is efficient, and how fast each adapts."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from piezoest._files import save_figure
from piezoest.bench.estimators import REFERENCE
from piezoest.bench.recorded import file_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

DPI = 130
SETTLED = 0.012  # of the amplitude
# Okabe and Ito's colours, told apart by all eyes, and black.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31", "#7A68A6")
MARKERS = "osD^vPX*h"
GREY = "0.55"
FARTHEST = 50.0  # times the best one's error, where the colours end

Document = dict[str, Any]


def write_figures(document: Document, folder: Path) -> list[Path]:
    """Draw a ranking.

    Parameters
    ----------
    document : dict
        From `piezoest.bench.ranking.describe`.
    folder : Path
        To write to; made if it is not there.

    Returns
    -------
    list of Path
    """
    return _write({"pareto": pareto, "profile": profile}, document, folder)


def write_adaptation(document: Document, folder: Path) -> list[Path]:
    """Draw how fast each estimator of a campaign adapts.

    Parameters
    ----------
    document : dict
        From `piezoest.bench.suite.describe`.
    folder : Path
        To write to; made if it is not there.

    Returns
    -------
    list of Path
    """
    return _write({"adaptation": adaptation}, document, folder)


def _write(drawings: dict[str, Callable[[Document], Figure]], document: Document, folder: Path) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, draw in drawings.items():
        paths.append(folder / f"{name}.png")
        # No date nor version within, so that the same numbers give the same file.
        save_figure(draw(document), paths[-1], dpi=DPI, metadata={"Software": None})
    return paths


def styles(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Colour and marker of each estimator; linear feed-forward is grey.

    Parameters
    ----------
    names : sequence of str
        In the order of the colours.
    """
    found: dict[str, dict[str, Any]] = {REFERENCE: {"color": GREY, "marker": "_"}}
    styles = zip(itertools.cycle(COLOURS), itertools.cycle(MARKERS), strict=True)
    for name, (color, marker) in zip((name for name in names if name != REFERENCE), styles, strict=False):
        found[name] = {"color": color, "marker": marker}
    return found


def pareto(document: Document) -> Figure:
    """Error against cost: while adapting, settled, and the worst; the efficient ones on a line.

    Parameters
    ----------
    document : dict
        From `piezoest.bench.ranking.describe`.
    """
    from matplotlib.figure import Figure

    lines = [line for line in document["overall"] if line["step_microseconds"] is not None]
    shown = {"adapting": "while it adapts", "settled": "once settled", "worst": "worst after a change"}
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    style = styles(sorted(line["name"] for line in lines))
    for axes, (quantity, said) in zip(figure.subplots(1, 3, sharex=True), shown.items(), strict=True):
        _pareto_panel(axes, lines, quantity, style)
        linear = next(line for line in document["overall"] if line["name"] == REFERENCE)
        axes.axhline(100.0 * linear[quantity], color=GREY, ls="--", lw=1, label=REFERENCE)
        axes.set(title=said, xlabel="cost of a step [µs]")
    figure.axes[0].set_ylabel("error [% of the amplitude]")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _pareto_panel(axes: Axes, lines: list[Document], quantity: str, style: dict[str, dict[str, Any]]) -> None:
    import numpy as np

    from piezoest.bench.verdicts import efficient

    points = np.array([[line["step_microseconds"], line[quantity] or np.inf] for line in lines])
    front = points[efficient(points)]
    front = front[np.argsort(front[:, 0])]
    axes.step(front[:, 0], 100.0 * front[:, 1], where="post", color="0.8", lw=3, zorder=0)
    for line, (cost, error) in zip(lines, points, strict=True):
        axes.plot(cost, 100.0 * error, ls="", ms=9, label=line["name"], **style[line["name"]])
    axes.set(xscale="log", yscale="log")
    _plain_numbers(axes.xaxis, (1.0,))
    _plain_numbers(axes.yaxis)
    axes.grid(alpha=0.3)


def _plain_numbers(axis: Axis, digits: tuple[float, ...] = (1.0, 2.0, 5.0)) -> None:
    """Mark a logarithmic axis with 1, 2, 5, 10 and so on, written as such."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=digits))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def profile(document: Document) -> Figure:
    """What each is bad at: its settled error in each scenario, in multiples of the best one's.

    Parameters
    ----------
    document : dict
        From `piezoest.bench.ranking.describe`.
    """
    import numpy as np
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    names = [line["name"] for line in document["overall"]]
    scenarios = list(dict.fromkeys(row["scenario"] for row in document["summary"]))
    values = {
        (row["scenario"], row["estimator"]): row["settled_max"]["median"] for row in document["summary"]
    }
    table = np.array(
        [
            [np.inf if (value := values.get((scenario, name))) is None else value for scenario in scenarios]
            for name in names
        ]
    )
    ratio = table / table.min(axis=0)
    figure = Figure(figsize=(11, 0.42 * len(names) + 2.2), layout="constrained")
    axes = figure.subplots()
    shown = np.where(np.isfinite(ratio), ratio, FARTHEST)
    image = axes.imshow(shown, norm=LogNorm(1.0, FARTHEST), cmap="YlOrRd", aspect="auto")
    for (i, k), value in np.ndenumerate(ratio):
        text = "—" if not np.isfinite(value) else f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"
        dark = value > FARTHEST**0.6
        axes.text(k, i, text, ha="center", va="center", fontsize=9, color="white" if dark else "black")
    axes.set_xticks(range(len(scenarios)), [name.replace(", ", ",\n") for name in scenarios], rotation=35)
    for label in axes.get_xticklabels():
        label.set_horizontalalignment("right")
    axes.set_yticks(range(len(names)), names)
    bar = figure.colorbar(image, ax=axes, label="settled error / the best one's", pad=0.01)
    _plain_numbers(bar.ax.yaxis, (1.0, 3.0))
    return figure


def adaptation(document: Document) -> Figure:
    """Small multiples: largest error of each period after the change, of every estimator and scenario.

    Parameters
    ----------
    document : dict
        From `piezoest.bench.suite.describe`.
    """
    from matplotlib.figure import Figure

    # A log has no change after which there would be periods.
    scenarios = [name for name in document["scenarios"] if file_of(name) is None]
    style = styles([name for name in document["estimators"] if name != REFERENCE])
    columns = 3
    rows = -(-len(scenarios) // columns)
    figure = Figure(figsize=(11, 2.9 * rows + 0.9), layout="constrained")
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, scenario in zip(panels, scenarios, strict=False):
        mine = [row for row in document["summary"] if row["scenario"] == scenario]
        for row in mine:
            _transient(axes, row, style[row["estimator"]])
        axes.axhline(100.0 * SETTLED, color="0.3", ls=":", lw=1)
        seconds = max(row["period"] or 0.0 for row in mine)
        axes.set(title=scenario, xlabel=f"period after the change ({seconds:.3g} s each)", yscale="log")
        _plain_numbers(axes.yaxis)
        axes.grid(alpha=0.3)
        axes.xaxis.get_major_locator().set_params(integer=True)
    for axes in panels[len(scenarios) :]:
        axes.remove()
    for axes in panels[: len(scenarios) : columns]:
        axes.set_ylabel("error [% of amplitude]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def _transient(axes: Axes, row: Document, style: dict[str, Any]) -> None:
    errors: list[Any] = [
        None if error is None else 100.0 * error / row["amplitude"] for error in row["transient"]
    ]
    periods = range(1, len(errors) + 1)
    looks: dict[str, Any] = {**style, "lw": 1.4, "ms": 4, "markevery": max(1, len(errors) // 12)}
    if row["estimator"] == REFERENCE:
        looks |= {"marker": None, "ls": "--", "zorder": 1}
    axes.plot(periods, errors, label=row["estimator"], **looks)
