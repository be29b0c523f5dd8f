"""What linear and inverse feed-forward share: the model's inverse, limits, gradual change of the model."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from piezoest._checks import FloatArray, array_1d, instance, integer, measured, number_or_nan, positive
from piezoest.compensators import corridor
from piezoest.compensators import inverse_kernel as kernel
from piezoest.compensators.limits import VoltageLimits, check_rate, resting
from piezoest.layout import Copied, Named, Record, new
from piezoest.models import Model

Method = Literal["closed-form", "bogacki-shampine"]
HandOver = Literal["path", "place"]


@dataclass(frozen=True, slots=True)
class CompensatorStatus:
    """Counts of the samples of a compensator.

    Parameters
    ----------
    samples : int
        Reference samples seen.
    saturated, slewed : int
        Number of samples at which the voltage was limited by the range or by the slew rate.
    missing : int
        Samples without a usable reference: the voltage was held.
    projected : bool
        Whether the model set last could not be used: its nearest admissible one is used, or it was ignored.

    Examples
    --------
    >>> import piezoest as pz
    >>> compensator = pz.LinearCompensator(pz.LinearGain(0.15), pz.VoltageLimits(0.0, 10.0))
    >>> u = compensator.run([0.0, 1.0, 2.0])
    >>> compensator.status.saturated  # the third voltage would be 13.3 V
    1
    """

    samples: int
    saturated: int
    slewed: int
    missing: int
    projected: bool


class Compensator(Copied):
    """Feed-forward through the inverse of a model. See `LinearCompensator` and `InverseCompensator`."""

    __slots__ = (
        "_layouts", "_limits", "_loops", "_model", "_options", "_projected", "_sample_rate", "_settings",
        "_start", "_state", "_waiting",
    )  # fmt: skip

    _machine_code: ClassVar[tuple[str, ...]] = ("_loops",)

    _layouts: tuple[Record, Record]
    _loops: tuple[Any, Any] | None

    def __init__(
        self,
        model: Model,
        limits: VoltageLimits | None,
        method: Method,
        transfer_samples: int,
        sample_rate: float | None = None,
        hand_over: HandOver = "path",
    ) -> None:
        limits = instance("limits", limits, VoltageLimits | None, "VoltageLimits(minimum, maximum)")
        self._limits: VoltageLimits = limits or VoltageLimits()
        self._sample_rate = self._limits.sample_rate
        if sample_rate is not None:
            self._sample_rate = positive("sample_rate", sample_rate)
            check_rate(self._limits, self._sample_rate)
        transfer_samples = integer("transfer_samples", transfer_samples)
        if method not in ("closed-form", "bogacki-shampine"):
            raise ValueError(f"method must be 'closed-form' or 'bogacki-shampine', got {method!r}")
        if hand_over not in ("path", "place"):
            raise ValueError(f"hand_over must be 'path' or 'place', got {hand_over!r}")
        self._options = {
            **{name: getattr(self._limits, name) for name in ("minimum", "maximum", "largest_step")},
            "decay": np.exp(-1.0 / transfer_samples) if transfer_samples else 0.0,
            "integrated": method == "bogacki-shampine",
            "by_path": hand_over == "path",
        }
        if not self._accepts(model).is_admissible:
            raise ValueError(f"model {model} is not admissible and has no inverse: {model.remedy}")
        self._start = model
        self.reset()

    def __repr__(self) -> str:
        """Class and model."""
        return f"<{type(self).__name__}: {self.model}>"

    @property
    def state(self) -> Any:
        """Its state: a NumPy structured array with named fields, such as ``state["voltage"]``."""
        return self._state

    @property
    def settings(self) -> Any:
        """What compiled code is given beside `state`, by name: a NumPy structured array."""
        return self._settings

    @property
    def layouts(self) -> tuple[Record, Record]:
        """Layouts of `state` and `settings`, see `piezoest.compensators.inverse_kernel`."""
        return self._layouts

    def reset(self, voltage: float | None = None, displacement: float | None = None) -> None:
        """Return to the state after construction, with the model given there.

        Parameters
        ----------
        voltage : float, optional
            Voltage at which the stage rests [V], within the limits. Default: the one nearest to 0 V.
        displacement : float, optional
            Reading of the sensor there [µm]. Default: what the model expects. The difference to it decays
            over `transfer_samples`, as after a change of model: the voltage does not jump.

        Raises
        ------
        ValueError
            If the voltage is outside the limits, or the displacement is not a number.

        Examples
        --------
        >>> import piezoest as pz
        >>> compensator = pz.LinearCompensator(pz.LinearGain(0.15))
        >>> compensator.reset(voltage=20.0, displacement=3.1)
        >>> round(compensator.step(3.1), 2)  # where the stage is; the model alone has 20.67 V
        20.0
        """
        u = resting(self._limits, voltage)
        x = None if displacement is None else measured("displacement", displacement)
        self._projected = False
        self._waiting: Model | None = None
        self._model = self._start
        self._make_room()
        kernel.begin(*self._named(), u, self._model.slope, x)

    def _make_room(self) -> None:
        """State of zeros, and settings, for the model."""
        values = self._model.inverse_settings(self._sample_rate)
        self._layouts = kernel.layouts(*self._model.inverse.layouts(values))
        self._state = new(self._layouts[0])
        self._settings = new(self._layouts[1], **self._options, inverse=values)
        self._loops = None

    def _named(self) -> tuple[Named, Named]:
        """State and settings for kernel functions in Python."""
        return Named(self._state, self._layouts[0]), Named(self._settings, self._layouts[1])

    def _accepts(self, model: Model) -> Model:
        """Return the model if this compensator can invert it."""
        if getattr(model, "inverse", None) is None:
            raise ValueError(
                "model must be one with an inverse, as ColemanHodgdon, PrandtlIshlinskii and LinearGain, "
                f"got {type(model).__name__}"
            )
        return model

    @property
    def model(self) -> Model:
        """Model whose inverse is used. It can be set; the voltage then changes without a jump.

        A new model takes effect when the reference has moved by 1/64 of its last swing since the last change
        of the model, or has moved for as long as that swing took without going further: then small movements
        are the swings. Movements of less than 1e-4 of the range do not count. Until then the old model is
        used, and the last one that was set waits. When models are set often, the voltage stays in a corridor
        around linear feed-forward, whose gain is at least half the first model's
        (`piezoest.compensators.corridor`).

        The state w_h of the new model follows from `hand_over`, and its plays from the turning points of the
        voltage. The difference between the two models at the present voltage decays exponentially over
        `transfer_samples`. An inadmissible model is replaced by the nearest admissible one. An inadmissible
        `PrandtlIshlinskii` or `LinearGain`, or a model with parameters beyond 1e9, is ignored. `status`
        reports both cases.
        """
        return self._model

    @model.setter
    def model(self, model: Model) -> None:
        self._waiting = self._accepts(model)
        if self.hand_over_due:
            self._use_waiting()

    @property
    def hand_over_due(self) -> bool:
        """Whether a model that is set now takes effect immediately."""
        return bool(self._state["corridor"]["due"])

    def _use_waiting(self) -> None:
        """Use the model that was set last."""
        model, self._waiting = self._waiting, None
        assert model is not None
        self._projected = not (model.is_in_range and model.is_admissible)
        if self._projected:
            # Out of range its inverse gives no number.
            nearest = getattr(model, "nearest_admissible", None)
            if nearest is None or not model.is_in_range:
                corridor.hand_over(self._named()[0].corridor)  # the corridor stays
                return
            model = nearest()
        before, self._model = self._model, model
        if model.inverse is before.inverse and hasattr(model.inverse, "change"):
            numbers = np.array([*model.inverse_settings(self._sample_rate).values()])
            kernel.change.of(*self._layouts)(self._state, self._settings, numbers)
        else:
            self._change_inverse(before)

    def _change_inverse(self, before: Model) -> None:
        """Go on with a model whose numbers are others than those of the one before."""
        state, settings = self._state, self._settings
        old_state, old_settings = self._named()
        expected = old_state.inverse.expected(old_state, old_settings) + old_state.owed
        self._make_room()
        for name in state.dtype.names[:-1]:
            self._state[name] = state[name]
        stays = False
        if self._model.inverse is before.inverse:
            old, own = state["inverse"], self._state["inverse"]
            layout: Any = self._layouts[0].by_name["inverse"]
            for name in own.dtype.names:
                if name not in layout.lengths and own[name].shape == old[name].shape:
                    own[name] = old[name]
            known = getattr(self._model.inverse, "stays", None)
            stays = known is not None and known(settings["inverse"], self._settings["inverse"])
        kernel.go_on(*self._named(), expected, stays)

    @property
    def sample_rate(self) -> float | None:
        """That of the loop [Hz]; None if it was not given, and nothing depends on it."""
        if self._sample_rate is None and getattr(self._model, "creep", None) is not None:
            return getattr(self._model, "sample_rate", None)
        return self._sample_rate

    @property
    def limits(self) -> VoltageLimits:
        """Limits that the voltage never leaves."""
        return self._limits

    @property
    def voltage(self) -> float:
        """The last voltage [V]."""
        return float(self._state["voltage"])

    @property
    def limited(self) -> int:
        """+1 or -1 if the last voltage was limited from above or below, 0 if it was not limited."""
        return int(self._state["limited"])

    @property
    def status(self) -> CompensatorStatus:
        """What happened to the samples so far."""
        counts = {name: int(self._state[name]) for name in ("samples", "saturated", "slewed", "missing")}
        return CompensatorStatus(**counts, projected=self._projected)

    def step(self, r: float | None) -> float:
        """Voltage [V] for the next sample of the reference, within the limits.

        Parameters
        ----------
        r : float
            Reference displacement [µm]; NaN, infinity and anything that is not a number hold the last
            voltage.
        """
        if type(r) is not float:
            r = number_or_nan(r)
        if self._waiting is not None and self.hand_over_due:
            self._use_waiting()
        return self._compiled()[0](self._state, self._settings, r)

    def _compiled(self) -> tuple[Any, Any]:
        """Machine code for a sample and for a record."""
        if self._loops is None:
            self._loops = kernel.step.of(*self._layouts), kernel.run.of(*self._layouts)
        return self._loops

    def run(self, r: Any) -> FloatArray:
        """Voltages [V], shape (N,), for a whole reference: the same as a loop of `step` from here on.

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm]; NaN holds the last voltage.

        Raises
        ------
        ValueError
            If r is not a 1-D array of numbers.
        """
        r = array_1d("r", r, allow_nan=True, sample_rate=self.sample_rate)
        u = np.empty_like(r)
        start = 0
        while self._waiting is not None and start < r.size:
            u[start] = self.step(float(r[start]))
            start += 1
        self._compiled()[1](self._state, self._settings, r[start:], u[start:])
        return u


class AroundCompensator(Copied, ABC):
    """What is put around a feed-forward compensator, and shows its model, limits and status."""

    __slots__ = ("_compensator", "_sample_rate")

    def __init__(self, compensator: Compensator, sample_rate: float) -> None:
        expected = "a LinearCompensator or an InverseCompensator"
        self._compensator = instance("compensator", compensator, Compensator, expected)
        self._sample_rate = positive("sample_rate", sample_rate)
        check_rate(compensator, self._sample_rate, "the compensator is")

    def __repr__(self) -> str:
        """Class, and what it is around."""
        return f"<{type(self).__name__} around {self._compensator!r}>"

    @property
    def model(self) -> Model:
        """Model of the feed-forward; settable, bumpless."""
        return self._compensator.model

    @model.setter
    def model(self, model: Model) -> None:
        self._compensator.model = model

    @property
    def sample_rate(self) -> float:
        """That of the loop [Hz]."""
        return self._sample_rate

    @property
    def compensator(self) -> Compensator:
        """The feed-forward inside."""
        return self._compensator

    @property
    def limits(self) -> VoltageLimits:
        """Limits that the voltage never leaves."""
        return self._compensator.limits

    @property
    def status(self) -> CompensatorStatus:
        """What happened to the samples so far."""
        return self._compensator.status

    def reset(self, voltage: float | None = None, displacement: float | None = None) -> None:
        """Return to the state after construction, at rest.

        Parameters
        ----------
        voltage, displacement : float, optional
            Where the stage rests [V] and [µm], see `InverseCompensator.reset`.
        """
        self._compensator.reset(voltage, displacement)
        self._begin()

    @abstractmethod
    def _begin(self) -> None:
        """Begin with nothing seen."""
