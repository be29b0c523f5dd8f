"""The face that every estimator shows, and what they share behind it."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Protocol, Self, runtime_checkable

import numpy as np

from piezoest._checks import FloatArray, array_1d, integer, number_or_nan
from piezoest.estimators import saved_state
from piezoest.models import Model, model_from_dict
from piezoest.policies import policy_from_dict

# For the histories that a compiled loop is not asked for.
NONE, NO_ROWS = np.empty(0), np.empty((0, 0))

_FORMAT = 1


@runtime_checkable
class Estimator(Protocol):
    """What `piezoest.track` needs of an estimator; any class with these two will do.

    An estimator may also have ``run(u, x)``, which `track` then prefers to a loop of ``step``.
    """

    @property
    def model(self) -> Model:
        """Model as known now."""

    def step(self, u: float, x: float | None) -> None:
        """Take one sample.

        Parameters
        ----------
        u : float
            Voltage [V].
        x : float or None
            Measured displacement [µm]; None if it is missing.
        """


@dataclass(frozen=True, slots=True)
class Status:
    """What happened to the samples an estimator was given.

    Parameters
    ----------
    samples : int
        Samples seen.
    updates : int
        Samples that moved the estimate.
    missing : int
        Samples without a usable voltage or displacement (None, NaN, infinite).
    held : int
        Samples with a measurement that was not taken: too little excitation to say anything, or an update
        that would not be a number, or one beyond all measure.
    resets : int
        Times the covariance was reset, also where it was lost or an update was not taken for that reason.
    projected : bool
        Whether `model` is the nearest admissible one and not `theta` itself.
    last : str
        What became of the last sample: ``"waiting"``, ``"updated"``, ``"missing"``, ``"held"``
        or ``"rejected"``.
    outliers : int
        Measurements that were rejected as ones the stage cannot have made.
    """

    samples: int
    updates: int
    missing: int
    held: int
    resets: int
    projected: bool
    last: str
    outliers: int = 0


@dataclass(frozen=True, slots=True)
class Trace:
    """History of an estimator over a `run`, every k-th sample.

    Parameters
    ----------
    index : ndarray of int, shape (M,)
        Positions in the record that was run.
    theta : ndarray, shape (M, n)
        Parameters after that sample.
    parameter_names : tuple of str
        Names of the columns of `theta`.
    y, S : ndarray or None, shape (M,)
        Innovation and its variance, if asked for.
    P : ndarray or None, shape (M, n, n)
        Covariance, if asked for.
    """

    index: np.ndarray[Any, np.dtype[np.int64]]
    theta: FloatArray
    parameter_names: tuple[str, ...]
    y: FloatArray | None = None
    S: FloatArray | None = None
    P: FloatArray | None = field(default=None, repr=False)


class Compiled(NamedTuple):
    """Functions on flat arrays that an estimator consists of; a controller's code is generated from them.

    Parameters
    ----------
    sample : callable
        ``sample(state, config, u, x)``: one sample.
    proposed : callable
        ``proposed(state, config, terms, model)``: admissible (alpha, beta, gamma, offset), or
        (gain, -, -, offset), into `model`.
    frozen : int or None
        Position in the state of a flag that holds the estimate; None if there is none.
    unneeded : tuple of callable
        Functions within `sample` that no model depends on: a controller leaves them out.
    """

    sample: Any
    proposed: Any
    frozen: int | None
    unneeded: tuple[Any, ...] = ()


class EstimatorBase(ABC):
    """Shared behaviour: one flat state array, from which all else is derived.

    A subclass keeps everything that changes in ``self._state`` (flat float64) and its
    constructor's JSON-safe arguments in ``self._arguments``; copying, saving, resetting and
    pickling then need nothing more.
    """

    __slots__ = ("_arguments", "_pending", "_start", "_state")

    #: Promises of the face this class does not keep: name of the promise to the reason.
    conformance_exceptions: ClassVar[dict[str, str]] = {}

    #: What the class saves beside its state.
    _saved_too: ClassVar[tuple[str, ...]] = ()

    _arguments: dict[str, Any]
    _pending: float | None
    _start: FloatArray
    _state: FloatArray

    def _begin(self, arguments: dict[str, Any], state: FloatArray) -> None:
        self._arguments = arguments
        self._state = state
        self._start = state.copy()
        self._pending = None

    def _load(self, state: FloatArray) -> None:
        """Take over a state."""
        self._state[:] = state

    @abstractmethod
    def _sample(self, u: float, x: float) -> None:
        """Take one sample; NaN in either is a missing measurement."""

    @abstractmethod
    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        """Take checked records."""

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        return float(self._arguments["sample_rate"])

    @property
    @abstractmethod
    def model(self) -> Model:
        """Admissible model as known now, ready for a compensator."""

    @property
    @abstractmethod
    def theta(self) -> FloatArray:
        """Parameters as estimated, shape (n,), in the order of `parameter_names`."""

    @property
    @abstractmethod
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`."""

    @property
    @abstractmethod
    def status(self) -> Status:
        """What happened to the samples so far."""

    def predict(self, u: float | None) -> None:
        """Take the voltage of the next sample; `update` completes it.

        Parameters
        ----------
        u : float
            Voltage [V]; of any kind, as in `step`. A second `predict` without an `update` between them
            makes the first a sample without a measurement.
        """
        if self._pending is not None:
            self._sample(self._pending, np.nan)
        self._pending = number_or_nan(u)

    def update(self, x: float | None) -> None:
        """Take the measurement that belongs to the last `predict`.

        Parameters
        ----------
        x : float or None
            Displacement [µm]; of any kind, as in `step`; None, NaN or infinity where there is none.

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
        """Take one sample: ``predict(u)`` and ``update(x)``.

        Parameters
        ----------
        u : float
            Voltage [V].
        x : float or None
            Measured displacement [µm]; None, NaN or infinity where there is none: the
            sample is skipped and `status` says so.

        Notes
        -----
        Nothing is raised: a stream must not stop. Both may be what a driver returns: a number of any kind,
        or an array, a list or a tuple of one. Whatever else comes (text, a masked value, another shape)
        counts as missing.
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
        """Take a whole record; continues from the current state, the same as a loop of `step`.

        Parameters
        ----------
        u, x : array_like, shape (N,)
            Voltage [V] and measured displacement [µm]; NaN where a sample is missing.
        every : int
            Keep every k-th sample in the trace, the last of each k.
        record : tuple of str
            What to keep beside theta: any of ``"y"``, ``"S"``, ``"P"``.

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
            raise ValueError(f"record holds unknown names {unknown}: choose of 'y', 'S', 'P'")
        every = integer("every", every, 1)
        return self._run(u, x, every, frozenset(record))

    def _records(self, u: Any, x: Any) -> tuple[FloatArray, FloatArray]:
        """Check records, and take what `predict` has left over."""
        # The compiled loops take writeable arrays only, though they write into none.
        u = array_1d("u", u, allow_nan=True)
        x = array_1d("x", x, allow_nan=True)
        if not (u.flags.writeable and x.flags.writeable):
            u, x = u.copy(), x.copy()
        if u.size != x.size:
            raise ValueError(f"u and x must have the same length, got {u.size} and {x.size}")
        if self._pending is not None:
            self._sample(self._pending, np.nan)
            self._pending = None
        return u, x

    def _absorb(self, u: FloatArray, x: FloatArray) -> None:
        """Do as `run`, but keep nothing."""
        self.run(u, x, every=max(1, u.size))

    def reset(self) -> None:
        """Return to the state after construction."""
        self._load(self._start)
        self._pending = None

    def copy(self) -> Self:
        """Return an independent estimator in the same state."""
        return copy.deepcopy(self)

    def __copy__(self) -> Self:
        return self.copy()

    def to_dict(self) -> dict[str, Any]:
        """Return arguments and state as a JSON-safe dictionary; `from_dict` resumes bit for bit."""
        return {
            "estimator": type(self).__name__,
            "format": _FORMAT,
            "arguments": copy.deepcopy(self._arguments),
            "state": saved_state.to_save(self._state, self._table()),
            # JSON knows no NaN.
            "pending": "missing"
            if self._pending is not None and not np.isfinite(self._pending)
            else self._pending,
        }

    @classmethod
    def _revive(cls, arguments: dict[str, Any]) -> dict[str, Any]:
        """Constructor's arguments from their JSON-safe form: the initial model and the policies, if any."""
        revived = dict(arguments)
        if revived.get("initial_model") is not None:
            revived["initial_model"] = model_from_dict(revived["initial_model"])
        if "policies" in revived:
            if not isinstance(revived["policies"], list | tuple):
                raise ValueError(f"policies must be a list, got {revived['policies']!r}")
            revived["policies"] = tuple(policy_from_dict(item) for item in revived["policies"])
        return revived

    @abstractmethod
    def _table(self) -> saved_state.Table:
        """What the state consists of."""

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Make an estimator that continues where `to_dict` was called.

        Parameters
        ----------
        data : dict
            What `to_dict` returned, also after a round trip through JSON.

        Raises
        ------
        ValueError
            If the dictionary is of another class or format, a field is missing or unknown, an argument is
            refused, or the state is none that the estimator can have been in.
        """
        saved_state.check_head(cls.__name__, _FORMAT, data, cls._saved_too)
        estimator: Self = saved_state.construct(cls, data["arguments"])
        estimator._load(saved_state.check(data["state"], estimator._table(), estimator._start))
        estimator._pending = saved_state.pending_voltage(data["pending"])
        return estimator


class Freezable(EstimatorBase):
    """An estimator whose estimate can be held, by a flag in its state."""

    __slots__ = ()

    #: Position of the flag in the state.
    _frozen_at: ClassVar[int]

    @property
    def frozen(self) -> bool:
        """Whether the estimate is held; settable. Samples are then counted as held."""
        return bool(self._state[self._frozen_at])

    @frozen.setter
    def frozen(self, frozen: bool) -> None:
        self._state[self._frozen_at] = float(bool(frozen))
