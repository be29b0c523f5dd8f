"""Models as they come from files: of whichever class, and with what they were learnt on."""

import inspect
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, Self

from piezoest._checks import class_named, instance
from piezoest._files import read_object
from piezoest.models._base import REGISTERED, Model
from piezoest.models.learnt_on import LearntOn

NO_MODEL = "model: write it with identify --output"  # behind the name of a file that holds none


def model_from_dict(data: Any) -> Model:
    """Make the model that its `to_dict` described, of whichever class.

    Parameters
    ----------
    data : dict
        With the name of the class under ``"model"``.

    Raises
    ------
    ValueError
        If the name is unknown or the fields do not fit.
    """
    known = [each for each in REGISTERED.values() if not inspect.isabstract(each)]
    classes = [each for each in known if hasattr(each, "__dataclass_fields__")]  # not their base class
    return class_named(data, "model", classes).from_dict(data)


@dataclass(frozen=True, slots=True)
class LearntModel:
    """A model, and what it was learnt on.

    Parameters
    ----------
    model : Model
        The model.
    learnt_on : LearntOn, optional
        Ranges of the log that it was learnt on; None if nobody knows them.

    Raises
    ------
    ValueError
        If they are of other classes.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.models.LearntModel.of(pz.LinearGain(0.15)).model
    LinearGain(gain=0.15, offset=0.0)
    """

    model: Model
    learnt_on: LearntOn | None = None

    def __post_init__(self) -> None:
        instance("model", self.model, Model, "a model, as LinearGain(0.15)")
        instance("learnt_on", self.learnt_on, LearntOn | None, "a LearntOn, or None")

    @classmethod
    def of(cls, given: Any) -> Self:
        """Return a model with its ranges, in whatever form it comes.

        Parameters
        ----------
        given : Model, path or object with ``model``
            Path of a JSON file; an object may have ``learnt_on`` beside its ``model``, as what
            `piezoest.identify` returns.

        Raises
        ------
        OSError
            If the file cannot be read.
        ValueError
            If there is no model.
        """
        if isinstance(given, str | PathLike):
            return cls.read(given)
        if isinstance(given, Model):
            return cls(given)
        expected = "a model, as LinearGain(0.15), a file with one, or what has one, as identify() returns"
        model = instance("model", getattr(given, "model", given), Model, expected)
        return cls(model, getattr(given, "learnt_on", None))

    @classmethod
    def read(cls, path: str | PathLike[str]) -> Self:
        """Return the model of a JSON file.

        Parameters
        ----------
        path : path
            Written by ``piezoest identify --output``, or what `to_dict` of a model gave.

        Raises
        ------
        OSError
            If it cannot be read.
        ValueError
            If it is not JSON, or holds no model; names the file.
        """
        data = read_object(str(path), NO_MODEL)
        if not isinstance(data.get("model", ""), dict | str):
            raise ValueError(f"{path} holds no {NO_MODEL}")
        try:
            return cls.from_dict(data)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary, with the ranges under ``"learnt_on"``."""
        return {
            "model": self.model.to_dict(),
            "learnt_on": None if self.learnt_on is None else self.learnt_on.to_dict(),
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Make it from what `to_dict` gave, here or of a model.

        Parameters
        ----------
        data : dict
            With a model's dictionary under ``"model"``; what else stands there is left alone. Or a model's
            dictionary itself; without the name of a class it is of a `ColemanHodgdon`.

        Raises
        ------
        ValueError
            If there is no model, or model or ranges are refused.
        """
        nested = isinstance(instance("data", data, dict, "a model's dictionary").get("model"), dict)
        described = data["model"] if nested else data
        ranges = data.get("learnt_on") if nested else None
        return cls(
            model_from_dict({"model": "ColemanHodgdon", **described}),
            None if ranges is None else LearntOn.from_dict(ranges),
        )

    def with_offset(self, offset: float) -> Self:
        """Return it with another offset of the model, and the displacement learnt on shifted alike.

        Parameters
        ----------
        offset : float
            Of the model [µm].
        """
        model: Any = replace(self.model, offset=offset)  # type: ignore[type-var]
        if self.learnt_on is None:
            return replace(self, model=model)
        low, high = (each + model.offset - self.model.offset for each in self.learnt_on.displacement)
        return replace(self, model=model, learnt_on=replace(self.learnt_on, displacement=(low, high)))
