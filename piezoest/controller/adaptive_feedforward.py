"""Adaptive feed-forward as one object: a reference in, a voltage out, and what was measured back in."""

from __future__ import annotations

import copy
import logging
from collections import deque
from typing import Any, Self, cast

import numpy as np

from piezoest._checks import FloatArray, array_1d, finite, fraction, moderate, number_or_nan
from piezoest.compensators.limits import VoltageLimits
from piezoest.controller import kernel, making, saved, shown, slots, team
from piezoest.controller.shown import Candidate, ControllerStatus
from piezoest.layout import Record, by_name, from_bytes, write
from piezoest.models import Model
from piezoest.supervisor import Event

# Events that are kept.
MOST_EVENTS = 1000
# What planning a block counts, of which learning knows nothing.
_COUNTED = ("missing", "saturated", "slewed", "planned")

_log = logging.getLogger(__name__)


class AdaptiveFeedforward:
    """Lets a stage follow a reference of which nothing is known but the voltage that it bears.

    It finds out the gain by two small steps of the voltage, goes to where the reference is, and then learns
    the hysteresis while it runs: a straight line and up to four estimators learn side by side, and the model
    that has missed least of late drives. The voltage stays in a corridor around the straight line, and always
    within the limits. Readings that cannot be believed have a name in `status` and `events`: nothing is
    learnt from them, and the straight line drives meanwhile.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    limits : VoltageLimits
        What stage and amplifier bear, a finite range [V]: all that keeps the stage whole.
    estimators : tuple of callable, optional
        Up to four, called as ``factory(sample_rate, initial_model=..., noise=...)``: classes of estimators
        (`HysteresisRLS`, `OutputErrorRLS`, `HysteresisEKF`, `PrandtlIshlinskiiRLS`), or a
        ``functools.partial`` of one. Default: the first, the second and the last of these; ``()`` is the
        straight line alone. Estimators are made here, since they are given voltages and readings in units
        of half a swing, in which the stage has a gain of about one, and an initial model and a noise for
        that.
    corridor : float
        How far the voltage goes from the straight line at most, as a fraction of half the recent swing,
        0 to 1.

    Raises
    ------
    ValueError
        If a value is out of its range, the limits are infinite or of another sample rate, or an estimator is
        none that a controller can use.

    Notes
    -----
    What is learnt counts by the travel of the voltage and not by time. A gain below zero is found, too: the
    models then fall with the voltage. The first controller of a layout compiles, in up to a minute; every
    later one loads. Source: a rule of this library.

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

    __slots__ = (
        "_corridor", "_estimators", "_events", "_layouts", "_limits", "_loops", "_names", "_planned",
        "_sample_rate", "_settings", "_start", "_state",
    )  # fmt: skip

    _loops: tuple[Any, ...] | None
    _planned: FloatArray | None

    def __init__(
        self,
        sample_rate: float,
        *,
        limits: VoltageLimits,
        estimators: Any = None,
        corridor: float = kernel.WIDTH,
    ) -> None:
        sample_rate, limits = moderate("sample_rate", sample_rate), making.checked_limits(limits, sample_rate)
        factories = team.DEFAULT if estimators is None else estimators
        self._make(sample_rate, limits, corridor, team.made(factories, sample_rate))

    def _make(self, sample_rate: float, limits: VoltageLimits, corridor: float, estimators: Any) -> None:
        """Make room for estimators that are known to be good ones."""
        self._sample_rate, self._limits = sample_rate, limits
        self._corridor = fraction("corridor", corridor)
        self._estimators, self._names = estimators, team.names(estimators)
        self._layouts, self._start = making.room(sample_rate, limits, self._corridor, estimators)
        self._state, self._settings = self._start[0].copy(), self._start[1].copy()
        self._loops = None
        self.reset()

    def reset(self, voltage: float | None = None) -> None:
        """Return to the state after construction: nothing is known.

        Parameters
        ----------
        voltage : float, optional
            Voltage at which the stage rests [V], within the limits. Default: the one nearest to 0 V.

        Raises
        ------
        ValueError
            If the voltage is none within the limits.
        """
        u = self._limits.rest if voltage is None else finite("voltage", voltage)
        if not self._limits.minimum <= u <= self._limits.maximum:
            raise ValueError(
                f"voltage must lie within the limits, {self._limits.minimum:g} V to "
                f"{self._limits.maximum:g} V, got {u:g} V"
            )
        write(self._state, self._start[0])
        write(self._settings, self._start[1])
        self._events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self._planned = None
        kernel.begin.of(*self._layouts)(self._state, self._settings, u)
        self._compiled()  # before a live loop, not at its first sample

    def _compiled(self) -> tuple[Any, ...]:
        """Machine code: to plan and to learn from a sample, a block."""
        if self._loops is None:
            every = (kernel.step, kernel.learn, kernel.run, kernel.learn_all)
            self._loops = tuple(loop.of(*self._layouts) for loop in every)
        return self._loops

    # ------------------------------------------------------------ sample by sample, block by block

    def step(self, r: float | None) -> float:
        """Voltage for the next sample of the reference.

        Parameters
        ----------
        r : float
            Reference displacement [µm], in the sensor's own coordinates; NaN, infinity and what is no number
            hold the last one.

        Returns
        -------
        float
            Voltage [V], within the limits. `learn` is then given what was written and measured.
        """
        if type(r) is not float:
            r = number_or_nan(r)
        self._planned = None
        voltage: float = self._compiled()[0](self._state, self._settings, r)
        return voltage

    def run(self, r: Any) -> FloatArray:
        """Voltages for a block of the reference, planned at once and written later.

        Nothing is learnt within the block, so a loop of `step` and `learn` does better. `learn` is to be
        given the whole block, as written and measured; a block without it was never written.

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
        r = array_1d("r", r, allow_nan=True).copy()
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
        """Learn from the voltage that was written and what was measured then.

        Parameters
        ----------
        u : float, or array_like, shape (N,)
            Voltage [V] of the last `step`; of the last `run`, as an array.
        x : float or None, or array_like, shape (N,)
            Measured displacement [µm]; None, NaN or infinity where there is none. What is no number counts
            as missing, as in `HysteresisRLS.step`: a stream must not stop.

        Raises
        ------
        ValueError
            If they are arrays and no block of their length was planned by `run`.
        """
        if self._planned is not None:
            self._learn_block(self._planned, u, x)
        elif (isinstance(u, np.ndarray) and u.size > 1) or (isinstance(u, list | tuple) and len(u) > 1):
            raise ValueError(
                f"u must be one number, got {len(u)}: a block is planned by run(r) before it is learnt from"
            )
        else:
            u = u if type(u) is float else number_or_nan(u)
            x = x if type(x) is float else number_or_nan(x)
            self._teach(self._compiled()[1], u, x)

    def _learn_block(self, r: FloatArray, u: Any, x: Any) -> None:
        u, x = array_1d("u", u, allow_nan=True), array_1d("x", x, allow_nan=True)
        if not u.size == x.size == r.size:
            raise ValueError(
                f"u and x must have {r.size} samples, as the block that run() planned, "
                f"got {u.size} and {x.size}"
            )
        self._planned = None
        # Compiled loops take writeable arrays only, though they write into none.
        self._teach(self._compiled()[3], r, u.copy(), x.copy())

    def _teach(self, loop: Any, *samples: Any) -> None:
        """Go through samples, and note what was noticed on the way."""
        state = self._state
        before = state["noticed"].item()
        loop(state, self._settings, *samples)
        if state["noticed"].item() == before:
            return
        event = shown.event(state, self._sample_rate)
        self._events.append(event)
        level = logging.WARNING if event.action == "fell back" else logging.INFO
        _log.log(level, "%s at %.6g s, %s", event.action, event.time, event.reason)

    # ------------------------------------------------------------ what it shows

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        return self._sample_rate

    @property
    def limits(self) -> VoltageLimits:
        """Limits that the voltage never leaves."""
        return self._limits

    @property
    def voltage(self) -> float:
        """Voltage given out last [V]."""
        return float(self._state["planned"])

    @property
    def state(self) -> Any:
        """All that changes but the models in use, by name: ``state["line"]["gain"]``."""
        return self._state

    @property
    def settings(self) -> Any:
        """What compiled code is given beside `state`, the models in use among it, by name."""
        return self._settings

    @property
    def layouts(self) -> tuple[Record, Record]:
        """Layouts of `state` and `settings`, for which the compiled functions are made."""
        return self._layouts

    @property
    def status(self) -> ControllerStatus:
        """What happened so far, and how it stands: a frozen record.

        ``samples`` learnt from, ``missing`` references, ``stage`` of the work (``"seeking"``,
        ``"approaching"``, ``"running"``), ``driving`` (``"line"`` or the name of an estimator), ``fault`` of
        the readings (empty if none), samples ``saturated`` and ``slewed``, ``switches`` of the model.
        """
        state = self._state
        counted = ("samples", "missing", "saturated", "slewed", "switches")
        return ControllerStatus(
            stage=shown.stage_name(state["stage"]),
            driving=self._names[int(state["driving"])],
            fault=shown.fault_name(state["readings"]["fault"]),
            **{name: int(state[name]) for name in counted},
        )

    @property
    def events(self) -> tuple[Event, ...]:
        """What was noticed of the readings, oldest first, the last thousand.

        ``time`` is that of the sample [s]. ``action`` is ``"fell back"`` (a fault: the line drives and nobody
        learns), ``"resumed"`` (it is over) or ``"went on"`` (what moved is followed); ``reason`` begins with
        the fault's name. Of several in one block the last is kept.
        """
        return tuple(self._events)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All models that can drive, the line first: frozen records.

        Each has a ``name``, ``missed`` (what it has missed of late, root mean square [µm]; None if nothing is
        known), ``drives`` and ``model``.
        """
        driving = int(self._state["driving"])
        misses = shown.misses(self._state)
        return tuple(
            Candidate(name, misses[i], i == driving, self._model(i)) for i, name in enumerate(self._names)
        )

    @property
    def model(self) -> Model | None:
        """The model that drives, in µm and V; None until the gain is known.

        A `LinearGain`, `ColemanHodgdon` or `PrandtlIshlinskii`. While it takes over from another one, the
        voltage is not its own yet.
        """
        return self._model(int(self._state["driving"]))

    def _model(self, number: int) -> Model | None:
        """The line, or the model of an estimator."""
        if number == 0:
            return shown.line(self._state)
        start = self._estimators[number - 1].model
        return shown.model(start, self._state, self._settings, slots.NAMES[number - 1])

    # ------------------------------------------------------------ copies and files

    def copy(self) -> Self:
        """Return an independent controller in the same state."""
        return copy.deepcopy(self)

    def __copy__(self) -> Self:
        return self.copy()

    def __getstate__(self) -> Any:
        # Machine code is not pickled: it is looked up again.
        kept, own = cast(Any, super().__getstate__())
        return kept, {**own, "_loops": None}

    def to_dict(self) -> dict[str, Any]:
        """Return all as a JSON-safe dictionary; `from_dict` resumes bit for bit."""
        return {
            "controller": type(self).__name__,
            "format": saved.FORMAT,
            "sample_rate": self._sample_rate,
            "limits": saved.limits(self._limits),
            "corridor": self._corridor,
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
        controller._make(sample_rate, limits, data["corridor"], estimators)
        controller._load(data)
        return controller

    def _load(self, data: dict[str, Any]) -> None:
        """Go on from what was saved."""
        state = saved.read_state(data["state"], self._layouts[0], self._state)
        settings = saved.read_models(data["models"], self._layouts[1], self._settings)
        planned, events = saved.read_block(data["planned"]), saved.read_events(data["events"])
        write(self._state, state)
        write(self._settings, settings)
        self._planned = planned
        self._events.extend(events)
        for number in range(len(self._names)):
            self._model(number)  # what makes no model is refused
