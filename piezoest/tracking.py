"""The control loop: reference, compensator, stage, estimator, and back to the compensator."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from piezoest._checks import FloatArray, array_1d, integer, number_or_nan
from piezoest.compensators.limits import VoltageLimits, check_rate
from piezoest.estimators.base import EstimatorBase
from piezoest.estimators.compiled import NONE
from piezoest.signals import check_continuity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# More parameters than this are not shown in a table: it would be wider than a terminal.
MOST_COLUMNS = 3


@dataclass(frozen=True, slots=True, eq=False)
class TrackingRecord:
    """Record of a control loop, one number per sample.

    Parameters
    ----------
    reference, voltage, measured, displacement : ndarray, shape (N,)
        r [µm], u [V], measured x [µm], true x [µm] (the measured one if the true one is unknown). NaN where
        the stage gave no reading; errors leave these samples out.
    parameters : ndarray, shape (M, n)
        Parameters of the compensator's model, one row for each `update_interval` samples; n = 0 without an
        estimator, or with a controller. If the number of parameters changes, as after a start with another
        kind of model, the parameters of the next model are shown. `theta` has one row per sample.
    parameter_names : tuple of str
        Names of the columns of `theta`.
    sample_rate : float
        [Hz].
    period : int or None
        Samples per period of the reference; None if it has none.
    update_interval : int
        Samples that share a row of `parameters` (default 1).

    Examples
    --------
    >>> import piezoest as pz
    >>> r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=4, sample_rate=10_000.0)
    >>> controller = pz.AdaptiveFeedforward(10_000.0, limits=pz.VoltageLimits(-50.0, 100.0))
    >>> record = pz.track(r, stage=pz.PaperStage(10_000.0, seed=0), controller=controller)
    >>> record
    TrackingRecord(sample_rate=10000.0, period=2000, update_interval=50)
    >>> record.error.shape, bool(record.max_error(last_periods=1) < 0.05)
    ((8000,), True)
    """

    reference: FloatArray = field(repr=False)
    voltage: FloatArray = field(repr=False)
    measured: FloatArray = field(repr=False)
    displacement: FloatArray = field(repr=False)
    parameters: FloatArray = field(repr=False)
    parameter_names: tuple[str, ...] = field(repr=False)
    sample_rate: float
    period: int | None
    update_interval: int = 1

    @property
    def theta(self) -> FloatArray:
        """Parameters of the compensator's model at each sample, shape (N, n)."""
        return np.repeat(self.parameters, self.update_interval, axis=0)[: self.reference.size]

    @property
    def error(self) -> FloatArray:
        """Tracking error r - x of the true displacement [µm], shape (N,)."""
        return self.reference - self.displacement

    @property
    def time(self) -> FloatArray:
        """[s], shape (N,)."""
        return np.arange(self.reference.size) / self.sample_rate

    @property
    def periods(self) -> int:
        """Whole periods in the record.

        Raises
        ------
        ValueError
            If the reference has no period.
        """
        return self.reference.size // self._period()

    def _period(self) -> int:
        if self.period is None:
            raise ValueError(
                "the reference has no period: use record.error, or give track() a periodic signal"
            )
        return self.period

    def _tail(self, last_periods: int | None) -> slice:
        if last_periods is None:
            return slice(None)
        last_periods = integer("last_periods", last_periods, 1)
        if last_periods > self.periods:
            raise ValueError(f"last_periods is {last_periods}, the record has {self.periods} periods")
        return slice(self.reference.size - last_periods * self._period(), None)

    def max_error(self, last_periods: int | None = None) -> float:
        """Largest |r - x| [µm], as in the paper's Table II.

        Parameters
        ----------
        last_periods : int, optional
            Over the last so many periods only; default the whole record.
        """
        return _largest(self.error[self._tail(last_periods)])

    def rms_error(self, last_periods: int | None = None) -> float:
        """Root mean square of r - x [µm].

        Parameters
        ----------
        last_periods : int, optional
            Over the last so many periods only; default the whole record.
        """
        return _rms(self.error[self._tail(last_periods)])

    def max_error_per_period(self) -> FloatArray:
        """Largest |r - x| of each whole period [µm], shape (`periods`,)."""
        period = self._period()
        whole = np.abs(self.error[: self.periods * period])
        return np.asarray(np.fmax.reduce(whole.reshape(self.periods, period), axis=1))

    def table(self) -> str:
        """Text table: largest and rms error of each period, and up to three parameters at its end."""
        period = self._period()
        shown = len(self.parameter_names) if len(self.parameter_names) <= MOST_COLUMNS else 0
        names = "".join(f"{name:>14}" for name in self.parameter_names[:shown])
        lines = [f"{'period':>6}{'max error [µm]':>16}{'rms error [µm]':>16}{names}"]
        for k in range(self.periods):
            error = self.error[k * period : (k + 1) * period]
            row = self.parameters[((k + 1) * period - 1) // self.update_interval]
            values = "".join(f"{value:14.5g}" for value in row[:shown])
            lines.append(f"{k + 1:6d}{_largest(error):16.4f}{_rms(error):16.4f}{values}")
        return "\n".join(lines)

    def plot(self, last_periods: int | None = None) -> Figure:
        """Draw the time series and the reference-to-displacement map, as in Fig. 4 of the paper.

        Parameters
        ----------
        last_periods : int, optional
            Draw only the last so many periods.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from matplotlib.figure import Figure

        part = self._tail(last_periods)
        figure = Figure(figsize=(10, 4), layout="constrained")
        series, loop = figure.subplots(1, 2, width_ratios=[2, 1])
        draw_series(series, self, part)
        draw_map(loop, self, part)
        return figure


def _largest(error: FloatArray) -> float:
    """Largest size of the known errors; NaN if none is known."""
    return float(np.fmax.reduce(np.abs(error)))


def _rms(error: FloatArray) -> float:
    """Root mean square of the known errors; NaN if none is known."""
    known = error[np.isfinite(error)]
    return math.sqrt(float(np.mean(known**2))) if known.size else math.nan


def draw_series(axes: Any, record: TrackingRecord, part: slice = slice(None)) -> None:
    """Draw reference, displacement and error over time (Fig. 4a, 4b) into Matplotlib axes."""
    axes.plot(record.time[part], record.reference[part], label="reference", color="0.6", lw=2)
    axes.plot(record.time[part], record.displacement[part], label="displacement", color="C0", lw=1)
    axes.set(xlabel="time [s]", ylabel="displacement [µm]")
    right = axes.twinx()
    right.plot(record.time[part], record.error[part], label="error", color="C3", lw=0.8)
    right.set_ylabel("error [µm]", color="C3")
    limit = 1.05 * _largest(record.error[part])
    limit = limit if limit > 0.0 else 1.0
    right.set_ylim(-limit, limit)
    axes.legend(loc="upper right")


def draw_map(axes: Any, record: TrackingRecord, part: slice = slice(None)) -> None:
    """Draw displacement over reference (Fig. 4c, 4d) into Matplotlib axes."""
    axes.plot(record.reference[part], record.displacement[part], lw=0.9)
    axes.set(xlabel="reference [µm]", ylabel="displacement [µm]", aspect="equal")
    axes.grid(alpha=0.3)


def track(
    r: Any,
    *,
    stage: Any,
    compensator: Any = None,
    estimator: Any = None,
    controller: Any = None,
    update_interval: int = 50,
    sample_rate: float | None = None,
    allow_jumps: bool = False,
) -> TrackingRecord:
    """Run a control loop over a reference: compensator, stage and estimator, or a controller and a stage.

    Parameters
    ----------
    r : Signal or array_like, shape (N,)
        Reference displacement [µm]. A `piezoest.signals.Signal` brings sample rate and period.
    stage : object with ``step(u) -> x``
        Such as `PaperStage`, or a driver of a real stage.
    compensator : object with ``step(r) -> u`` and ``model``
        Such as `InverseCompensator`; with ``needs_measurement`` true, as in `IntegralFeedback`,
        it is called as ``step(r, x)`` with the measurement before.
    estimator : object with ``step(u, x)`` and ``model``, optional
        Such as `HysteresisRLS`; without one the compensator's model stays.
    controller : object with ``step(r) -> u`` and ``learn(u, x)``, optional
        Such as `AdaptiveFeedforward`; it replaces compensator and estimator. The loop then runs sample by
        sample, and the record has no parameters.
    update_interval : int
        Samples after which the compensator may take over a new model (default 50: 1 ms at 50 kHz); see the
        `model` of `InverseCompensator`.
    sample_rate : float, optional
        [Hz]; needed if r is a plain array and the stage has no sample rate.
    allow_jumps : bool
        Accept a reference with unfiltered steps. Without a slew-rate limit they reach the voltage.

    Returns
    -------
    TrackingRecord

    Raises
    ------
    ValueError
        If r is not a finite 1-D array or jumps, no sample rate is known or two of them differ, that of
        the compensator's limits among them, the stage has no step, or there is a controller beside a
        compensator, or neither.

    Notes
    -----
    Objects that have ``run`` are run one update interval at a time. The result is the same as with a loop of
    ``step``.

    Examples
    --------
    >>> import piezoest as pz
    >>> fs = 10_000.0
    >>> r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=5, sample_rate=fs)
    >>> stage = pz.PaperStage(fs, seed=0)
    >>> estimator = pz.HysteresisRLS(fs)
    >>> compensator = pz.InverseCompensator(estimator.model)
    >>> record = pz.track(r, stage=stage, compensator=compensator, estimator=estimator)
    >>> round(record.max_error(last_periods=1), 2)
    0.03
    """
    if isinstance(stage, type) or not (hasattr(stage, "step") or hasattr(stage, "run")):
        raise ValueError(f"stage must have step(u), or run(u), got {type(stage).__name__}")
    _check_driver(compensator, estimator, controller)
    reference = array_1d("r", r, minimum_length=1)
    parts = {"compensator": compensator, "estimator": estimator, "controller": controller}
    rate = _sample_rate(sample_rate, r=r, stage=stage, **parts)
    if not allow_jumps:
        check_continuity(reference, rate, "r")
    interval = integer("update_interval", update_interval, 1)
    if isinstance(limits := getattr(compensator, "limits", None), VoltageLimits):
        check_rate(limits, rate)
    period = getattr(r, "period", None)
    period = None if period is None else round(period)
    N = reference.size
    voltage, measured, displacement = np.empty(N), np.empty(N), np.empty(N)
    history: list[FloatArray] = []
    known, theta, names = None, NONE, ()
    for start in range(0, N, interval):
        part = slice(start, min(start + interval, N))
        _turn(part, stage, compensator, controller, reference, voltage, measured, displacement)
        if estimator is not None:
            present = compensator.model
            if present is not known:
                known, theta, names = present, present.theta, present.parameter_names
            history.append(theta)
            feed(estimator, voltage[part], measured[part])
            if getattr(compensator, "hand_over_due", True):
                model = estimator.model
                if model is not present:
                    compensator.model = model
    parameters = _of_one_kind(history) if history else np.empty((-(-N // interval), 0))
    return TrackingRecord(
        reference, voltage, measured, displacement, parameters, names, rate, period, interval
    )


def _check_driver(compensator: Any, estimator: Any, controller: Any) -> None:
    """Refuse two that give the voltage, none, and what is no object that can."""
    needed = ((compensator, "compensator", ("step",)), (estimator, "estimator", ("step", "model")),
              (controller, "controller", ("step", "learn")))  # fmt: skip
    for part, name, methods in needed:
        if isinstance(part, type):
            raise ValueError(f"{name} must be an object, got the class: make one, as {part.__name__}(...)")
        if part is not None and (missing := [each for each in methods if not hasattr(part, each)]):
            raise ValueError(f"{name} must have {' and '.join(missing)}, got {type(part).__name__}")
    if controller is None:
        if compensator is None:
            raise ValueError("nothing gives the voltage: pass compensator= or controller=")
        return
    others = {"compensator": compensator, "estimator": estimator}
    if given := [name for name, value in others.items() if value is not None]:
        raise ValueError(f"controller does without {' and '.join(given)}: leave out one or the other")


def _turn(
    part: slice, stage: Any, compensator: Any, controller: Any, r: FloatArray, u: FloatArray, x: FloatArray,
    true: FloatArray,
) -> None:  # fmt: skip
    """One interval of the reference through compensator or controller and stage, into u, x and the true x."""
    feeds_back = getattr(compensator, "needs_measurement", False)
    if controller is None and not feeds_back and hasattr(compensator, "run") and hasattr(stage, "run"):
        u[part] = compensator.run(r[part])
        x[part] = stage.run(u[part])
        true[part] = getattr(stage, "displacement", x[part])
        return
    driver = compensator if controller is None else controller
    for k in range(part.start, part.stop):
        before = (_reading(x[k - 1]) if k > 0 else None,) if feeds_back else ()
        u[k] = driver.step(float(r[k]), *before)
        x[k] = number_or_nan(stage.step(float(u[k])))
        true[k] = getattr(stage, "displacement", x[k])
        if controller is not None:
            controller.learn(float(u[k]), _reading(x[k]))


def _reading(x: float) -> float | None:
    """A measurement, or None if there is none, as `piezoest.Estimator` says."""
    return float(x) if math.isfinite(x) else None


def _of_one_kind(history: list[FloatArray]) -> FloatArray:
    """Parameters as rows; a model of another kind than the last is shown as the next of its kind."""
    size = history[-1].size
    rows = np.empty((len(history), size))
    row = history[-1]
    for k in range(len(history) - 1, -1, -1):
        if history[k].size == size:
            row = history[k]
        rows[k] = row
    return rows


def feed(estimator: Any, u: FloatArray, x: FloatArray) -> None:
    """Give an interval to the estimator; what a run would return is not needed."""
    if isinstance(estimator, EstimatorBase) and type(estimator).run is EstimatorBase.run:
        estimator.absorb(u, x)
        return
    if hasattr(estimator, "run"):
        estimator.run(u, x)
        return
    for k in range(u.size):
        estimator.step(float(u[k]), _reading(x[k]))


def _sample_rate(given: float | None, **parts: Any) -> float:
    named = {"sample_rate": given} | {
        name: getattr(part, "sample_rate", None) for name, part in parts.items()
    }
    known = {name: float(rate) for name, rate in named.items() if rate is not None}
    if not known:
        raise ValueError("sample_rate is unknown: pass a piezoest.signals.Signal or sample_rate= in Hz")
    if len(set(known.values())) > 1:
        rates = ", ".join(f"{name} {rate:g} Hz" for name, rate in known.items())
        raise ValueError(f"sample rates differ: {rates}")
    return next(iter(known.values()))
