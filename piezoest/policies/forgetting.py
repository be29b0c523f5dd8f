"""Exponential forgetting, in time."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from piezoest._checks import moderate, positive
from piezoest.policies.base import Conditions, Policy

Unit = Literal["period", "second"]

# Least memory in periods, and least weight that the past keeps over a sample, by which P is divided: nothing
# would be left below it.
SHORTEST, LEAST_WEIGHT = 1e-3, 1e-3


def check_memory(memory: float, unit: str = "period") -> None:
    """Refuse a memory that is none."""
    if moderate("memory", memory) < SHORTEST and unit == "period":
        raise ValueError(f"memory must be at least {SHORTEST:g} periods, got {memory:g}")
    if unit not in ("period", "second"):
        raise ValueError(f"unit must be 'period' or 'second', got {unit!r}")


def weight_over(step: float, memory: float) -> float:
    """Weight that the past keeps over a step: exp(-step/memory), at least 0.001."""
    return max(float(np.exp(-step / memory)), LEAST_WEIGHT)


@dataclass(frozen=True, slots=True)
class Forgetting(Policy):
    """Exponential forgetting: data of age t weigh exp(-t / memory) (A4).

    Parameters
    ----------
    memory : float
        Time constant in the estimator's unit of time (lambda = 1/memory); infinite: none.

    Raises
    ------
    ValueError
        If memory is not above zero.
    """

    forgets = True

    memory: float = np.inf

    def __post_init__(self) -> None:
        if self.memory != np.inf:
            positive("memory", self.memory)

    def law(self, at: Conditions) -> dict[str, float]:
        """Factor over a step, and rate, of the law."""
        return {"forgetting": weight_over(at.step, self.memory), "rate": 1.0 / self.memory}


class InUnits:
    """What policies share whose `memory` is in periods or in seconds, as their `unit` says."""

    __slots__ = ()

    memory: float
    unit: Unit

    @property
    def needs_swings(self) -> bool:
        """Whether its memory is counted in periods of the reference."""
        return self.unit == "period"

    @property
    def periods(self) -> float:
        """Memory in periods; zero where it is one in time."""
        return self.memory if self.needs_swings else 0.0

    def law(self, at: Conditions) -> dict[str, float]:
        """Factor over a step of the law; none for a memory in periods, which is set sample by sample."""
        return {} if self.needs_swings else Forgetting(self.memory).law(at)
