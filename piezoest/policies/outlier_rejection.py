"""Impossible readings are ignored."""

from dataclasses import dataclass

from piezoest._checks import integer
from piezoest.policies.base import Policy


@dataclass(frozen=True, slots=True)
class OutlierRejection(Policy):
    """Ignore impossible readings: spikes, jumps, and readings that stand still.

    Parameters
    ----------
    warm_up : int
        Number of samples from which the usual change between two samples is measured.

    Raises
    ------
    ValueError
        If warm_up is not a whole number above zero.

    Notes
    -----
    A change of x is accepted up to 20 times the usual change plus three times the change that the present
    slope explains. If x stays at a new level, the level is accepted after 2 ms; what is usual stays known.
    A reading that is exactly constant while the voltage travels more than 0.5 % of a swing is that of a
    converter at the end of its range or of a dead sensor.
    Source: rules of this library.
    """

    needs_swings = needs_loop = True
    follows = frozenset({"belief"})

    warm_up: int = 100

    def __post_init__(self) -> None:
        integer("warm_up", self.warm_up, 1)
