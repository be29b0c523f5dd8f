"""Forgetting along the present regressor alone."""

from dataclasses import dataclass
from typing import Any

from piezoest.compile import inlined
from piezoest.policies.base import Conditions, Policy
from piezoest.policies.forgetting import Forgetting, Unit, check_memory
from piezoest.policies.periodic_forgetting import weight


class InUnits:
    """What policies share whose `memory` is in periods or in seconds, as their `unit` says."""

    __slots__ = ()

    memory: float
    unit: Unit

    @property
    def counts_periods(self) -> bool:
        """Whether its memory is counted in periods of the reference."""
        return self.unit == "period"

    def check(self, at: Conditions) -> None:
        """Refuse a memory in periods where nobody follows the swings of a voltage."""
        super().check(at)  # type: ignore[misc]
        if self.counts_periods and not at.has_swings:
            raise ValueError(f"policies: {self!r} needs the swings of a voltage: see HysteresisRLS")

    def law(self, at: Conditions) -> dict[str, float]:
        """Factor over a step of the law; none for a memory in periods, which is set sample by sample."""
        return {} if self.counts_periods else Forgetting(self.memory).law(at)


@dataclass(frozen=True, slots=True)
class DirectionalForgetting(InUnits, Policy):
    """Forget only along the present regressor; directions without new data are kept.

    R. Kulhavy, Automatica 23 (1987) 589-600; L. Cao, H. Schwartz, Automatica 36 (2000) 1725-1731.
    See `piezoest.equations.least_squares.directional_update`.

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
        return {"periods": self.memory if self.unit == "period" else 0.0}


@inlined
def forget_by_period(swing: Any, periods: Any, state: Any, settings: Any) -> None:
    """Forget by the period at hand, where a memory is counted in periods and there are swings."""
    if swing is None:
        return
    if periods > 0.0:
        state.law.forgetting = weight(state, settings, periods)


@inlined
def prepare(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Forget by the period at hand; the law takes the directional update where this policy is on."""
    if fixed is None:
        return
    forget_by_period(state.swing, fixed.periods, state, settings)
