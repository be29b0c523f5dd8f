"""What was learnt before, taken up again."""

from __future__ import annotations

from dataclasses import dataclass

from piezoest._checks import fraction, integer, moderate, positive


@dataclass(frozen=True, slots=True)
class AmplitudeMemory:
    """Remember what was learnt at each swing of the voltage, and start from there on return.

    The last paragraph of sec. IV of Eielsen et al. (2012): parameters scheduled by amplitude. At the end
    of a swing like those before it the mean estimate over the swing is stored with its size; when
    the size changes and it, or one on either side of it, is known, theta goes to what was stored,
    interpolated. See `HysteresisRLS.profile` and `AmplitudeProfile`.

    Parameters
    ----------
    places : int
        Amplitudes that are remembered, up to 1000; a further one replaces the nearest.
    tolerance : float
        Sizes that differ by less, in parts, are the same amplitude.
    uncertainty : float
        Standard deviation of what was stored when it is taken up, in parts of the initial model.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    places: int = 8
    tolerance: float = 0.1
    uncertainty: float = 0.05

    def __post_init__(self) -> None:
        integer("places", self.places, 1, 1000)
        positive("tolerance", fraction("tolerance", self.tolerance, 0.0, 0.5))
        moderate("uncertainty", self.uncertainty)
