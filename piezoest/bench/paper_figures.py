"""Figures 3, 4 and 5 in the paper's layout, and what the paper lacks: adaptation and memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from piezoest.bench.figures import WIDTH, new_figure
from piezoest.bench.paper import MEMORY, PRBS, SETTLED, SWEPT, PaperResult, Run, last_periods
from piezoest.models import ColemanHodgdon
from piezoest.tracking import draw_map, draw_series

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WAYS = {"linear": "linear feed-forward", "inverse": "hysteresis compensation"}


def drawings(result: PaperResult) -> dict[str, Figure]:
    """Draw all figures, by name."""
    triangle, prbs = SWEPT.name, PRBS.name
    found = {
        "figure3": input_output_map(result.inverse[triangle]),
        "figure4": triangle_tracking(result.linear[triangle], result.inverse[triangle]),
        "figure5": prbs_tracking(result.linear[prbs], result.inverse[prbs]),
        "adaptation": adaptation(result),
    }
    return found | {"memory": error_against_memory(result)} if result.sweep else found


def input_output_map(run: Run) -> Figure:
    """Fig. 3: displacement over voltage, the stage's and that of the identified model."""
    record = last_periods(run.stationary, 1)
    voltage, displacement = record.voltage, record.displacement
    model = ColemanHodgdon(*run.parameters)
    # Round after round, until the model's loop has closed as the stage's has.
    response = model.simulate(np.tile(voltage, 10), allow_jumps=True)[-voltage.size :]
    figure = new_figure(5.2, 4.2)
    axes = figure.subplots()
    axes.plot(voltage, displacement, color="0.55", lw=3.0, label="stage")
    axes.plot(voltage, response, color="C0", lw=1.0, label="identified model")
    axes.set(xlabel="voltage [V]", ylabel="displacement [µm]")
    axes.set_title(f"Fig. 3: {run.experiment.reference.name}")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left")
    return figure


def triangle_tracking(linear: Run, inverse: Run) -> Figure:
    """Fig. 4: time series (a), (b) and reference-to-displacement maps (c), (d)."""
    figure = new_figure(WIDTH, 7.6)
    panels = figure.subplot_mosaic([["a", "a"], ["b", "b"], ["c", "d"]], height_ratios=[1.0, 1.0, 1.2])
    for letters, run in (("ac", linear), ("bd", inverse)):
        _series(panels[letters[0]], letters[0], run, periods=2)
        draw_map(panels[letters[1]], last_periods(run.stationary, 1))
        panels[letters[1]].set_title(f"({letters[1]}) {WAYS[run.experiment.compensation]}", fontsize="medium")
    _legend(figure)
    figure.suptitle(f"Fig. 4: {linear.experiment.reference.name}")
    return figure


def prbs_tracking(linear: Run, inverse: Run) -> Figure:
    """Fig. 5: time series (a), (b) of the filtered PRBS."""
    figure = new_figure(WIDTH, 5.2)
    for axes, letter, run in zip(figure.subplots(2, 1), "ab", (linear, inverse), strict=True):
        _series(axes, letter, run, periods=1)
    _legend(figure)
    figure.suptitle(f"Fig. 5: {linear.experiment.reference.name}")
    return figure


def adaptation(result: PaperResult) -> Figure:
    """Largest error of each period after the start, for every row of Table II."""
    figure = new_figure(WIDTH, 4.6)
    axes = figure.subplots(1, 2, sharey=True)
    for ax, way, runs in ((axes[0], "linear", result.linear), (axes[1], "inverse", result.inverse)):
        for (name, run), marker in zip(runs.items(), "os^vD", strict=True):
            end = run.period * np.arange(1, len(run.errors) + 1)
            (line,) = ax.plot(end, run.errors, f"{marker}-", ms=3.5, lw=1.0, label=name)
            if (settled := run.settling_periods) is not None:
                ax.plot(end[settled], run.errors[settled], marker, ms=9.0, mfc="none", color=line.get_color())
        ax.set(xlabel="time [s]", yscale="log", title=WAYS[way])
        ax.grid(alpha=0.3, which="both")
    axes[0].set_ylabel("largest error of the period [µm]")
    _legend(figure, columns=2)
    figure.suptitle(
        f"Memory {MEMORY:g} s; ringed: first period that stays within\n"
        f"{100.0 * (SETTLED - 1.0):.0f} % of the stationary error",
        fontsize="medium",
    )
    return figure


def error_against_memory(result: PaperResult) -> Figure:
    """Stationary error and time to settle over the memory of the estimator."""
    memory = np.array(list(result.sweep))
    runs = list(result.sweep.values())
    figure = new_figure(WIDTH, 5.6)
    left, right = figure.subplots(2, 1, sharex=True)
    left.loglog(memory, [run.max_error for run in runs], "o-")
    left.loglog(MEMORY, result.sweep[MEMORY].max_error, "o", ms=11.0, mfc="none", color="C3")
    left.set(ylabel="largest stationary error [µm]")
    times = [np.nan if run.settling_time is None else run.settling_time for run in runs]
    right.semilogx(memory, times, "o-")
    right.set(xlabel="memory [s]", ylabel="settles after [s]")
    for axes in (left, right):
        axes.set_xticks(memory, [f"{value:g}" for value in memory], minor=False)
        axes.set_xticks([], minor=True)
        axes.axvline(runs[0].period, color="0.6", ls="--", lw=1.0)
        axes.text(
            runs[0].period, 0.98, " one period", transform=axes.get_xaxis_transform(), va="top", color="0.4"
        )
        axes.grid(alpha=0.3, which="both")
    figure.suptitle(
        f"{runs[0].experiment.reference.name}; ringed: the memory of the tables", fontsize="medium"
    )
    return figure


def _series(axes: Any, letter: str, run: Run, periods: int) -> None:
    draw_series(axes, last_periods(run.stationary, periods))
    axes.get_legend().remove()
    axes.set_title(
        f"({letter}) {WAYS[run.experiment.compensation]}: largest error {run.max_error:.3f} µm",
        fontsize="medium",
    )


def _legend(figure: Figure, columns: int = 3) -> None:
    """One legend for all series, where it hides nothing: the curves are the same in each."""
    handles = [line for axes in figure.axes for line in axes.get_lines()]
    by_name = {str(line.get_label()): line for line in handles if not str(line.get_label()).startswith("_")}
    figure.legend(by_name.values(), by_name.keys(), loc="outside lower center", ncols=columns)
