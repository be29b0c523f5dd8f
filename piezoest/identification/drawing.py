"""The figure of an identification."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from piezoest.identification.residual import autocorrelation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# A figure is some two thousand dots wide: more samples than this only make it slow.
MOST_POINTS = 40_000
# A legend above the curves hides none of them.
ABOVE: dict[str, Any] = {
    "loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "ncols": 3, "fontsize": "small", "borderaxespad": 0.2,
}  # fmt: skip


def draw(found: Any) -> Figure:
    """Draw an `Identification`: over time, the loop, the residual, and the kinds compared."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8.5), layout="constrained")
    columns = figure.add_gridspec(1, 2, width_ratios=[1.9, 1.0])
    rows = columns[0].subgridspec(3, 1, height_ratios=[0.8, 1.4, 1.2])
    voltage = figure.add_subplot(rows[0])
    series = figure.add_subplot(rows[1], sharex=voltage)
    residual = figure.add_subplot(rows[2], sharex=voltage)
    rows = columns[1].subgridspec(3, 1, height_ratios=[1.5, 1.0, 0.9])
    loop, kinds, correlation = (figure.add_subplot(rows[k]) for k in range(3))

    record, error, start = found.record, found.residual, found.left_out
    thin = slice(None, None, max(1, len(record) // MOST_POINTS))
    voltage.plot(record.time[thin], record.voltage[thin], lw=0.8, color="C2")
    voltage.set_ylabel("voltage [V]")
    series.plot(record.time[thin], record.displacement[thin], lw=1.8, color="0.7", label="measured")
    series.plot(record.time[thin], found.prediction[thin], lw=0.8, color="C0", label="model, free-running")
    series.set_ylabel("displacement [µm]")
    expected = found.predict()
    lower, upper = expected.lower - expected.x, expected.upper - expected.x
    residual.fill_between(
        record.time[thin], lower[thin], upper[thin], color="C0", alpha=0.15, lw=0,
        label="95 of 100 readings, as expected",
    )  # fmt: skip
    residual.plot(record.time[thin], error[thin], lw=0.6, color="C3")
    residual.set(xlabel="time [s]", ylabel="measured − model [µm]")
    # What was left out at the start would hide everything else.
    largest = 1.1 * float(np.nanmax(np.abs(error[start:])))
    residual.set_ylim(-largest, largest)
    residual.legend(**ABOVE)
    for axes in (voltage, series, residual):
        _shade(axes, found)
    series.legend(**ABOVE)
    for axes in (voltage, series):
        axes.tick_params(labelbottom=False)

    part = slice(start, None, thin.step)
    loop.plot(record.voltage[part], record.displacement[part], lw=1.8, color="0.7", label="measured")
    loop.plot(record.voltage[part], found.prediction[part], lw=0.6, color="C0", label="model")
    loop.set(xlabel="voltage [V]", ylabel="displacement [µm]", title="loop")
    loop.legend(loc="upper left", fontsize="small")

    _draw_kinds(kinds, found)
    _draw_autocorrelation(correlation, found)
    figure.suptitle(
        f"{Path(record.source).name}: {found.best.label}; held out {found.held_out.rms:.3g} µm rms, "
        f"largest {found.held_out.max:.3g} µm (straight line {found.line_held_out.rms:.3g} µm rms)"
    )
    return figure


def _draw_kinds(axes: Any, found: Any) -> None:
    """Errors of all kinds as dots: a straight line's may be a thousand times those of the others."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    items = found.candidates
    places = np.arange(len(items))
    chosen = next(k for k, item in enumerate(items) if item is found.best)
    axes.axhspan(chosen - 0.5, chosen + 0.5, color="C0", alpha=0.15, lw=0)
    axes.plot([item.cross_validated for item in items], places, "D", color="C0", label="blocks left out")
    axes.plot([item.held_out.rms for item in items], places, "o", color="C1", label="held out")
    axes.set(xscale="log", yticks=places, ylim=(len(items) - 0.5, -0.5), xlabel="error [µm rms]")
    axes.set_yticklabels([item.label for item in items], fontsize="small")
    axes.grid(alpha=0.3)
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 30.0 * low else (1.0,)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.legend(**ABOVE)


def _shade(axes: Any, found: Any) -> None:
    time = found.record.time
    axes.axvspan(time[found.trained], time[-1], color="C1", alpha=0.12, lw=0, label="held out")
    if found.left_out:
        axes.axvspan(time[0], time[found.left_out], color="0.5", alpha=0.3, lw=0)
    axes.margins(x=0.01)
    axes.grid(alpha=0.3)


def _draw_autocorrelation(axes: Any, found: Any) -> None:
    residual = found.residual[found.left_out : found.trained]
    lags = min(100, residual.size // 4)
    rho = autocorrelation(residual, lags)
    bound = 2.58 / np.sqrt(np.sum(np.isfinite(residual)))
    axes.vlines(np.arange(lags + 1), 0.0, rho, lw=1.0, color="C3")
    axes.axhspan(-bound, bound, color="C0", alpha=0.25, lw=0, label="white noise, 99 %")
    axes.set(
        xlabel="lag [samples]", ylabel="autocorrelation", title="residual, fitted part", ylim=(-1.05, 1.05)
    )
    axes.axhline(0.0, color="0.3", lw=0.6)
    axes.legend(loc="lower left", fontsize="small")
