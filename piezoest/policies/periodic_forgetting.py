"""Exponential forgetting, in periods of the reference."""

from dataclasses import dataclass
from typing import Any

from piezoest.compile import inlined
from piezoest.equations.swing import half_period
from piezoest.policies.base import Policy
from piezoest.policies.forgetting import check_memory


@dataclass(frozen=True, slots=True)
class PeriodicForgetting(Policy):
    """Exponential forgetting with a memory in periods of the reference.

    For a linear gain. With a memory below one period the gain would follow the shape of the loop.

    Parameters
    ----------
    memory : float
        Time constant in periods.

    Raises
    ------
    ValueError
        If memory is less than 0.001.

    Notes
    -----
    Source: the forgetting of (A4), by the reference's periods.
    """

    forgets = needs_swings = needs_period = True

    memory: float = 2.0

    def __post_init__(self) -> None:
        check_memory(self.memory)


@inlined
def weight(state: Any, settings: Any, periods: Any) -> Any:
    """Weight that the past keeps over a sample, for a memory in periods."""
    samples = 2.0 * half_period(state.swing, settings.first_half_period) * periods
    return samples / (samples + 1.0)


@inlined
def prepare(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Forget by the period at hand."""
    state.law.forgetting = weight(state, settings, fixed.memory)
