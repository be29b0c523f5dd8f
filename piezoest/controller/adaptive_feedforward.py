"""Adaptive feed-forward as one object: it takes a reference, returns a voltage, and learns from readings."""

import dataclasses
import logging
from collections import deque
from typing import Any, ClassVar, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d, finite, measured, moderate, number_or_nan
from piezoest.compensators.limits import VoltageLimits, resting
from piezoest.controller import faults, kernel, making, saved, shown, team
from piezoest.controller.face import Face
from piezoest.layout import by_name, from_bytes, write
from piezoest.models import LearntModel

# Events that are kept.
MOST_EVENTS = 1000
# What planning a block changes; everything else changes when the block is learnt.
_COUNTED = ("missing", "saturated", "slewed", "planned", "back")

_log = logging.getLogger(__name__)


class AdaptiveFeedforward(Face):
    """A complete adaptive feed-forward controller that needs only sample rate and voltage limits.

    It measures the gain with small steps of the voltage and moves to the reference. Then it learns the
    hysteresis while it runs, with a straight line, up to four estimators and a Duhem model in parallel, and
    records the last loop for motion that repeats. The model with the smallest recent error computes the
    voltage: it *drives*. The voltage stays in a corridor around the straight line, and always within the
    limits. Implausible readings are reported in `status` and `events`; nothing is learnt from them, and the
    straight line drives.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    limits : VoltageLimits
        Finite voltage range that stage and amplifier tolerate [V]. It protects the stage. While it looks for
        the gain, the controller goes up to a quarter of the range away from rest, on either side.
    estimators : tuple of callable, optional
        Up to four classes of estimators (`HysteresisRLS`, `OutputErrorRLS`, `HysteresisEKF`,
        `PrandtlIshlinskiiRLS`), or a ``functools.partial`` of one. Default: ``(HysteresisRLS,
        OutputErrorRLS, PrandtlIshlinskiiRLS)``; ``()`` is the straight line alone. The controller calls
        ``factory(sample_rate, initial_model=..., noise=...)``: they work in units of half a swing, in which
        the gain is about one.
    corridor : float
        Largest distance of the voltage from the straight line, as a fraction of half the widest recent
        swing, 0 to 1. Where a stage drifts it is up to three times as much on that side, but not more than
        half the swing.
    gain : float, optional
        Approximate gain of the stage [µm/V]; negative if the displacement falls with the voltage. It is
        checked at the start. If it is wrong by more than a factor of three, the gain is measured.
    stroke : float, optional
        Instead of `gain`: displacement over the whole range of the limits [µm].
    model : Model, path or Identification, optional
        Instead of `gain`: a model, whose slope is used. Also the JSON file that `piezoest identify` wrote,
        or what `identify` returned. An event warns, once, when the run leaves the ranges that the model was
        learnt on by more than 5 %. Give at most one of the three.
    feedback : float, optional
        Integral gain of a feedback from plausible readings [1/s], as in `IntegralFeedback`. Its correction
        is at most the half-width of the corridor plus three times the noise. It must be far below twice
        damping times resonance [rad/s]; where it makes the stage oscillate it is halved. Default: no
        feedback.
    resonance : float, optional
        Lowest resonance of the stage [Hz]. An event warns, once, when the reference is above 5 % of it.
        Default: unknown, no warning.

    Raises
    ------
    ValueError
        If a value is out of its range, the limits are infinite or of another sample rate, an estimator is
        none that a controller can use, the gain is given twice, or a file holds no model.
    OSError
        If the file of a model cannot be read.

    Notes
    -----
    Learning depends on how far the voltage travels and not on time. The first controller with a choice of
    estimators is compiled; later ones load the compiled code. Source: a rule of this library.

    Examples
    --------
    >>> import piezoest as pz
    >>> fs = 10_000.0
    >>> r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=5, sample_rate=fs)
    >>> stage = pz.PaperStage(sample_rate=fs, seed=0)
    >>> limits = pz.VoltageLimits(minimum=-50.0, maximum=100.0)
    >>> controller = pz.AdaptiveFeedforward(fs, limits=limits)
    >>> for r_k in r:
    ...     u = controller.step(r_k)
    ...     x = stage.step(u)
    ...     controller.learn(u, x)
    >>> controller.status.stage
    'running'
    """

    __slots__ = ("_loops", "_options", "_planned", "_start")

    _machine_code: ClassVar[tuple[str, ...]] = ("_loops",)

    _loops: tuple[Any, ...] | None
    _planned: FloatArray | None

    def __init__(
        self,
        sample_rate: float,
        *,
        limits: VoltageLimits,
        estimators: Any = None,
        corridor: float = kernel.WIDTH,
        gain: float | None = None,
        stroke: float | None = None,
        model: Any = None,
        feedback: float | None = None,
        resonance: float | None = None,
    ) -> None:
        sample_rate, limits = moderate("sample_rate", sample_rate), making.checked_limits(limits, sample_rate)
        factories = team.DEFAULT if estimators is None else estimators
        learnt = None if model is None else LearntModel.of(model)
        known = making.known_gain(gain, stroke, learnt, limits)
        ranges = None if learnt is None else learnt.to_dict()["learnt_on"]
        options = making.options(sample_rate, corridor, known, feedback, resonance, ranges)
        self._make(sample_rate, limits, options, team.made(factories, sample_rate))

    def _make(self, sample_rate: float, limits: VoltageLimits, options: Any, estimators: Any) -> None:
        """Make room for checked estimators, and begin."""
        self._sample_rate, self._limits, self._options = sample_rate, limits, options
        self._estimators, self._names = estimators, team.names(estimators)
        self._layouts, self._start = making.room(sample_rate, limits, options, estimators)
        self._state, self._settings = self._start[0].copy(), self._start[1].copy()
        self._loops = None
        self.reset()

    def reset(self, voltage: float | None = None, displacement: float | None = None) -> None:
        """Return to the state after construction: forget everything but the arguments given there.

        Parameters
        ----------
        voltage : float, optional
            Voltage at which the stage rests [V], within the limits. Default: the one nearest to 0 V.
        displacement : float, optional
            Reading of the sensor there [µm]. Default: taken from the first readings.

        Raises
        ------
        ValueError
            If the voltage is outside the limits, or the displacement is not a number.
        """
        u = resting(self._limits, voltage)
        x = None if displacement is None else measured("displacement", displacement)
        write(self._state, self._start[0])
        write(self._settings, self._start[1])
        self._events = deque(maxlen=MOST_EVENTS)
        self._planned = None
        kernel.begin.of(*self._layouts)(self._state, self._settings, u)
        if x is not None:
            kernel.resume.of(*self._layouts)(self._state, self._settings, u, x)
        self._compiled()  # before a live loop, not at its first sample

    def resume(self, voltage: float, displacement: float) -> None:
        """Continue from rest with what was learnt.

        Use it the next day, after `from_dict`, or when a program goes on after a stop. The voltage moves
        smoothly to the reference. The straight line drives until the models have proved their accuracy again.
        The voltage must have gone straight to where it is now; if it went to and fro, `home` erases that.

        Parameters
        ----------
        voltage : float
            Voltage at which the stage rests now [V], within the limits.
        displacement : float
            Reading of the sensor there [µm].

        Raises
        ------
        ValueError
            If the voltage is outside the limits, or the displacement is not a number.

        Examples
        --------
        >>> import piezoest as pz
        >>> limits = pz.VoltageLimits(minimum=-50.0, maximum=100.0)
        >>> saved = pz.AdaptiveFeedforward(10_000.0, limits=limits, gain=0.2).to_dict()
        >>> controller = pz.AdaptiveFeedforward.from_dict(saved)
        >>> controller.resume(voltage=0.0, displacement=3.2)
        """
        u = resting(self._limits, finite("voltage", voltage))
        x = measured("displacement", displacement)
        self._planned = None
        kernel.resume.of(*self._layouts)(self._state, self._settings, u, x)

    def _compiled(self) -> tuple[Any, ...]:
        """Machine code of `step`, `learn`, both for blocks, and `home`."""
        if self._loops is None:
            every = (kernel.step, kernel.learn, kernel.run, kernel.learn_all, kernel.home)
            self._loops = tuple(loop.of(*self._layouts) for loop in every)
        return self._loops

    def home(self, amplitude: float | None = None, frequency: float = 1.0, cycles: int = 10) -> None:
        """Start a decaying oscillation of the voltage that erases the memory of the hysteresis.

        Use it after a power cut or lost writes, when the past of the voltage is unknown. The next steps
        ignore the reference. The voltage oscillates around the one nearest to 0 V, or around the middle of
        the limits if there is no room, with decreasing amplitude; `status` shows ``"homing"``. Then the
        controller approaches the reference, or measures the gain if it is unknown.

        Parameters
        ----------
        amplitude : float, optional
            Amplitude of the first oscillation [V]. Default: half the range, which erases everything.
        frequency : float
            [Hz]; reduced if the slew rate requires it.
        cycles : int
            Number of oscillations, 1 to 10 000; with ten, each is smaller by a tenth of the first.

        Raises
        ------
        ValueError
            If one is out of its range, or the amplitude has no room.
        """
        given = making.sweep(self._limits, self._sample_rate, amplitude, frequency, cycles)
        self._compiled()[4](self._state, self._settings, *given)

    # ------------------------------------------------------------ sample by sample, block by block

    def step(self, r: float | None) -> float:
        """Voltage for the next sample of the reference.

        Parameters
        ----------
        r : float
            Reference displacement [µm], in the sensor's coordinates. NaN, infinity and anything that is not
            a number repeat the last one.

        Returns
        -------
        float
            Voltage [V], within the limits. Pass it and the measurement to `learn`.
        """
        if type(r) is not float:
            r = number_or_nan(r)
        self._planned = None
        voltage: float = self._compiled()[0](self._state, self._settings, r)
        return voltage

    def run(self, r: Any) -> FloatArray:
        """Voltages for a block of the reference, which are written later.

        Nothing is learnt within the block, so a loop of `step` and `learn` is more accurate. Call `learn`
        with the whole block; without this call the block counts as never written.

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm]; NaN holds the last one.

        Returns
        -------
        ndarray, shape (N,)
            Voltage [V], within the limits.

        Raises
        ------
        ValueError
            If r is not a 1-D array of numbers.
        """
        r = array_1d("r", r, allow_nan=True, sample_rate=self._sample_rate).copy()
        u = np.empty_like(r)
        # A copy through bytes: NumPy's own goes through a nested structure field by field.
        given = zip(self._layouts, (self._state, self._settings), strict=True)
        ahead, settings = (from_bytes(layout, array.tobytes()) for layout, array in given)
        self._compiled()[2](ahead, settings, r, u)
        for name in _COUNTED:
            self._state[name] = ahead[name]
        self._planned = r
        return u

    def learn(self, u: Any, x: Any) -> None:
        """Learn from the voltage that was written and the displacement measured with it.

        Parameters
        ----------
        u : float or None, or array_like, shape (N,)
            Voltage [V] of the last `step`, or the array of the last `run`. Rounded by a converter, or
            measured with an error below 1 % of the range, it counts as the planned one. None or NaN: it is
            unknown whether it was written. If this matters, the straight line drives until the models have
            proved their accuracy again.
        x : float or None, or array_like, shape (N,)
            Measured displacement [µm]; None, NaN or infinity if there is none. Anything that is not a number
            counts as missing.

        Raises
        ------
        ValueError
            If they are arrays and no block of their length was planned by `run`.
        """
        r = self._planned
        if r is not None:
            u, x = array_1d("u", u, allow_nan=True), array_1d("x", x, allow_nan=True)
            if not u.size == x.size == r.size:
                raise ValueError(
                    f"u and x must have {r.size} samples, as the block that run() planned, "
                    f"got {u.size} and {x.size}"
                )
            self._planned = None
            self._teach(self._compiled()[3], r, u, x)
        elif (isinstance(u, np.ndarray) and u.size > 1) or (isinstance(u, list | tuple) and len(u) > 1):
            raise ValueError(
                f"u must be one number, got {len(u)} values: call run(r) for the block before learn(u, x)"
            )
        else:
            u = u if type(u) is float else number_or_nan(u)
            x = x if type(x) is float else number_or_nan(x)
            self._teach(self._compiled()[1], u, x)

    def _teach(self, loop: Any, *samples: Any) -> None:
        """Learn from samples, and keep the event that was noted meanwhile."""
        state = self._state
        before = state["noticed"].item()
        loop(state, self._settings, *samples)
        if state["noticed"].item() == before:
            return
        event = shown.event(state, self._sample_rate, self._options["learnt_on"])
        self._events.append(event)
        warned = event.action == "fell back" or state["notice"] in faults.WARNINGS
        level = logging.WARNING if warned else logging.INFO
        _log.log(level, "%s at %.6g s, %s", event.action, event.time, event.reason)

    # ------------------------------------------------------------ files

    def to_dict(self) -> dict[str, Any]:
        """Return everything as a JSON-safe dictionary; `from_dict` continues with identical numbers."""
        return {
            "controller": type(self).__name__,
            "format": saved.FORMAT,
            "sample_rate": self._sample_rate,
            "limits": dataclasses.asdict(self._limits),
            **self._options,
            "estimators": [team.saved(estimator) for estimator in self._estimators],
            "state": by_name(self._layouts[0], self._state),
            "models": saved.models(self._layouts[1], self._settings),
            "planned": saved.block(self._planned),
            "events": [[event.time, event.action, event.reason] for event in self._events],
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Make a controller that continues where `to_dict` was called.

        Parameters
        ----------
        data : dict
            What `to_dict` returned, also after a round trip through JSON.

        Raises
        ------
        ValueError
            If the dictionary is of another class or format, a field is missing or unknown, an argument is
            refused, or the state is none that the controller can have been in.
        """
        saved.check_head(cls.__name__, data)
        sample_rate = moderate("sample_rate", data["sample_rate"])
        limits = making.checked_limits(saved.read_limits(data["limits"]), sample_rate)
        controller = cls.__new__(cls)
        estimators = saved.read_estimators(data["estimators"], data["state"])
        chosen = (data[name] for name in ("corridor", "gain", "feedback", "resonance", "learnt_on"))
        options = making.options(sample_rate, *chosen)
        controller._make(sample_rate, limits, options, estimators)
        controller._load(data)
        return controller

    def _load(self, data: dict[str, Any]) -> None:
        """Go on from what was saved."""
        write(self._state, saved.read_state(data["state"], self._layouts[0], self._state))
        write(self._settings, saved.read_models(data["models"], self._layouts[1], self._settings))
        if data["planned"] is not None:
            self._planned = array_1d("planned", data["planned"], allow_nan=True).copy()
        self._events.extend(saved.read_events(data["events"]))
        for number in range(len(self._names)):
            self._model(number)  # what makes no model is refused
