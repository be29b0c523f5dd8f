"""What every model has: named parameters with units, a vector form and a dictionary form."""

from __future__ import annotations

import dataclasses
import functools
from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

import numpy as np

from piezoest._checks import WILDEST, FloatArray, array_1d, fields, finite


@functools.cache
def _field_names(model: Any) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(model))


def _field_kinds(cls: Any) -> tuple[list[str], list[str]]:
    """Names of the fields that a dataclass must be given, and of those that it may be."""
    every, missing = dataclasses.fields(cls), dataclasses.MISSING
    needed = [each.name for each in every if each.default is each.default_factory is missing]
    return needed, [each.name for each in every if each.name not in needed]


def _plain(value: Any) -> Any:
    """As JSON has it."""
    return value.tolist() if isinstance(value, np.ndarray) else list(value) if type(value) is tuple else value


class AsFields:
    """A frozen dataclass that is saved as its fields; with arrays in it, equal by what is saved."""

    __slots__ = ()

    #: What messages call its dictionary, if not by its class.
    called: ClassVar[str] = ""
    #: Name under which its dictionary has the name of the class; empty if it has not.
    named_under: ClassVar[str] = ""

    def _keep(self, **values: Any) -> None:
        """Set the fields, once; arrays are then nobody's to write to."""
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary of the fields; that of a model names its class under ``"model"``."""
        kind: Any = type(self)
        head = {self.named_under: kind.__name__} if self.named_under else {}
        return head | {name: _plain(getattr(self, name)) for name in _field_names(kind)}

    @classmethod
    def from_dict(cls, data: Any) -> Self:
        """Make it from what `to_dict` gave.

        Parameters
        ----------
        data : dict
            The dictionary; a name of a class in it must be that of this one.

        Raises
        ------
        ValueError
            If a field is missing, unknown or refused, or the dictionary is of another class.
        """
        needed, optional = _field_kinds(cls)
        values = dict(fields(cls.called or cls.__name__, data, needed, [cls.named_under, *optional]))
        if (name := values.pop(cls.named_under, cls.__name__)) != cls.__name__:
            raise ValueError(f"data is of a {name}, not of a {cls.__name__}")
        return cls(**cls._read(values))

    @classmethod
    def _read(cls, values: dict[str, Any]) -> dict[str, Any]:
        """Arguments of the constructor from the fields of a dictionary."""
        return values

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
            return NotImplemented
        return self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(repr(self.to_dict()))


def finite_voltage(model: Model, u: FloatArray) -> FloatArray:
    """Return the voltage that a model's inverse gave."""
    bad = np.flatnonzero(~np.isfinite(u))
    if bad.size:
        raise ValueError(
            f"r is out of reach of {model}: {bad.size} samples of the voltage are not finite (first at "
            f"index {bad[0]}): check the units of both"
        )
    return u


def rising_pair(thresholds: Any, weights: Any) -> tuple[FloatArray, FloatArray]:
    """Rising thresholds above zero and as many weights, as arrays of their own."""
    thresholds = array_1d("thresholds", thresholds).copy()
    weights = array_1d("weights", weights).copy()
    if thresholds.size != weights.size:
        raise ValueError(
            f"weights must have one value per threshold, got {weights.size} weights for "
            f"{thresholds.size} thresholds"
        )
    if np.any(np.diff(thresholds) <= 0.0):
        raise ValueError(
            f"thresholds must rise from entry to entry, got {thresholds}: "
            "sort them together with the weights and merge equal ones"
        )
    if thresholds.size and thresholds[0] <= 0.0:
        raise ValueError(
            f"thresholds must be above zero, got {thresholds[0]:g} first: "
            "add the weight of a threshold of zero to the gain"
        )
    return thresholds, weights


#: Every class of models by its name.
REGISTERED: dict[str, type[Model]] = {}


class Model(AsFields, ABC):
    """Base of the models of a stage: voltage u [V] to displacement x [µm].

    A model is a frozen dataclass; the fields named in `parameter_names` make up `theta`, and ``offset`` is
    its displacement at rest. One with an inverse for compensators names the module of its compiled
    functions as ``inverse``, see `piezoest.compensators.inverse_kernel`, and has `inverse_settings`.
    """

    __slots__ = ()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        REGISTERED[cls.__name__] = cls

    named_under = "model"
    parameter_names: ClassVar[tuple[str, ...]] = ()
    parameter_units: ClassVar[tuple[str, ...]] = ()

    offset: float

    #: Module of the compiled functions of the inverse; None if there is none.
    inverse: ClassVar[Any] = None
    #: What to do about a model that is not admissible.
    remedy: ClassVar[str] = "it has to rise with the voltage"

    @property
    @abstractmethod
    def is_admissible(self) -> bool:
        """Whether displacement rises with voltage and the inverse exists."""

    @property
    def is_in_range(self) -> bool:
        """Whether no parameter is beyond what its inverse can use: an estimator can run away."""
        return all(abs(value) < WILDEST for value in (*self.theta.tolist(), self.offset))

    def inverse_settings(self, sample_rate: float | None) -> dict[str, Any]:
        """Numbers by name that the compiled functions of the inverse are given.

        Parameters
        ----------
        sample_rate : float or None
            [Hz]; None if it is not known.

        Raises
        ------
        ValueError
            If the model has no inverse, or needs a sample rate.
        """
        raise ValueError(f"{type(self).__name__} has no inverse")

    @property
    def slope(self) -> float:
        """Slope from rest [µm/V], about."""
        return self.line[0]

    @property
    def line(self) -> tuple[float, float]:
        """Gain [µm/V] and offset [µm] of a line, as far as they are known before anything is measured."""
        x = self.simulate(np.array([0.0, 1e-3, 0.0, 1.0]))  # type: ignore[attr-defined]
        return float(x[-1] - x[0]), float(x[0])

    @property
    def theta(self) -> FloatArray:
        """Parameters in the order of `parameter_names`, shape (n,)."""
        return np.array([getattr(self, name) for name in self.parameter_names], dtype=np.float64)

    @classmethod
    def from_theta(cls, theta: Any, offset: float = 0.0) -> Self:
        """Make the model from its parameter vector.

        Parameters
        ----------
        theta : array_like, shape (n,)
            Parameters in the order and units of `parameter_names`.
        offset : float
            Displacement at zero voltage and no hysteresis [µm].

        Raises
        ------
        ValueError
            If the length is wrong or a value is not finite.
        """
        values = array_1d("theta", theta)
        if values.size != len(cls.parameter_names):
            raise ValueError(
                f"theta must hold {len(cls.parameter_names)} parameters "
                f"({', '.join(cls.parameter_names)}), got {values.size}"
            )
        return cls(*(float(value) for value in values), offset=float(offset))  # type: ignore[call-arg]

    def _check_finite(self) -> None:
        for name in _field_names(type(self)):
            given = getattr(self, name)
            value = finite(name, given)
            if value is not given:  # a live loop makes a model now and then, of plain numbers
                object.__setattr__(self, name, value)
