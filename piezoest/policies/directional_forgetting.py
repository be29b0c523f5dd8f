"""Forgetting along the present regressor alone."""

from dataclasses import dataclass
from typing import Any

from piezoest.compile import inlined
from piezoest.policies.base import Conditions, Policy
from piezoest.policies.forgetting import InUnits, Unit, check_memory
from piezoest.policies.periodic_forgetting import weight


@dataclass(frozen=True, slots=True)
class DirectionalForgetting(InUnits, Policy):  # type: ignore[override]
    """Forget only along the present regressor; directions without new data are kept.

    R. Kulhavy, Automatica 23 (1987) 589-600; L. Cao, H. Schwartz, Automatica 36 (2000) 1725-1731.
    See `piezoest.equations.least_squares.directional_correction`.

    Parameters
    ----------
    memory : float
        Time constant along the regressor, in units of `unit`.
    unit : {"period", "second"}
        Of memory: the reference's own period, or seconds (the unit of `step` in `RecursiveLeastSquares`).

    Raises
    ------
    ValueError
        If memory is not above zero or less than 0.001 periods, or the unit is another.
    """

    forgets = needs_discrete = True

    memory: float = 1.0
    unit: Unit = "period"

    def __post_init__(self) -> None:
        check_memory(self.memory, self.unit)

    def numbers(self, at: Conditions) -> dict[str, float]:
        """Memory in periods; zero where it is one in time."""
        return {"periods": self.periods}


@inlined
def prepare(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Forget by the period at hand; the law takes the directional update where this policy is on."""
    if state.swing is not None and fixed.periods > 0.0:
        state.law.forgetting = weight(state, settings, fixed.periods)
