"""The figures of an identification."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.identification.residual import Misfit, autocorrelation
from piezoest.identification.told import Kind
from piezoest.records import Record

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# A figure is some two thousand dots wide: more samples than this only make it slow.
MOST_POINTS = 40_000
# A legend above the curves hides none of them.
ABOVE: dict[str, Any] = {
    "loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "ncols": 3, "fontsize": "small", "borderaxespad": 0.2,
}  # fmt: skip


class Drawn(NamedTuple):
    """What is drawn of an identification: of a stream, samples at equal distances.

    `errors` are those of the model and of a straight line, held out. `left_out` and `trained` count drawn
    samples; `expected` are the bounds of readings about the prediction, if they are known.
    """

    source: str
    label: str
    errors: tuple[Misfit, Misfit]
    record: Record
    prediction: FloatArray
    residual: FloatArray
    left_out: int
    trained: int
    expected: tuple[FloatArray, FloatArray] | None
    kinds: tuple[Kind, ...]


def draw(shown: Drawn) -> Figure:
    """Draw an identification: over time, the loop, the residual, and the kinds compared."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8.5), layout="constrained")
    columns = figure.add_gridspec(1, 2, width_ratios=[1.9, 1.0])
    rows = columns[0].subgridspec(3, 1, height_ratios=[0.8, 1.4, 1.2])
    voltage = figure.add_subplot(rows[0])
    series = figure.add_subplot(rows[1], sharex=voltage)
    residual = figure.add_subplot(rows[2], sharex=voltage)
    rows = columns[1].subgridspec(3, 1, height_ratios=[1.5, 1.0, 0.9])
    loop, kinds, correlation = (figure.add_subplot(rows[k]) for k in range(3))

    record, thin = shown.record, slice(None, None, max(1, len(shown.record) // MOST_POINTS))
    voltage.plot(record.time[thin], record.voltage[thin], lw=0.8, color="C2")
    voltage.set_ylabel("voltage [V]")
    series.plot(record.time[thin], record.displacement[thin], lw=1.8, color="0.7", label="measured")
    series.plot(record.time[thin], shown.prediction[thin], lw=0.8, color="C0", label="model")
    series.set_ylabel("displacement [µm]")
    _draw_residual(residual, shown, thin)
    for axes in (voltage, series, residual):
        _shade(axes, shown)
    series.legend(**ABOVE)
    for axes in (voltage, series):
        axes.tick_params(labelbottom=False)

    part = slice(shown.left_out, None, thin.step)
    loop.plot(record.voltage[part], record.displacement[part], lw=1.8, color="0.7", label="measured")
    loop.plot(record.voltage[part], shown.prediction[part], lw=0.6, color="C0", label="model")
    loop.set(xlabel="voltage [V]", ylabel="displacement [µm]", title="loop")
    loop.legend(loc="upper left", fontsize="small")

    _draw_kinds(kinds, shown.kinds)
    _draw_autocorrelation(correlation, shown)
    held_out, line = shown.errors
    figure.suptitle(
        f"{Path(shown.source).name}: {shown.label}; held out {held_out.rms:.3g} µm rms, "
        f"largest {held_out.max:.3g} µm (straight line {line.rms:.3g} µm rms)"
    )
    return figure


def _draw_residual(axes: Any, shown: Drawn, thin: slice) -> None:
    time = shown.record.time[thin]
    if shown.expected is not None:
        lower, upper = shown.expected
        axes.fill_between(
            time, lower[thin], upper[thin], color="C0", alpha=0.15, lw=0,
            label="95 of 100 readings, as expected",
        )  # fmt: skip
        axes.legend(**ABOVE)
    axes.plot(time, shown.residual[thin], lw=0.6, color="C3")
    # What was left out at the start would hide everything else.
    largest = 1.1 * float(np.nanmax(np.abs(shown.residual[shown.left_out :])))
    axes.set(xlabel="time [s]", ylabel="measured − model [µm]", ylim=(-largest, largest))


def _draw_kinds(axes: Any, kinds: tuple[Kind, ...]) -> None:
    """Errors of all kinds as dots: a straight line's may be a thousand times those of the others."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    places = np.arange(len(kinds))
    chosen = next(k for k, kind in enumerate(kinds) if kind.chosen)
    axes.axhspan(chosen - 0.5, chosen + 0.5, color="C0", alpha=0.15, lw=0)
    axes.plot([kind.left_out for kind in kinds], places, "D", color="C0", label="choice")
    held_out = [np.nan if kind.held_out is None else kind.held_out.rms for kind in kinds]
    axes.plot(held_out, places, "o", color="C1", label="held out")
    axes.set(xscale="log", yticks=places, ylim=(len(kinds) - 0.5, -0.5), xlabel="error [µm rms]")
    axes.set_yticklabels([kind.label for kind in kinds], fontsize="small")
    axes.grid(alpha=0.3)
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 30.0 * low else (1.0,)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.legend(**ABOVE)


def _shade(axes: Any, shown: Drawn) -> None:
    time = shown.record.time
    axes.axvspan(time[shown.trained], time[-1], color="C1", alpha=0.12, lw=0, label="held out")
    if shown.left_out:
        axes.axvspan(time[0], time[shown.left_out], color="0.5", alpha=0.3, lw=0)
    axes.margins(x=0.01)
    axes.grid(alpha=0.3)


def _draw_autocorrelation(axes: Any, shown: Drawn) -> None:
    residual = shown.residual[shown.left_out : shown.trained]
    lags = min(100, residual.size // 4)
    rho = autocorrelation(residual, lags)
    bound = 2.58 / np.sqrt(np.sum(np.isfinite(residual)))
    axes.vlines(np.arange(lags + 1), 0.0, rho, lw=1.0, color="C3")
    axes.axhspan(-bound, bound, color="C0", alpha=0.25, lw=0, label="white noise, 99 %")
    axes.set(
        xlabel="lag [samples drawn]", ylabel="autocorrelation", title="residual, fitted part",
        ylim=(-1.05, 1.05),
    )  # fmt: skip
    axes.axhline(0.0, color="0.3", lw=0.6)
    axes.legend(loc="lower left", fontsize="small")
