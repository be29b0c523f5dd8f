"""What an output-error fit needs of a model: its equation, its coordinates and where to start."""

from abc import abstractmethod
from collections.abc import Collection, Mapping
from typing import Any, ClassVar, Self

from piezoest._checks import FloatArray
from piezoest.models._base import Model


class FreeRunning(Model):
    """A model that an output-error fit can vary: all that the fit knows of it is here.

    A fit varies coordinates, which stand for the parameters: `parameter_names`, ``offset`` and the
    states before the first sample, `state_names`. By default they are the parameters themselves. The
    methods on values take numbers and CasADi's symbols alike.
    """

    __slots__ = ()

    #: Displacement at zero voltage, at rest [µm].
    offset: float
    #: States that the model carries from sample to sample.
    state_names: ClassVar[tuple[str, ...]] = ()
    #: Whether it is a loop (2), (3), which is linear in all but alpha: a fit finds its start by that.
    is_loop: ClassVar[bool] = False

    @classmethod
    def guess(cls, u: FloatArray, x: FloatArray) -> Self | None:
        """Model of a record's size to start from; None where the record alone does not say.

        Parameters
        ----------
        u, x : ndarray, shape (N,)
            Voltage [V] without gaps, and displacement [µm] with NaN where it is missing.
        """
        return None

    @classmethod
    def coordinates(cls, held: Collection[str], within_reach: bool) -> tuple[str, ...]:
        """Names of what is varied.

        Parameters
        ----------
        held : collection of str
            Parameters whose values are given.
        within_reach : bool
            Whether the start states are kept to what a voltage can bring about.
        """
        return tuple(name for name in (*cls.parameter_names, "offset", *cls.state_names) if name not in held)

    @classmethod
    def complete(cls, value: dict[str, Any]) -> None:
        """Add the parameters that the coordinates stand for.

        Parameters
        ----------
        value : dict
            Values of coordinates and held parameters by name.
        """

    @classmethod
    def constants(cls, value: Mapping[str, Any]) -> tuple[Any, ...]:
        """What `free_step` needs.

        Parameters
        ----------
        value : mapping
            Parameters by name.
        """
        return tuple(value[name] for name in cls.parameter_names)

    @classmethod
    @abstractmethod
    def free_step(cls, state: Any, u_0: Any, u_1: Any, constants: Any) -> tuple[tuple[Any, ...], Any]:
        """State and displacement without offset [µm] after a sample.

        Parameters
        ----------
        state : sequence
            Before the sample, in the order of `state_names`.
        u_0, u_1 : number or symbol
            Voltage before and after [V]; monotone between.
        constants : sequence
            What `constants` gave.
        """

    def coordinate_values(self) -> dict[str, float]:
        """Values by name of all coordinates that there can be, moved into the admissible set."""
        parameters = dict(zip(self.parameter_names, self.theta.tolist(), strict=True))
        return parameters | {"offset": self.offset} | dict.fromkeys(self.state_names, 0.0)

    @classmethod
    def bounds(cls, start: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """Admissible set of the coordinates, as a box; a name that is not there is free.

        Parameters
        ----------
        start : mapping
            Coordinates by name that the fit starts from.
        """
        return {}

    @classmethod
    def sizes(cls, value: Mapping[str, float]) -> dict[str, float]:
        """What the uncertainty of each coordinate is a part of.

        Parameters
        ----------
        value : mapping
            Coordinates by name.
        """
        return {name: abs(number) for name, number in value.items()}

    @classmethod
    def check_fixed(cls, fixed: Mapping[str, float]) -> None:
        """Refuse parameters that no admissible model has.

        Parameters
        ----------
        fixed : mapping
            Parameters by name that are held.

        Raises
        ------
        ValueError
            If so.
        """
        own = [fixed[name] for name in cls.parameter_names if name in fixed]
        if len(own) == len(cls.parameter_names) and not cls.from_theta(own).is_admissible:
            raise ValueError(f"fixed parameters are not admissible: {dict(fixed)}: see {cls.__name__}")

    @abstractmethod
    def lifted(self, start: Self, least: float) -> Self:
        """The model, its slope and its decay lifted to a part of the start's.

        A smaller slope means a larger voltage. A dead sensor that reads zero must not cause one.

        Parameters
        ----------
        start : FreeRunning
            Model of the same class.
        least : float
            The part.
        """

    def simulate(self, u: FloatArray) -> FloatArray:
        """Displacement [µm], shape (N,), for a voltage record, from rest at 0 V.

        Parameters
        ----------
        u : array_like, shape (N,)
            Voltage [V].
        """
        raise NotImplementedError

    def invert(self, r: FloatArray) -> FloatArray:
        """Voltage [V], shape (N,), under which the model follows a reference exactly, from rest at 0 V.

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm].

        Raises
        ------
        ValueError
            If the model is not admissible, or the voltage is too large for a number.
        """
        raise NotImplementedError

    @property
    def loop(self) -> tuple[float, float, float]:
        """(a, b, c) of x = c u + w_h + offset (2), (3), by which a live sample is predicted.

        Raises
        ------
        ValueError
            If the model has no such form.
        """
        raise ValueError(f"{type(self).__name__} has no form x = c u + w_h + offset")
