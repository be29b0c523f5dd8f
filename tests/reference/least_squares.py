"""Recursive least squares from the textbook, with matrices."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def discrete(theta: Array, P: Array, phi: Array, z: float, mu: float, R: float = 1.0) -> tuple[Array, Array]:
    """Ljung, System Identification (1999), (11.16) with constant forgetting."""
    S = mu * R + phi @ P @ phi
    K = P @ phi / S
    return theta + K * (z - phi @ theta), (P - np.outer(K, phi) @ P) / mu


def continuous_rates(
    theta: Array, P: Array, phi: Array, z: float, lam: float, normalised: bool
) -> tuple[Array, Array]:
    """(A3), (A5)-(A7) of the paper, inside the bound."""
    m2 = 1.0 + phi @ P @ phi if normalised else 1.0
    epsilon = (z - theta @ phi) / m2
    return P @ phi * epsilon, lam * P - P @ np.outer(phi, phi) @ P / m2


def bogacki_shampine(theta: Array, P: Array, h: float, *rest: Any) -> tuple[Array, Array]:
    """One step of the third-order formula, from its Butcher tableau."""
    t1, p1 = continuous_rates(theta, P, *rest)
    t2, p2 = continuous_rates(theta + h / 2 * t1, P + h / 2 * p1, *rest)
    t3, p3 = continuous_rates(theta + 3 * h / 4 * t2, P + 3 * h / 4 * p2, *rest)
    return theta + h / 9 * (2 * t1 + 3 * t2 + 4 * t3), P + h / 9 * (2 * p1 + 3 * p2 + 4 * p3)
