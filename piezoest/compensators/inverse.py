"""Feed-forward through the inverse of the hysteresis, (14)-(17) and App. C."""

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
        How w_h is computed: with the closed form (C7), (C10), which is exact if the reference is monotone
        between samples, or by integrating (17) with the paper's Runge-Kutta method.
    transfer_samples : int
        When the model changes, the voltage changes gradually, with this time constant in samples (default
        500); 0 for a jump.
    sample_rate : float, optional
        [Hz]. Only a model with creep needs it; default that of the limits, or the model's own.
    hand_over : {"path", "place"}
        w_h after a change to another Coleman-Hodgdon model: the value that follows from the recent path of
        the voltage, or the same fraction of its limit b/a as before.

    Raises
    ------
    ValueError
        If the model is of another kind or not admissible, the limits are no `VoltageLimits`, the
        method is unknown, or a model with creep comes without a sample rate.

    Notes
    -----
    The state follows the limited voltage, so there is no wind-up at the limits. It starts at 0 V, or the
    limit nearest to it, and w_h = 0, the equilibrium of the paper. The inverse of a `PrandtlIshlinskii` is
    exact in each sample; `method` does not apply to it.

    Sources: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012); Krejci and
    Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185-192.

    Examples
    --------
    >>> import piezoest as pz
    >>> model = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
    >>> compensator = pz.InverseCompensator(model, pz.VoltageLimits(minimum=-50.0, maximum=100.0))
    >>> u = compensator.step(1.0)  # µm to V
    >>> round(u, 3)
    6.631
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
