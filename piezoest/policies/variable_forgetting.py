"""A memory that becomes shorter when the model no longer fits."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import fraction, positive
from piezoest.compile import inlined
from piezoest.equations import innovation_energy, least_squares
from piezoest.policies.base import Conditions, Policy
from piezoest.policies.directional_forgetting import InUnits, forget_by_period
from piezoest.policies.forgetting import LEAST_WEIGHT, Unit, check_memory
from piezoest.policies.periodic_forgetting import weight


@dataclass(frozen=True, slots=True)
class VariableForgetting(InUnits, Policy):
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

    def least_factor(self, step: float) -> float:
        """Least weight that the past keeps over one step: exp(-step/(shortest memory)), at least 0.001.

        Parameters
        ----------
        step : float
            Time between samples, in the unit of `memory`.
        """
        return max(float(np.exp(-step / (self.shortest * self.memory))), LEAST_WEIGHT)

    def numbers(self, at: Conditions) -> dict[str, float]:
        """Memories in periods, usual and shortest, zero where they are in time; and the least factor then."""
        periods = self.memory if self.unit == "period" else 0.0
        return {"periods": periods, "shortest": self.shortest, "least": self.least_factor(at.step)}


@inlined
def _least(swing: Any, fixed: Any, state: Any, settings: Any) -> Any:
    """Least weight of the past over a sample."""
    if swing is None:
        return fixed.least
    if fixed.periods > 0.0:
        return weight(state, settings, fixed.periods * fixed.shortest)
    return fixed.least


@inlined
def _nominal(energy: Any, forgetting: Any) -> Any:
    """Factor that gives the memory wanted at the innovation's usual energy, where that is followed."""
    if energy is None:
        return forgetting
    return innovation_energy.nominal(energy, forgetting)


@inlined
def prepare(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Forget by the period at hand, and sooner by the innovation's energy."""
    if fixed is None:
        return
    forget_by_period(state.swing, fixed.periods, state, settings)
    law = state.law
    forgetting = _nominal(state.energy, law.forgetting)
    y = law.z - least_squares.predicted_output(law.theta, state.phi)
    quadratic = least_squares.covariance_times(law.P, state.phi, law.product)
    least = _least(state.swing, fixed, state, settings)
    law.forgetting = least_squares.variable_forgetting(y, quadratic, law.noise, forgetting, least)
