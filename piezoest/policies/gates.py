"""Which samples count: none at rest, none that the stage cannot have made, none that says nothing."""

from __future__ import annotations

from dataclasses import dataclass

from piezoest._checks import finite, integer, non_negative


@dataclass(frozen=True, slots=True)
class OutlierRejection:
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

    warm_up: int = 100

    def __post_init__(self) -> None:
        integer("warm_up", self.warm_up, 1)


@dataclass(frozen=True, slots=True)
class DeadZone:
    """Leave the estimate and its covariance alone where the regressor says nothing.

    Without it a dwell lets forgetting grow P on no information (wind-up).

    Parameters
    ----------
    threshold : float
        Least phi' P0 phi, in units of the noise variance, that counts as information.

    Raises
    ------
    ValueError
        If threshold is negative.

    Notes
    -----
    Source: P. A. Ioannou, J. Sun, Robust Adaptive Control, Prentice Hall 1996, ch. 8.
    """

    threshold: float = 1e-9

    def __post_init__(self) -> None:
        non_negative("threshold", self.threshold)


@dataclass(frozen=True, slots=True)
class ExcitationGate:
    """Adapt only while every direction is excited: `HysteresisRLS.excitation` above a level.

    The condition (A8) of Eielsen et al. (2012) for convergence, over the last swing; Ioannou and Sun,
    Robust Adaptive Control (1996), sec. 4.3. Looked at once in 64 samples. While it is shut samples
    count as held, and P does not grow.

    Parameters
    ----------
    least : float
        Least excitation, of 0 to 1.

    Raises
    ------
    ValueError
        If least is not within (0, 1).
    """

    least: float = 1e-4

    def __post_init__(self) -> None:
        if not 0.0 < finite("least", self.least) < 1.0:
            raise ValueError(f"least must lie within (0, 1), got {self.least}")
