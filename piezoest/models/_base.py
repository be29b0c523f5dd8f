"""What every model has: named parameters with units, a vector form and a dictionary form."""

from __future__ import annotations

import dataclasses
import functools
from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d, fields, finite


@functools.cache
def _field_names(kind: Any) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(kind))


def _is_needed(field: Any) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def finite_voltage(model: Model, u: FloatArray) -> FloatArray:
    """Return the voltage that a model's inverse gave.

    Raises
    ------
    ValueError
        If it is not a number somewhere.
    """
    bad = np.flatnonzero(~np.isfinite(u))
    if bad.size:
        raise ValueError(
            f"r is out of reach of {model}: {bad.size} samples of the voltage are not finite (first at "
            f"index {bad[0]}): check the units of both"
        )
    return u


class Model(ABC):
    """Base of the models of a stage: voltage u [V] to displacement x [µm].

    A model is a frozen dataclass; the fields named in `parameter_names` make up `theta`.
    """

    __slots__ = ()

    parameter_names: ClassVar[tuple[str, ...]] = ()
    parameter_units: ClassVar[tuple[str, ...]] = ()

    @property
    @abstractmethod
    def is_admissible(self) -> bool:
        """Whether displacement rises with voltage and the inverse exists."""

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

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary with the class name under ``"model"``."""
        return {"model": type(self).__name__, **dataclasses.asdict(self)}  # type: ignore[call-overload]

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Make the model from what `to_dict` gave.

        Parameters
        ----------
        data : dict
            The dictionary; ``"model"``, if there, must name this class.

        Raises
        ------
        ValueError
            If a field is missing or unknown, or the dictionary is of another model.
        """
        every = dataclasses.fields(cls)  # type: ignore[arg-type]
        needed = [field.name for field in every if _is_needed(field)]
        optional = ["model", *(field.name for field in every if not _is_needed(field))]
        values = dict(fields(cls.__name__, data, needed, optional))
        if (name := values.pop("model", cls.__name__)) != cls.__name__:
            raise ValueError(f"data is of a {name}, not of a {cls.__name__}")
        return cls(**values)
