"""Readings that the stage cannot have made are left out."""

from __future__ import annotations

from dataclasses import dataclass

from piezoest._checks import integer
from piezoest.policies.base import Policy


@dataclass(frozen=True, slots=True)
class OutlierRejection(Policy):
    """Leave out readings that the stage cannot have made: spikes, jumps, and those that stand still.

    Parameters
    ----------
    warm_up : int
        Samples from which the usual change between two samples is taken.

    Raises
    ------
    ValueError
        If warm_up is not a whole number above zero.

    Notes
    -----
    A change is believed up to 20 times the usual one plus three times what the present slope
    explains. Where x stays at its new level, it is taken for the new one after 2 ms. A reading
    that is the same to the last bit while the voltage travels more than 0.5 % of a swing is that of a
    saturated converter or a dead sensor.
    Source: rules of this library.
    """

    needs_swings = needs_loop = True
    follows = frozenset({"belief"})

    warm_up: int = 100

    def __post_init__(self) -> None:
        integer("warm_up", self.warm_up, 1)
