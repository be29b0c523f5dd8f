"""No update when the regressor contains no information."""

from dataclasses import dataclass
from typing import Any

from piezoest._checks import non_negative
from piezoest.compile import inlined
from piezoest.policies.base import Policy


@dataclass(frozen=True, slots=True)
class DeadZone(Policy):
    """No update of estimate and covariance when the regressor contains no information.

    Without it, forgetting increases P during a rest although no data arrive (wind-up).

    Parameters
    ----------
    threshold : float
        Smallest phi' P0 phi, in units of the noise variance, that counts as information.

    Raises
    ------
    ValueError
        If threshold is negative.

    Notes
    -----
    Source: P. A. Ioannou, J. Sun, Robust Adaptive Control, Prentice Hall 1996, ch. 8.
    """

    threshold: float = 1e-9

    def __post_init__(self) -> None:
        non_negative("threshold", self.threshold)


@inlined
def permits(own: Any, fixed: Any, state: Any, settings: Any) -> Any:
    """Whether the regressor is outside the dead zone."""
    phi, P_0 = state.phi, settings.law.P_0
    information = 0.0
    for i in range(len(phi)):
        information += phi[i] * phi[i] * P_0[i, i]
    return information > fixed.threshold * settings.law.noise
