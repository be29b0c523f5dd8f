"""What else happens to the covariance P, and to the estimate itself."""

from __future__ import annotations

from dataclasses import dataclass

from piezoest._checks import finite, fraction, moderate, positive


@dataclass(frozen=True, slots=True)
class NormBound:
    """Bound R0 on the trace of the covariance (A6): P is not updated where that would pass it.

    To the letter (A6) freezes P for as long as ||P|| > R0, which is for good once it
    happened; here only an update that would pass the bound is left out.

    Parameters
    ----------
    limit : float
        R0, as a multiple of the trace of the initial covariance.

    Raises
    ------
    ValueError
        If limit is below 1: the initial covariance itself must satisfy the bound.
    """

    limit: float = 100.0

    def __post_init__(self) -> None:
        if finite("limit", self.limit) < 1.0:
            raise ValueError(
                f"limit must be at least 1, got {self.limit}: the initial covariance must satisfy the bound"
            )


@dataclass(frozen=True, slots=True)
class Normalisation:
    """Normalisation m² = 1 + phi' P phi of the continuous law (A7); without it m² = 1.

    The discrete law has it by construction: its gain P phi/(R + phi' P phi) is the
    normalised one.
    """


@dataclass(frozen=True, slots=True)
class CovarianceResetting:
    """Put P back to its start when it became too small to adapt: lambda_min(P) <= floor.

    Ioannou and Sun, Robust Adaptive Control, sec. 4.3.6.

    Parameters
    ----------
    floor : float
        rho_1, as a multiple of the smallest eigenvalue of the initial covariance.

    Raises
    ------
    ValueError
        If floor is not within [0, 1).
    """

    floor: float

    def __post_init__(self) -> None:
        if fraction("floor", self.floor) == 1.0:
            raise ValueError("floor must be below 1: at 1 the initial covariance itself would be reset")


@dataclass(frozen=True, slots=True)
class ChangeDetection:
    """Add the initial covariance to P when the innovation says that something changed.

    A cumulative sum over the travel of the voltage: of the innovation's energy in parts of its usual
    one, less 1 + drift. As long as nothing changes it gains nothing over a swing, whatever the loop
    does within it; after a detection the usual energy is learnt anew over two swings.

    E. Page, Biometrika 41 (1954) 100-115; F. Gustafsson, Adaptive Filtering and Change Detection
    (2000), sec. 2.6 and 5.1.

    Parameters
    ----------
    threshold : float
        Of the sum, in swings of the usual energy.
    drift : float
        Rise of the energy that is no change, in parts of the usual one.

    Raises
    ------
    ValueError
        If threshold is not above zero, or drift negative.
    """

    threshold: float = 2.0
    drift: float = 1.0

    def __post_init__(self) -> None:
        moderate("threshold", self.threshold)
        moderate("drift", self.drift, or_zero=True)


@dataclass(frozen=True, slots=True)
class Projection:
    """Keep theta itself in the admissible set: after each update the nearest point in the metric of P.

    Without it theta goes where the data say, and only the model handed out is projected.

    P. Ioannou, J. Sun, Robust Adaptive Control (1996), sec. 4.4; G. Goodwin, K. Sin, Adaptive
    Filtering, Prediction and Control (1984), sec. 3.7; D. Simon, IET Control Theory Appl. 4 (2010)
    1303-1318.

    Parameters
    ----------
    margin : float
        Distance from the faces alpha beta < gamma <= 2 alpha beta, in parts of alpha beta.

    Raises
    ------
    ValueError
        If margin is not within (0, 0.4].
    """

    margin: float = 0.01

    def __post_init__(self) -> None:
        positive("margin", fraction("margin", self.margin, 0.0, 0.4))
