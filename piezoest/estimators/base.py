"""The methods and attributes that all estimators have in common."""

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, ClassVar, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d, check_start, instance, integer, number_or_nan
from piezoest.estimators import samples, saved_state
from piezoest.estimators.outcome import Estimator as Estimator
from piezoest.estimators.outcome import Status as Status
from piezoest.estimators.outcome import Trace as Trace
from piezoest.layout import Copied, Record, by_name, new, write
from piezoest.models import ColemanHodgdon, Creep, MassSpringDamper, Model, model_from_dict
from piezoest.policies import policy_from_dict

_FORMAT = 1
# What reads arguments that are saved as dictionaries.
_READ: dict[str, Any] = {
    "initial_model": model_from_dict, "creep": Creep.from_dict, "mechanics": MassSpringDamper.from_dict
}  # fmt: skip
# Starts from here where the user gives no model: a common stack actuator.
DEFAULT_MODEL = ColemanHodgdon(0.02, 0.12, 0.0036)


class EstimatorBase(Copied, ABC):
    """Base class of all estimators.

    A subclass keeps everything that changes in ``self._state`` (a structured array, see `piezoest.layout`),
    and its constructor's arguments, JSON-safe, in ``self._arguments``. Copying, saving, resetting and
    pickling need nothing more. Properties such as `theta` return the number of that name in the state.
    """

    __slots__ = ("_arguments", "_initial", "_layout", "_pending", "_start", "_state")

    #: Tests of estimators that this class does not pass: name of the test, and the reason.
    conformance_exceptions: ClassVar[dict[str, str]] = {}

    #: Fields of the state that lead to theta, P, y, S or K, where that is not a field of this name.
    _places: ClassVar[dict[str, tuple[str, ...]]] = {}

    #: What the class saves beside its state.
    _saved_too: ClassVar[tuple[str, ...]] = ()

    _arguments: dict[str, Any]
    _initial: Any
    _layout: Record
    _pending: float | None
    _start: Any
    _state: Any

    def _start_from(self, initial_model: Any, *kinds: Any, admissible: bool = True) -> Any:
        """Keep and return the model to start from, the user's or the default one."""
        model = DEFAULT_MODEL if initial_model is None else initial_model
        names = " or ".join(f"a {kind.__name__}" for kind in kinds)
        self._initial = instance("initial_model", model, kinds, names)
        check_start(model)
        if admissible and not model.is_admissible:
            raise ValueError(
                f"initial_model must be admissible, but {model} is not admissible: use nearest_admissible()"
            )
        return model

    def _begin(self, arguments: dict[str, Any], layout: Record, values: dict[str, Any]) -> None:
        """Start with a state of zeros but for `values`."""
        self._arguments = arguments
        self._layout = layout
        self._state = new(layout, **values)
        self._start = self._state.copy()
        self._pending = None

    def _load(self, state: Any) -> None:
        """Go on from a state."""
        write(self._state, state)

    def _rules(self, state: Any) -> Iterable[saved_state.Rule]:
        """What must hold between the numbers of a saved state: in words, and whether it does."""
        return ()

    @property
    def state(self) -> Any:
        """Its state: a NumPy structured array with named fields, such as ``state["law"]["P"]``; a view."""
        return self._state

    @property
    def layout(self) -> Record:
        """The fields of `state`, and the values that they may have."""
        return self._layout

    @abstractmethod
    def _sample(self, u: float, x: float) -> None:
        """Go through one sample; NaN in either is a missing measurement."""

    @property
    def _left(self) -> int | None:
        """Samples until `theta` changes next; None where it does so when it is read."""
        return 1

    def _collect(self, u: FloatArray, x: FloatArray) -> FloatArray | None:
        """Go through checked records, of `_left` samples at most; their innovations, if they differ."""
        for u_k, x_k in zip(u.tolist(), x.tolist(), strict=True):
            self._sample(u_k, x_k)
        return None

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        """Go through checked records."""
        rows, n = u.size // every, len(self.parameter_names)
        shapes = {"theta": (n,), "P": (n, n), "y": (), "S": ()}
        kept = {name: np.empty((rows, *shapes[name])) for name in ("theta", *want)}

        def keep(first: int, last: int) -> None:
            for name, values in kept.items():
                if first // every < last // every:
                    values[first // every : last // every] = getattr(self, name)

        done = 0
        while done < u.size:
            end = min(done + (self._left or u.size), u.size)
            # Until the last sample is there, the rows hold what was known before it.
            keep(done, end - 1)
            innovations = self._collect(u[done:end], x[done:end])
            keep(end - 1, end)
            if innovations is not None and "y" in want:
                kept["y"][done // every : end // every] = innovations[every - 1 - done % every :: every]
            done = end
        index = np.arange(every - 1, rows * every, every)
        return Trace(index=index, parameter_names=self.parameter_names, **kept)

    def __repr__(self) -> str:
        """Class, sample rate, the arguments that are not the defaults, and the model."""
        new: Any = type(self)
        try:
            usual = new(self.sample_rate)._arguments
        except (TypeError, ValueError):  # the defaults do not fit the rate, or there are none
            usual = {}
        given = "".join(
            f", {name}={value!r}"
            for name, value in self._revive(self._arguments).items()
            if self._arguments[name] != usual.get(name)
        )
        return f"<{type(self).__name__}({self.sample_rate:g}{given}): {self.model}>"

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        return float(self._arguments["sample_rate"])

    @property
    @abstractmethod
    def model(self) -> Model:
        """The current model. It is admissible, so a compensator can use it."""

    @property
    def theta(self) -> FloatArray:
        """Parameters as estimated, shape (n,), in the order of `parameter_names`."""
        return np.asarray(self._now("theta"))

    @property
    def P(self) -> FloatArray:
        """Covariance of `theta` as the law sees it, shape (n, n), or follows from it to first order."""
        return np.asarray(self._now("P"))

    @property
    def K(self) -> FloatArray:
        """Last gain, of what the law estimates."""
        return np.asarray(self._now("K"))

    @property
    def y(self) -> float:
        """Last innovation [µm]."""
        return float(self._now("y"))

    @property
    def S(self) -> float:
        """Variance of the last innovation as the law saw it [µm²]."""
        return float(self._now("S"))

    def _now(self, name: str) -> Any:
        """Present value of a result, from its place in the state."""
        value = self._state
        for field in self._places.get(name, (name,)):
            value = value[field]
        return np.array(value)

    @property
    @abstractmethod
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`."""

    @property
    def standard_errors(self) -> FloatArray:
        """Square roots of the diagonal of `P`, shape (n,)."""
        return np.sqrt(np.fmax(np.diag(self.P), 0.0))

    @property
    def status(self) -> Status:
        """How many samples were used, missing or left out; counts that an estimator does not have are 0."""
        found = self._counts(self._state)
        last = samples.NAMES[found.pop("last")]
        return Status(**found, projected=self._is_projected(), last=last)

    def _counts(self, state: Any) -> dict[str, int]:
        """Counts of a state, or of its law."""
        places, law = [(state, self._layout.by_name)], self._layout.by_name.get("law")
        if isinstance(law, Record):
            places.append((state["law"], law.by_name))
        names = ("samples", "updates", "missing", "held", "resets", "outliers", "last")
        return {n: int(next((place[n] for place, known in places if n in known), 0)) for n in names}

    def _is_projected(self) -> bool:
        """Whether `model` is not `theta` itself."""
        return False

    @property
    def is_waiting(self) -> bool:
        """Whether `predict` was called, and `update` not yet."""
        return self._pending is not None

    def predict(self, u: float | None) -> None:
        """Take the voltage of the next sample; `update` completes it.

        Parameters
        ----------
        u : float
            Voltage [V]; any kind of number, as in `step`. A second `predict` without `update` means that the
            first sample had no measurement.
        """
        if self._pending is not None:
            self._sample(self._pending, np.nan)
        self._pending = number_or_nan(u)

    def update(self, x: float | None) -> None:
        """Take the measurement that belongs to the last `predict`.

        Parameters
        ----------
        x : float or None
            Displacement [µm]; any kind of number, as in `step`; None, NaN or infinity if there is none.

        Raises
        ------
        ValueError
            If there was no `predict` before.
        """
        if self._pending is None:
            raise ValueError("update(x) needs the sample's voltage: call predict(u) before, or step(u, x)")
        u, self._pending = self._pending, None
        self._sample(u, number_or_nan(x))

    def step(self, u: float | None, x: float | None) -> None:
        """Process one sample: ``predict(u)`` and ``update(x)``.

        Parameters
        ----------
        u : float
            Voltage [V].
        x : float or None
            Measured displacement [µm]; None, NaN or infinity if there is none. The sample is then
            skipped and counted in `status`.

        Notes
        -----
        No error is raised, because a stream must not stop. Both arguments may be any kind of number, or an
        array, a list or a tuple of one. Anything else (text, a masked value, another shape) counts as
        missing.
        """
        if type(u) is not float:
            u = number_or_nan(u)
        if type(x) is not float:
            x = number_or_nan(x)
        if self._pending is not None:
            self.predict(u)
            self.update(x)
            return
        self._sample(u, x)

    def run(self, u: Any, x: Any, *, every: int = 1, record: tuple[str, ...] = ()) -> Trace:
        """Process a whole record, starting from the current state; the same as a loop of `step`.

        Parameters
        ----------
        u, x : array_like, shape (N,)
            Voltage [V] and measured displacement [µm]; NaN where a sample is missing.
        every : int
            Keep every k-th sample in the trace, the last of each k.
        record : tuple of str
            What the trace contains besides theta: any of ``"y"``, ``"S"``, ``"P"``.

        Returns
        -------
        Trace

        Raises
        ------
        ValueError
            If the shapes do not match or a name in `record` is unknown.
        """
        u, x = self._records(u, x)
        if record and (unknown := sorted(set(record) - {"y", "S", "P"})):
            raise ValueError(f"record holds unknown names {unknown}: choose from 'y', 'S', 'P'")
        every = integer("every", every, 1)
        return self._run(u, x, every, frozenset(record))

    def _records(self, u: Any, x: Any) -> tuple[FloatArray, FloatArray]:
        """Check records, and finish what `predict` has left over."""
        u = array_1d("u", u, allow_nan=True, sample_rate=self.sample_rate)
        x = array_1d("x", x, allow_nan=True, sample_rate=self.sample_rate)
        if u.size != x.size:
            raise ValueError(f"u and x must have the same length, got {u.size} and {x.size}")
        if self._pending is not None:
            self._sample(self._pending, np.nan)
            self._pending = None
        return u, x

    def absorb(self, u: FloatArray, x: FloatArray) -> None:
        """Do the same as `run`, but return no trace.

        Parameters
        ----------
        u, x : array_like, shape (N,)
            Voltage [V] and measured displacement [µm].
        """
        self.run(u, x, every=max(1, u.size))

    def reset(self) -> None:
        """Return to the state after construction."""
        self._load(self._start)
        self._pending = None

    def to_dict(self) -> dict[str, Any]:
        """Return arguments and state as a JSON-safe dictionary, from which `from_dict` continues exactly."""
        pending = self._pending
        return {
            "estimator": type(self).__name__,
            "format": _FORMAT,
            "arguments": copy.deepcopy(self._arguments),
            "state": by_name(self._layout, self._state),
            # JSON has no NaN.
            "pending": pending if pending is None or np.isfinite(pending) else "missing",
        }

    @classmethod
    def _revive(cls, arguments: dict[str, Any]) -> dict[str, Any]:
        """Constructor's arguments from their JSON-safe form."""
        revived = dict(arguments)
        for name, read in _READ.items():
            if isinstance(revived.get(name), dict):
                revived[name] = read(revived[name])
        if "policies" in revived:
            if not isinstance(revived["policies"], list | tuple):
                raise ValueError(f"policies must be a list, got {revived['policies']!r}")
            revived["policies"] = tuple(policy_from_dict(item) for item in revived["policies"])
        return revived

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Make an estimator that continues where `to_dict` was called.

        Parameters
        ----------
        data : dict
            What `to_dict` returned, also after conversion to JSON and back.

        Raises
        ------
        ValueError
            If the dictionary is of another class or format, a field is missing or unknown, an argument is
            refused, or the state is none that the estimator can have been in.
        """
        needed = ("arguments", "state", "pending", *cls._saved_too)
        saved_state.check_head("estimator", cls.__name__, _FORMAT, data, needed)
        estimator: Self = saved_state.construct(cls, data["arguments"])
        estimator._load(
            saved_state.check(data["state"], estimator._layout, estimator._start, estimator._rules)
        )
        estimator._restore(data)
        return estimator

    def _restore(self, data: dict[str, Any]) -> None:
        """Go on from what is saved beside the state."""
        self._pending = saved_state.pending_voltage(data["pending"])
