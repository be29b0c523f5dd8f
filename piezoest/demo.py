"""The demonstration: linear feed-forward against adaptive compensation, from a wrong start and from none."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from piezoest import signals
from piezoest._checks import integer
from piezoest.compensators import InverseCompensator, LinearCompensator, VoltageLimits
from piezoest.controller.adaptive_feedforward import AdaptiveFeedforward
from piezoest.estimators.output_error import OutputErrorRLS
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import ColemanHodgdon, LinearGain
from piezoest.stage import PaperStage
from piezoest.tracking import TrackingRecord, draw_map, draw_series, track

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AMPLITUDE = 5.0  # µm
FREQUENCY = 5.0  # Hz
SAMPLE_RATE = 50_000.0  # Hz
# Away from what the stage turns out to have by a factor of about two.
WRONG_MODEL = ColemanHodgdon(alpha=0.035, beta=0.07, gamma=0.0035)
WRONG_GAIN = LinearGain(0.1)
LIMITS = VoltageLimits(minimum=-50.0, maximum=100.0)  # V: all that the controller is told
# Of the controller. With all that it has by default, a first demonstration takes three times as long.
ESTIMATOR = OutputErrorRLS
SETTLED_PERIODS = 2
LINEAR, FIXED = "linear, gain estimated", "inverse, not adapted"
ADAPTIVE, CONTROLLER = "inverse, adaptive", "AdaptiveFeedforward"
# What each way is made of, new: arguments of `track`.
WAYS: dict[str, Callable[[], dict[str, Any]]] = {
    LINEAR: lambda: {"compensator": LinearCompensator(WRONG_GAIN), "estimator": _learner(WRONG_GAIN)},
    FIXED: lambda: {"compensator": InverseCompensator(WRONG_MODEL)},
    ADAPTIVE: lambda: {"compensator": InverseCompensator(WRONG_MODEL), "estimator": _learner(WRONG_MODEL)},
    CONTROLLER: lambda: {
        "controller": AdaptiveFeedforward(SAMPLE_RATE, limits=LIMITS, estimators=(ESTIMATOR,))
    },
}
DRAWN = (LINEAR, ADAPTIVE, CONTROLLER)
STYLES = dict(zip(WAYS, ("s-", "^--", "o-", "D-"), strict=True))


def _learner(start: Any) -> HysteresisRLS:
    return HysteresisRLS(SAMPLE_RATE, initial_model=start)


@dataclass(frozen=True, slots=True)
class Demo:
    """Four ways to follow the same reference on the same simulated stage."""

    records: dict[str, TrackingRecord] = field(repr=False)  # by the name in `WAYS`
    # Parameters of the model that drives the controller in the end, by name.
    learnt: dict[str, float] = field(repr=False)
    seconds: float  # what the four runs took together, compilation left out

    def reduction(self, way: str) -> float:
        """Part of linear feed-forward's largest settled error that another way removes."""
        ours, linear = (self.records[name].max_error(SETTLED_PERIODS) for name in (way, LINEAR))
        return 1.0 - ours / linear

    def plot(self) -> Figure:
        """Draw time series and maps of the settled runs, as Fig. 4 of the paper, and the adaptation."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(16, 11), layout="constrained")
        grid = figure.add_gridspec(3, 3, height_ratios=[1.0, 1.1, 0.9])
        linear = self.records[LINEAR]
        shown = slice(linear.reference.size - SETTLED_PERIODS * (linear.period or 0), None)
        for column, title in enumerate(DRAWN):
            record = self.records[title]
            series, loop = figure.add_subplot(grid[0, column]), figure.add_subplot(grid[1, column])
            draw_series(series, record, shown)
            series.set_title(f"{title}: largest error {record.max_error(SETTLED_PERIODS):.3f} µm")
            draw_map(loop, record, shown)
            # In the map there is room for what the series would hide.
            if (legend := series.get_legend()) is not None:
                legend.remove()
            loop.legend(*series.get_legend_handles_labels(), loc="upper left", title="above")
        axes = figure.add_subplot(grid[2, :])
        period = np.arange(1, linear.periods + 1)
        for label, record in self.records.items():
            axes.semilogy(period, record.max_error_per_period(), STYLES[label], ms=4, label=label)
        axes.set(xlabel="period", ylabel="largest error [µm]", title="adaptation")
        axes.grid(alpha=0.3, which="both")
        axes.legend(loc="upper right", bbox_to_anchor=(0.995, 0.93))
        figure.suptitle(
            f"{AMPLITUDE:g} µm at {FREQUENCY:g} Hz on the simulated stage: error reduced by "
            f"{100 * self.reduction(ADAPTIVE):.1f} % from a wrong start, by "
            f"{100 * self.reduction(CONTROLLER):.1f} % from nothing"
        )
        return figure


def run_demo(periods: int = 15, seed: int = 0, progress: Callable[[str], None] | None = None) -> Demo:
    """Run the demonstration on `PaperStage`, with noise and quantisation."""
    periods = integer("periods", periods, SETTLED_PERIODS)
    say = progress or (lambda _: None)

    def follow(reference: signals.Signal, parts: dict[str, Any]) -> TrackingRecord:
        return track(reference, stage=PaperStage(SAMPLE_RATE, seed=seed), **parts)

    # A moment of each way first, so that what Numba compiles once does not count as time of the runs.
    say("compiling, once after the installation")
    for make in WAYS.values():
        follow(signals.triangle(AMPLITUDE, FREQUENCY, 0.01, SAMPLE_RATE), make())
    reference = signals.triangle(AMPLITUDE, FREQUENCY, periods, SAMPLE_RATE)
    began = time.perf_counter()
    records, parts = {}, {name: make() for name, make in WAYS.items()}
    for name, made in parts.items():
        say(name)
        records[name] = follow(reference, made)
    seconds = time.perf_counter() - began
    model = parts[CONTROLLER]["controller"].model
    names, theta = ((), ()) if model is None else (model.parameter_names, model.theta.tolist())
    return Demo(records, dict(zip(names, theta, strict=True)), seconds)
