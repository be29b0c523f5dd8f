"""What can be read of a controller; nothing is changed here."""

from collections import deque
from typing import Any

from piezoest.compensators.limits import VoltageLimits
from piezoest.controller import shown
from piezoest.controller.shown import Candidate, ControllerStatus, Event
from piezoest.layout import Copied, Record
from piezoest.models import Model


class Face(Copied):
    """All that can be read of a controller."""

    __slots__ = (
        "_estimators", "_events", "_layouts", "_limits", "_names", "_sample_rate", "_settings", "_state",
    )  # fmt: skip

    _estimators: Any
    _events: deque[Event]
    _layouts: tuple[Record, Record]
    _limits: VoltageLimits
    _names: tuple[str, ...]
    _sample_rate: float
    _settings: Any
    _state: Any

    def __repr__(self) -> str:
        """Class, sample rate, and how it stands."""
        status = self.status
        fault = f", {status.fault}" if status.fault else ""
        name = type(self).__name__
        return f"<{name}({self.sample_rate:g} Hz): {status.stage}, {status.driving} drives{fault}>"

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

        ``samples`` written, with a reading or without, ``missing`` references, ``stage``: the
        phase of the work, not the piezo stage (``"seeking"``, ``"approaching"``, ``"running"``,
        ``"homing"``), ``driving`` (``"line"``, the name of an estimator, ``"Duhem model"`` or ``"recorded
        loop"``), ``fault`` of the readings (empty if none), samples whose voltage was limited by the range
        (``saturated``) or by the slew rate (``slewed``), ``switches`` of the model.
        """
        state = self._state
        counted = ("samples", "missing", "saturated", "slewed", "switches")
        return ControllerStatus(
            stage=shown.STAGES[int(state["stage"])],
            driving=self._names[int(state["driving"])],
            fault=shown.fault(state, self._settings),
            **{name: int(state[name]) for name in counted},
        )

    @property
    def events(self) -> tuple[Event, ...]:
        """What the controller noticed, oldest first, the last thousand.

        ``time`` is that of the sample [s]. ``action`` is ``"fell back"`` (a fault: the line drives and nobody
        learns), ``"resumed"`` (it is over) or ``"went on"`` (any other event, also that no readings come);
        ``reason`` begins with the ``name``, except after ``"resumed"``. Of several in one block the last is
        kept.
        """
        return tuple(self._events)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All that can drive, the line first, the recorded loop last: frozen records.

        Each has a ``name``, ``missed`` (its recent error, root mean square [µm]; None if nothing is known),
        ``drives`` and ``model``; for the Duhem model and the recorded loop, the best of the others.
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
        voltage is not its own yet. While the Duhem model or the recorded loop drives, this is the best of the
        line and the estimators.
        """
        return self._model(int(self._state["driving"]))

    def _model(self, number: int) -> Model | None:
        """The line, or the model of an estimator; for what has no such model the best of them."""
        if number > len(self._estimators):
            misses = shown.misses(self._state)
            own = range(len(self._estimators) + 1)
            known = [i for i in own if misses[i] is not None and self._model(i) is not None]
            number = min(known, key=lambda i: misses[i] or 0.0, default=0)
        if number == 0:
            return shown.line(self._state)
        start = self._estimators[number - 1].model
        return shown.model(start, self._state, self._settings, number - 1)
