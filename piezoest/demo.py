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


@dataclass(frozen=True, slots=True)
class Demo:
    """Four ways to follow the same reference on the same simulated stage."""

    # Linear feed-forward whose gain is estimated while the stage runs (11), (12).
    linear: TrackingRecord = field(repr=False)
    fixed: TrackingRecord = field(repr=False)  # inverse of the wrong start model, without estimation
    # Inverse of the model that is estimated while the stage runs, from the wrong start (14)-(20).
    adaptive: TrackingRecord = field(repr=False)
    # `AdaptiveFeedforward`, which is told the limits of the voltage and nothing else.
    controller: TrackingRecord = field(repr=False)
    # Parameters of the model that drives the controller in the end, by name.
    learnt: dict[str, float] = field(repr=False)
    seconds: float  # what the four runs took together, compilation left out

    @property
    def reduction(self) -> float:
        """Part of linear feed-forward's largest settled error that adaptive compensation removes."""
        return self._reduction_by(self.adaptive)

    @property
    def controller_reduction(self) -> float:
        """Part of linear feed-forward's largest settled error that the controller removes."""
        return self._reduction_by(self.controller)

    def _reduction_by(self, record: TrackingRecord) -> float:
        return 1.0 - record.max_error(SETTLED_PERIODS) / self.linear.max_error(SETTLED_PERIODS)

    def plot(self) -> Figure:
        """Draw time series and maps of the settled runs, as Fig. 4 of the paper, and the adaptation."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(16, 11), layout="constrained")
        grid = figure.add_gridspec(3, 3, height_ratios=[1.0, 1.1, 0.9])
        shown = slice(self.linear.reference.size - SETTLED_PERIODS * (self.linear.period or 0), None)
        for column, (title, record) in enumerate(
            [
                ("linear feed-forward, gain estimated", self.linear),
                ("inverse, adaptive", self.adaptive),
                ("AdaptiveFeedforward, from nothing", self.controller),
            ]
        ):
            series, loop = figure.add_subplot(grid[0, column]), figure.add_subplot(grid[1, column])
            draw_series(series, record, shown)
            series.set_title(f"{title}: largest error {record.max_error(SETTLED_PERIODS):.3f} µm")
            draw_map(loop, record, shown)
            # In the map there is room for what the series would hide.
            if (legend := series.get_legend()) is not None:
                legend.remove()
            loop.legend(*series.get_legend_handles_labels(), loc="upper left", title="above")
        self._draw_adaptation(figure.add_subplot(grid[2, :]))
        figure.suptitle(
            f"{AMPLITUDE:g} µm at {FREQUENCY:g} Hz on the simulated stage: error reduced by "
            f"{100 * self.reduction:.1f} % from a wrong start, by {100 * self.controller_reduction:.1f} % "
            "from nothing"
        )
        return figure

    def _draw_adaptation(self, axes: Any) -> None:
        period = np.arange(1, self.linear.periods + 1)
        for label, record, style in (
            ("linear feed-forward, gain estimated", self.linear, "s-"),
            ("inverse of the wrong start model, fixed", self.fixed, "^--"),
            ("inverse, adaptive", self.adaptive, "o-"),
            ("AdaptiveFeedforward, from nothing", self.controller, "D-"),
        ):
            axes.semilogy(period, record.max_error_per_period(), style, ms=4, label=label)
        axes.set(xlabel="period", ylabel="largest error [µm]", title="adaptation")
        axes.grid(alpha=0.3, which="both")
        axes.legend(loc="upper right", bbox_to_anchor=(0.995, 0.93))


def run_demo(periods: int = 15, seed: int = 0, progress: Callable[[str], None] | None = None) -> Demo:
    """Run the demonstration on `PaperStage`, with noise and quantisation."""
    periods = integer("periods", periods, SETTLED_PERIODS)
    say = progress or (lambda _: None)
    # A moment of each way first, so that what Numba compiles once does not count as time of the runs.
    say("compiling, once after the installation")
    moment = signals.triangle(AMPLITUDE, FREQUENCY, 0.01, SAMPLE_RATE)
    for way in (*WAYS.values(), _controlled):
        way(moment, seed)
    reference = signals.triangle(AMPLITUDE, FREQUENCY, periods, SAMPLE_RATE)
    began = time.perf_counter()
    records = []
    for label, way in WAYS.items():
        say(label)
        records.append(way(reference, seed))
    say("AdaptiveFeedforward, from nothing")
    controlled, learnt = _controlled(reference, seed)
    linear, fixed, adaptive = records
    return Demo(linear, fixed, adaptive, controlled, learnt, time.perf_counter() - began)


def _followed(reference: signals.Signal, seed: int, compensator: Any, start: Any = None) -> TrackingRecord:
    """The ring with a compensator, and with an estimator if there is a model for it to start from."""
    estimator = None if start is None else HysteresisRLS(SAMPLE_RATE, initial_model=start)
    stage = PaperStage(SAMPLE_RATE, seed=seed)
    return track(reference, stage=stage, compensator=compensator, estimator=estimator)


WAYS: dict[str, Callable[[signals.Signal, int], TrackingRecord]] = {
    "linear feed-forward, gain estimated while running": lambda reference, seed: _followed(
        reference, seed, LinearCompensator(WRONG_GAIN), WRONG_GAIN
    ),
    "inverse of the wrong start model, fixed": lambda reference, seed: _followed(
        reference, seed, InverseCompensator(WRONG_MODEL)
    ),
    "inverse compensation, model estimated while running": lambda reference, seed: _followed(
        reference, seed, InverseCompensator(WRONG_MODEL), WRONG_MODEL
    ),
}


def _controlled(reference: signals.Signal, seed: int) -> tuple[TrackingRecord, dict[str, float]]:
    controller = AdaptiveFeedforward(SAMPLE_RATE, limits=LIMITS, estimators=(ESTIMATOR,))
    record = track(reference, stage=PaperStage(SAMPLE_RATE, seed=seed), controller=controller)
    model = controller.model
    names, theta = ((), ()) if model is None else (model.parameter_names, model.theta.tolist())
    return record, dict(zip(names, theta, strict=True))
