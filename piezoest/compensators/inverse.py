"""Feed-forward through the inverse of the hysteresis, (14)-(17) and App. C."""

from __future__ import annotations

from piezoest.compensators.base import Compensator, HandOver, Method
from piezoest.compensators.limits import VoltageLimits
from piezoest.models import Model


class InverseCompensator(Compensator):
    """Feed-forward through the inverse of a hysteresis model (14).

    Parameters
    ----------
    model : ColemanHodgdon, PrandtlIshlinskii or LinearGain
        Model to invert; must be admissible. A `LinearGain` is the case without hysteresis.
    limits : VoltageLimits, optional
        Limits of the voltage (default none).
    method : {"closed-form", "bogacki-shampine"}
        How w_h is found: by the closed form (C7), (C10), exact for monotone reference
        between samples, or by integrating (17) with the paper's Runge-Kutta method.
    transfer_samples : int
        Time constant of a bumpless change of model, in samples (default 500); 0 for none.
    sample_rate : float, optional
        [Hz]. Only a model with creep needs it; default that of the limits, or the model's own.
    hand_over : {"path", "place"}
        Where w_h stands when another Coleman-Hodgdon model is taken up: where the recent path of the
        voltage would have brought it, or at the same part of its limit b/a as before.

    Raises
    ------
    ValueError
        If the model is of another kind or not admissible, the limits are no `VoltageLimits`, the
        method is unknown, or a model with creep comes without a sample rate.

    Notes
    -----
    The state follows the voltage that was really given out, so that limits do not wind it
    up. Start: 0 V and w_h = 0, the equilibrium of the paper.
    The inverse of a `PrandtlIshlinskii` is exact for each sample: one walk over its thresholds,
    creep being known from the past. `method` does not apply to it.

    Sources: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012); Krejci and
    Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185-192.
    """

    __slots__ = ()

    def __init__(
        self,
        model: Model,
        limits: VoltageLimits | None = None,
        *,
        method: Method = "closed-form",
        transfer_samples: int = 500,
        sample_rate: float | None = None,
        hand_over: HandOver = "path",
    ) -> None:
        super().__init__(model, limits, method, transfer_samples, sample_rate, hand_over)
