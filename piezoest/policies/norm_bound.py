"""A bound on the covariance."""

from dataclasses import dataclass

import numpy as np

from piezoest._checks import finite
from piezoest.policies.base import Conditions, Policy


@dataclass(frozen=True, slots=True)
class NormBound(Policy):
    """Bound R0 on the trace of the covariance (A6): an update of P that would exceed it is skipped.

    Taken literally, (A6) freezes P for ever once ||P|| > R0. Here only an update that would
    exceed the bound is skipped.

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

    def law(self, at: Conditions) -> dict[str, float]:
        """Bound on the trace of P of the law."""
        return {"bound": float(self.limit * np.trace(at.P_0))}
