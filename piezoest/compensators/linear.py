"""Linear feed-forward, u = r/K (11)."""

from piezoest._checks import instance
from piezoest.compensators.base import Compensator
from piezoest.compensators.limits import VoltageLimits
from piezoest.models import LinearGain, Model


class LinearCompensator(Compensator):
    """Linear feed-forward: u = (r - offset)/K (11).

    Parameters
    ----------
    model : LinearGain
        Gain K [µm/V] and offset [µm].
    limits : VoltageLimits, optional
        Limits of the voltage (default none).
    transfer_samples : int
        When the model changes, the voltage changes gradually, with this time constant in samples (default
        500); 0 for a jump.

    Raises
    ------
    ValueError
        If the model is of another kind, its gain is zero, or the limits are no `VoltageLimits`.

    Examples
    --------
    >>> import piezoest as pz
    >>> compensator = pz.LinearCompensator(pz.LinearGain(0.15))
    >>> compensator.step(1.5)  # µm to V
    10.0
    """

    __slots__ = ()

    def __init__(
        self, model: LinearGain, limits: VoltageLimits | None = None, *, transfer_samples: int = 500
    ) -> None:
        super().__init__(model, limits, "closed-form", transfer_samples)

    def _accepts(self, model: Model) -> Model:
        hint = "a LinearGain: use InverseCompensator for a model with hysteresis"
        instance("model", model, LinearGain, hint)
        return model
