"""One sample of the control loop on a controller: measurement, estimate, model, voltage."""

from typing import Any

import numpy as np

from piezoest._checks import WILDEST, FloatArray, array_1d, instance, integer
from piezoest.compensators import Compensator
from piezoest.compensators.limits import check_rate
from piezoest.compile import local
from piezoest.layout import COUNT, FLAG, MEASURED, Record, numbers, record
from piezoest.models import Model

# Voltage given out last, whether there is one, samples since the last change of model, whether the model is
# held, and the model: alpha, beta, gamma, offset, or gain, 0, 0, offset.
RING = record(voltage=MEASURED, started=FLAG, waited=COUNT, frozen=FLAG, model=numbers(4))


def settings_layout(estimator: Record) -> Record:
    """Layout of what no sample changes, around the estimator's settings."""
    return record(interval=COUNT, freezable=FLAG, hysteretic=FLAG, estimator=estimator)


def learn(state: Any, settings: Any, estimator: Any, compensator: Any, x: Any) -> None:
    """Give the estimator the measurement of the previous voltage; hand its model over when it is time."""
    ring = state.ring
    if settings.freezable != 0.0:
        state.estimator.frozen = ring.frozen
    elif ring.frozen != 0.0:
        x = np.nan
    estimator.sample(state.estimator, settings.estimator, ring.voltage, x)
    ring.waited += 1.0
    if ring.waited >= settings.interval:
        ring.waited = 0.0
        if ring.frozen == 0.0 and state.compensator.corridor.due != 0.0:
            model = local(4)
            for i in range(4):
                model[i] = 0.0
            estimator.proposed(state.estimator, settings.estimator, model)
            adopt(state, settings, compensator, model)


def adopt(state: Any, settings: Any, compensator: Any, model: Any) -> bool:
    """Hand a model to the compensator; False if it has no inverse. `model` becomes the one in use."""
    if not compensator.set_model(state.compensator, state.settings, model, settings.hysteretic != 0.0):
        return False
    for i in range(4):
        state.ring.model[i] = model[i]
    return True


def give(state: Any, compensator: Any, r: Any) -> Any:
    """Voltage for the next sample of the reference; a number, whatever came in."""
    u = compensator.voltage(state.compensator, state.settings, r)
    if abs(u) < WILDEST:
        state.ring.voltage = u
        state.ring.started = 1.0
    return state.ring.voltage


def check_limits(estimator: Any, compensator: Compensator) -> None:
    """Refuse limits for another sample rate than the estimator's."""
    rate = getattr(estimator, "sample_rate", None)
    if rate is not None:
        check_rate(compensator, rate, "the compensator is")


class Ring:
    """What the two controllers share: a log of turns, and whether the model is held."""

    __slots__ = ("_frozen",)

    #: `piezoest.track` hands each measurement back: it can run a controller as its compensator.
    needs_measurement = True

    @property
    def frozen(self) -> bool:
        """Whether the model is held; settable."""
        return self._frozen

    @frozen.setter
    def frozen(self, frozen: bool) -> None:
        self._frozen = bool(frozen)
        self._hold()

    def _hold(self) -> None:
        """Hold the model, or learn on."""
        raise NotImplementedError

    def _run(self, r: FloatArray, x: FloatArray) -> FloatArray:
        raise NotImplementedError

    def run(self, r: Any, x: Any) -> FloatArray:
        """Turns for a whole log.

        Parameters
        ----------
        r, x : array_like, shape (N,)
            Reference, and the displacement measured before each sample of it [µm]; NaN where there is none.

        Returns
        -------
        ndarray, shape (N,)
            Voltage [V].

        Raises
        ------
        ValueError
            If the arrays are not one-dimensional, or of two lengths.
        """
        r, x = array_1d("r", r, allow_nan=True), array_1d("x", x, allow_nan=True)
        if r.size != x.size:
            raise ValueError(f"r and x must have the same length, got {r.size} and {x.size}")
        return self._run(r, x)


class Controller(Ring):
    """What the exported code does, in Python: one `step` from reference and measurement to voltage.

    Parameters
    ----------
    estimator : object with ``step(u, x)`` and ``model``, or None
        Such as `HysteresisRLS`; None leaves the compensator's model as it is.
    compensator : LinearCompensator or InverseCompensator
        The feed-forward.
    update_interval : int
        Samples between two changes of the compensator's model (default 50: 1 ms at 50 kHz).

    Raises
    ------
    ValueError
        If the compensator is none, its limits are for another sample rate than the estimator's, or the
        interval is no whole number above zero.

    Notes
    -----
    A loop of ``x = stage.step(u); u = controller.step(r, x)`` is `piezoest.track`, bit for bit.

    Examples
    --------
    >>> import piezoest as pz
    >>> model = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    >>> controller = pz.export.Controller(pz.HysteresisRLS(1000.0), pz.InverseCompensator(model))
    >>> u = controller.step(0.1, 0.0)  # reference and reading [µm], voltage [V]
    """

    __slots__ = ("_compensator", "_estimator", "_interval", "_voltage", "_waited")

    def __init__(self, estimator: Any, compensator: Compensator, *, update_interval: int = 50) -> None:
        self._estimator = estimator
        expected = "a LinearCompensator or an InverseCompensator"
        self._compensator: Compensator = instance("compensator", compensator, Compensator, expected)
        check_limits(estimator, compensator)
        self._interval = integer("update_interval", update_interval, 1)
        self._voltage: float | None = None
        self._waited = 0
        self._frozen = False

    @property
    def model(self) -> Model:
        """Model whose inverse is used."""
        return self._compensator.model

    def _hold(self) -> None:
        if hasattr(self._estimator, "frozen"):
            self._estimator.frozen = self._frozen

    def step(self, r: float | None, x: float | None) -> float:
        """One turn.

        Parameters
        ----------
        r : float
            Next sample of the reference [µm]; NaN or infinity holds the voltage.
        x : float or None
            Displacement measured after the previous voltage [µm]; None, NaN or infinity where
            there is none. At the first turn there was no voltage yet, and x is not looked at.

        Returns
        -------
        float
            Voltage [V], within the compensator's limits.
        """
        if self._voltage is not None and self._estimator is not None:
            held = self._frozen and not hasattr(self._estimator, "frozen")
            self._estimator.step(self._voltage, np.nan if held else x)
            self._waited += 1
            if self._waited == self._interval:
                self._waited = 0
                if not self._frozen and self._compensator.hand_over_due:
                    self._compensator.model = self._estimator.model
        self._voltage = self._compensator.step(r)
        return self._voltage

    def _run(self, r: FloatArray, x: FloatArray) -> FloatArray:
        return np.array([self.step(a, b) for a, b in zip(r.tolist(), x.tolist(), strict=True)])
