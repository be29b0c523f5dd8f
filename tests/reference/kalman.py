"""The extended Kalman filter of a hysteresis and its parameters, from the textbook, with matrices."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def transition(s: Array, du: float) -> tuple[Array, Array]:
    """State after a monotone change of voltage, (B12)-(B15) of the paper, and its Jacobian by hand."""
    w, a, b = s[0], s[1], s[2]
    sign, distance = np.sign(du), abs(du)
    decay = np.exp(-a * distance)
    after = s.copy()
    after[0] = w * decay - sign * b / a * (1.0 - decay)
    F = np.eye(s.size)
    F[0, 0] = decay
    F[0, 1] = -distance * w * decay + sign * b / a**2 * (1.0 - decay) - sign * b / a * distance * decay
    F[0, 2] = -sign / a * (1.0 - decay)
    return after, F


def predict_covariance(P: Array, F: Array, Q: Array) -> Array:
    """Simon, Optimal State Estimation (2006), (13.47)."""
    return F @ P @ F.T + Q


def update(s: Array, P: Array, h: Array, y: float, R: float) -> tuple[Array, Array, Array, float]:
    """State, covariance by its definition (5.19), gain and innovation variance after one measurement."""
    S = float(h @ P @ h + R)
    K = P @ h / S
    keep = np.eye(s.size) - np.outer(K, h)
    return s + K * y, keep @ P @ keep.T + R * np.outer(K, K), K, S


def project(s: Array, P: Array, g: Array, least: float) -> Array:
    """Minimise (s' - s)' P^-1 (s' - s) under g s' >= least, from the stationarity conditions."""
    if g @ s >= least:
        return s
    n = s.size
    system = np.zeros((n + 1, n + 1))
    system[:n, :n] = 2.0 * np.linalg.inv(P)
    system[:n, n] = system[n, :n] = g
    right = np.append(2.0 * np.linalg.solve(P, s), least)
    return np.linalg.solve(system, right)[:n]
