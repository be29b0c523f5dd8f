"""Adapt again when the innovation shows a change."""

from dataclasses import dataclass
from typing import Any

from piezoest._checks import moderate
from piezoest.compile import inlined
from piezoest.equations import innovation_energy, least_squares
from piezoest.layout import AMOUNT, Field, record
from piezoest.policies.base import Policy


@dataclass(frozen=True, slots=True)
class ChangeDetection(Policy):
    """Add the initial covariance to P when the innovation shows a change.

    A cumulative sum over the travel of the voltage: of the innovation's energy relative to its usual
    one, less 1 + drift. As long as nothing changes it gains nothing over a swing, whatever the loop
    does within it; after a detection the usual energy is learnt again over two swings.

    E. Page, Biometrika 41 (1954) 100-115; F. Gustafsson, Adaptive Filtering and Change Detection
    (2000), sec. 2.6 and 5.1.

    Parameters
    ----------
    threshold : float
        Of the sum, in swings of the usual energy.
    drift : float
        Rise of the energy that is no change, relative to the usual one.

    Raises
    ------
    ValueError
        If threshold is not above zero, or drift negative.
    """

    needs_swings = needs_discrete = True
    follows = frozenset({"energy"})

    threshold: float = 2.0
    drift: float = 1.0

    def __post_init__(self) -> None:
        moderate("threshold", self.threshold)
        moderate("drift", self.drift, or_zero=True)

    def keeps(self, n: int) -> Field:
        """Cumulative sum of what is unusual."""
        return record(sum=AMOUNT)


@inlined
def after_update(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Add P_0 to P where the sum of what is unusual passes the threshold; what is usual is learnt again."""
    law, energy = state.law, state.energy
    if energy.swings < innovation_energy.ENOUGH:
        return
    unusual = innovation_energy.relative(energy, law.innovation, law.innovation_variance)
    fraction = state.fraction
    own.sum = least_squares.cusum(own.sum, unusual * fraction, (1.0 + fixed.drift) * fraction)
    if own.sum > fixed.threshold:
        own.sum = 0.0
        innovation_energy.forget(energy)
        least_squares.add_covariance(law.P, settings.law.P_0)
        law.resets += 1.0
