"""A memory that becomes shorter when the model no longer fits."""

from dataclasses import dataclass
from typing import Any

from piezoest._checks import fraction, positive
from piezoest.compile import inlined
from piezoest.equations import innovation_energy, least_squares
from piezoest.policies.base import Conditions, Policy
from piezoest.policies.forgetting import InUnits, Unit, check_memory, weight_over
from piezoest.policies.periodic_forgetting import weight


@dataclass(frozen=True, slots=True)
class VariableForgetting(InUnits, Policy):  # type: ignore[override]
    """Exponential forgetting with a memory that becomes shorter as the innovation's energy rises.

    T. Fortescue, L. Kershenbaum, B. Ydstie, Automatica 17 (1981) 831-835. See
    `piezoest.equations.least_squares.variable_forgetting`. `HysteresisRLS` uses the innovation's
    usual variance over the memory in the place of the noise, because much of it is error of the model.

    Parameters
    ----------
    memory : float
        Time constant while the innovation is as usual, in units of `unit`.
    shortest : float
        Shortest time constant, relative to memory.
    unit : {"period", "second"}
        Of memory: the reference's own period, or seconds (the unit of `step` in `RecursiveLeastSquares`).

    Raises
    ------
    ValueError
        If memory is not above zero or less than 0.001 periods, shortest not within (0, 1], or the
        unit is another.
    """

    forgets = needs_discrete = True
    follows = frozenset({"energy"})

    memory: float = 1.0
    shortest: float = 0.1
    unit: Unit = "period"

    def __post_init__(self) -> None:
        check_memory(self.memory, self.unit)
        positive("shortest", fraction("shortest", self.shortest))

    def numbers(self, at: Conditions) -> dict[str, float]:
        """Memories in periods, usual and shortest, zero where they are in time; and the least factor then."""
        least = weight_over(at.step, self.shortest * self.memory)
        return {"periods": self.periods, "shortest": self.shortest, "least": least}


@inlined
def prepare(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Forget by the period at hand, and sooner by the innovation's energy."""
    law, least = state.law, fixed.least
    if state.swing is not None and fixed.periods > 0.0:
        law.forgetting = weight(state, settings, fixed.periods)
        least = weight(state, settings, fixed.periods * fixed.shortest)
    forgetting = law.forgetting
    if state.energy is not None:
        forgetting = innovation_energy.nominal(state.energy, forgetting)
    y = law.z - least_squares.predicted_output(law.theta, state.phi)
    quadratic = least_squares.covariance_times(law.P, state.phi, law.product)
    law.forgetting = least_squares.variable_forgetting(y, quadratic, law.noise, forgetting, least)
