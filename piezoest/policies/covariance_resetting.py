"""Reset a covariance that has become too small to adapt."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import fraction
from piezoest.compile import inlined
from piezoest.equations import least_squares
from piezoest.layout import WORK, Field, numbers, record
from piezoest.policies.base import Conditions, Policy


@dataclass(frozen=True, slots=True)
class CovarianceResetting(Policy):
    """Set P to its initial value when it has become too small to adapt: lambda_min(P) <= floor.

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

    def numbers(self, at: Conditions) -> dict[str, float]:
        """Floor of P's eigenvalues."""
        return {"floor": float(self.floor * np.linalg.eigvalsh(at.P_0)[0])}

    def keeps(self, n: int) -> Field:
        """Work space for a matrix."""
        return record(root=numbers(n, n, kind=WORK))


@inlined
def before_update(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Let P start again where an eigenvalue is not above the floor."""
    law = state.law
    if fixed.floor > 0.0 and least_squares.above_floor(law.P, fixed.floor, own.root) == 0.0:
        least_squares.restore_covariance(law.P, settings.law.P_0)
        law.resets += 1.0
