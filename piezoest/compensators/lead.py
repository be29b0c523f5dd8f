"""A lead for mechanics and delay, before a feed-forward."""

from typing import Any

import numpy as np

from piezoest._checks import WILDEST, FloatArray, array_1d, finite, instance, number_or_nan, positive
from piezoest.compensators.base import AroundCompensator, Compensator
from piezoest.compile import Record, Vector, compiled, inlined
from piezoest.equations.lead import SETTINGS, STATE, lead_coefficients, lead_step
from piezoest.layout import new
from piezoest.models import MassSpringDamper


@inlined
def _lead(state: Any, settings: Any, r: Any) -> Any:
    """Reference to hand on; a missing sample is handed on, and the next one starts from rest."""
    if not np.abs(r) < WILDEST:
        state.started = 0.0
        return np.nan
    if state.started == 0.0:
        state.started = 1.0
        state.r = r
        state.first = state.second = 0.0
    return lead_step(state, r, settings)


@compiled
def _step(state: Record, settings: Record, r: float) -> Any:
    return _lead(state, settings, r)


@compiled
def _run(state: Record, settings: Record, r: Vector) -> None:
    for k in range(len(r)):
        r[k] = _lead(state, settings, r[k])


class LeadFilter(AroundCompensator):
    """A second-order lead filter before a feed-forward, for references that are close to the resonance.

    The compensator gets r + c1 r' + c2 r''. The stage's mechanics and delay turn this into r again. Use it
    for references with frequencies above a twentieth of the resonance, or with sharp corners.

    Parameters
    ----------
    compensator : LinearCompensator or InverseCompensator
        The feed-forward.
    mechanics : MassSpringDamper
        Resonance of the stage.
    sample_rate : float
        [Hz].
    delay : float
        Delay from the voltage to the force on the stage [s], such as that of an amplifier's filter. Half a
        sample is subtracted automatically, because a reading is taken at the end of its sample. The delay of
        the sensor is not part of it.
    smoothing : float, optional
        Time constant of the differences [s]; default 1/omega of the mechanics. Higher frequencies are
        amplified by 1 + c1/smoothing + c2/smoothing², which is about two by default.

    Raises
    ------
    ValueError
        If the compensator is none, the mechanics no `MassSpringDamper`, or a number out of range.

    Notes
    -----
    The filter is stable for all settings: its pole lies within the unit circle. The voltage stays within the
    compensator's limits. An estimator in the same loop must know the same lag. Otherwise it learns the lag as
    hysteresis, and the lag is compensated twice: see `mechanics` and `delay` of `PrandtlIshlinskiiRLS`.
    Equations: `piezoest.equations.lead`.

    Examples
    --------
    >>> import piezoest as pz
    >>> mechanics = pz.MassSpringDamper(natural_frequency=780.0, damping_ratio=0.02)
    >>> compensator = pz.LinearCompensator(pz.LinearGain(0.15))
    >>> lead = pz.LeadFilter(compensator, mechanics=mechanics, sample_rate=10_000.0)
    >>> u = lead.step(0.0)
    """

    __slots__ = ("_settings", "_state")

    def __init__(
        self,
        compensator: Compensator,
        mechanics: MassSpringDamper,
        *,
        sample_rate: float,
        delay: float = 0.0,
        smoothing: float | None = None,
    ) -> None:
        super().__init__(compensator, sample_rate)
        instance("mechanics", mechanics, MassSpringDamper, "a MassSpringDamper")
        omega = 2.0 * np.pi * mechanics.natural_frequency
        coefficients = lead_coefficients(
            mechanics.natural_frequency,
            mechanics.damping_ratio,
            self._lag(delay, mechanics),
            1.0 / omega if smoothing is None else positive("smoothing", smoothing),
            1.0 / self._sample_rate,
        )
        self._settings = new(SETTINGS, **coefficients)
        self._begin()

    @staticmethod
    def _lag(delay: float, mechanics: MassSpringDamper) -> float:
        """Return a delay [s] that a lead can undo."""
        longest = 1.0 / mechanics.natural_frequency
        if not 0.0 <= finite("delay", delay) <= longest:
            raise ValueError(
                "delay is in seconds, and must lie between zero and a period of the resonance, "
                f"{longest:.3g} s, got {delay:g}"
            )
        return delay

    def _begin(self) -> None:
        self._state = new(STATE)

    def step(self, r: float | None) -> float:
        """Voltage [V] for the next sample of the reference, within the limits.

        Parameters
        ----------
        r : float
            As in `InverseCompensator.step`.
        """
        step = _step.of(STATE, SETTINGS)
        lead = step(self._state, self._settings, r if type(r) is float else number_or_nan(r))
        return self._compensator.step(lead)

    def run(self, r: Any) -> FloatArray:
        """Voltages [V], shape (N,), for a whole reference: the same as a loop of `step` from here on.

        Parameters
        ----------
        r : array_like, shape (N,)
            As in `InverseCompensator.run`.
        """
        lead = array_1d("r", r, allow_nan=True, sample_rate=self._sample_rate).copy()
        _run.of(STATE, SETTINGS)(self._state, self._settings, lead)
        return self._compensator.run(lead)
