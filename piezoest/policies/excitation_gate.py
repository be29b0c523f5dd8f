"""No update while a direction of the parameters is not excited."""

from dataclasses import dataclass
from typing import Any

from piezoest._checks import finite
from piezoest.compile import inlined, like
from piezoest.equations import least_squares
from piezoest.layout import FLAG, Field, record, whole
from piezoest.policies.base import Policy

# Samples between two looks at the excitation.
EVERY = 64.0


@dataclass(frozen=True, slots=True)
class ExcitationGate(Policy):
    """Adapt only while all directions are excited: `HysteresisRLS.excitation` above a level.

    The condition (A8) of Eielsen et al. (2012) for convergence, over the last swing; Ioannou and Sun,
    Robust Adaptive Control (1996), sec. 4.3. Checked every 64 samples. While it is closed, samples
    count as held, and P does not grow.

    Parameters
    ----------
    least : float
        Smallest excitation, 0 to 1.

    Raises
    ------
    ValueError
        If least is not within (0, 1).
    """

    needs_swings = needs_discrete = True
    follows = frozenset({"products"})

    least: float = 1e-4

    def __post_init__(self) -> None:
        if not 0.0 < finite("least", self.least) < 1.0:
            raise ValueError(f"least must lie within (0, 1), got {self.least}")

    def keeps(self, n: int) -> Field:
        """Whether the gate is shut, and samples until it is looked at again."""
        return record(shut=FLAG, wait=whole(0.0, EVERY))


@inlined
def permits(own: Any, fixed: Any, state: Any, settings: Any) -> Any:
    """Whether the least eigenvalue of the regressor's mean square is `least` of its mean one."""
    own.wait -= 1.0
    if own.wait <= 0.0:
        own.wait = EVERY
        mean = state.excitation.products
        size = least_squares.trace(mean) / len(mean)
        root = like(mean)
        own.shut = 1.0 - least_squares.above_floor(mean, fixed.least * size, root)
    return own.shut == 0.0
