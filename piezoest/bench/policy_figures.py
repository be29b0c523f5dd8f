"""Pictures of policies: what the error does after a change, for each policy and each scenario."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from piezoest._files import save_figure
from piezoest.bench.combinations import COMBINATIONS, Combination
from piezoest.bench.estimators import REFERENCE
from piezoest.bench.metrics import SETTLED
from piezoest.bench.ranking_figures import DPI, GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Two pictures, so that a panel is large enough to be read.
PICTURES = {
    "changes": ("cold-start", "amplitude-switch", "amplitude-drop", "gain-step", "drift"),
    "references": ("dwell", "noise", "prbs", "random-walk", "two-tone"),
}
LOWEST, HIGHEST = 0.2, 400.0  # % of the amplitude; what is above ends at the edge
WIDTH = 24  # letters beside a panel
FIRST = 15  # periods that are shown: a drift has many more
DEFAULT = COMBINATIONS[0].estimator

Document = dict[str, Any]


def write_policies(document: Document, folder: Path) -> list[Path]:
    """Draw the transient of each policy on each scenario that was run.

    Parameters
    ----------
    document : dict
        What `piezoest bench adaptation --policies --json` writes.
    folder : Path
        To write to; made if it is not there.

    Returns
    -------
    list of Path
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, scenarios in PICTURES.items():
        if there := [scenario for scenario in scenarios if scenario in document["scenarios"]]:
            paths.append(folder / f"{name}.png")
            # No version within, so that the same numbers give the same file.
            save_figure(transients(document, there), paths[-1], dpi=DPI, metadata={"Software": None})
    return paths


def transients(document: Document, scenarios: Sequence[str]) -> Figure:
    """Small multiples: a row for each policy, a column for each scenario.

    Parameters
    ----------
    document : dict
        What `piezoest bench adaptation --policies --json` writes.
    scenarios : sequence of str
        Some of the document's.
    """
    from matplotlib.figure import Figure

    rows = {(row["scenario"], row["estimator"]): row for row in document["summary"]}
    shown = [one for one in COMBINATIONS if (scenarios[0], one.estimator) in rows]
    figure = Figure(figsize=(2.1 + 1.9 * len(scenarios), 0.7 + 0.92 * len(shown)), layout="constrained")
    panels = figure.subplots(len(shown), len(scenarios), sharex="col", sharey=True, squeeze=False)
    for one, line in zip(shown, panels, strict=True):
        for scenario, axes in zip(scenarios, line, strict=True):
            for estimator, style in (
                (REFERENCE, {"color": GREY, "ls": ":", "lw": 1.2}),
                (DEFAULT, {"color": GREY, "lw": 2.4, "alpha": 0.6}),
                (one.estimator, {"color": "#D55E00", "lw": 1.4, "marker": "o", "ms": 2.4}),
            ):
                _transient(axes, rows[scenario, estimator], style)
            axes.axhline(100.0 * SETTLED, color="0.3", lw=0.6)
        _name(line[0], one)
    for scenario, axes in zip(scenarios, panels[0], strict=True):
        axes.set_title(scenario, fontsize=10)
    for axes in panels[-1]:
        axes.set_xlabel("period after the change", fontsize=8)
    _legend(figure)
    return figure


def _transient(axes: Axes, row: Document, style: dict[str, Any]) -> None:
    """Median error of each period, held within the picture."""
    errors = [
        HIGHEST if error is None else min(HIGHEST, 100.0 * error / row["amplitude"])
        for error in itertools.islice(row["transient"], FIRST)
    ]
    axes.plot(range(1, len(errors) + 1), errors, **style)


def _name(axes: Axes, one: Combination) -> None:
    axes.set(yscale="log", ylim=(LOWEST, HIGHEST))
    axes.set_yticks([1.0, 10.0, 100.0], ["1 %", "10 %", "100 %"])
    for each in axes.figure.axes:
        each.tick_params(labelsize=7)
        each.yaxis.set_tick_params(which="minor", left=False)
        each.locator_params(axis="x", integer=True)
    axes.set_ylabel(
        "\n".join([one.name, *textwrap.wrap(one.said, WIDTH)]),
        rotation=0, ha="right", va="center", fontsize=8,
    )  # fmt: skip


def _legend(figure: Figure) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D(
            [], [], color="#D55E00", lw=1.4, marker="o", ms=2.4, label="with the policies named on the left"
        ),
        Line2D([], [], color=GREY, lw=2.4, alpha=0.6, label="the default"),
        Line2D([], [], color=GREY, lw=1.2, ls=":", label=REFERENCE),
        Line2D([], [], color="0.3", lw=0.6, label=f"settled: {100.0 * SETTLED:g} % of the amplitude"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False, fontsize=8)
