"""Losses of a residual: least squares, and robust ones that outliers move less.

P. J. Huber, Robust Statistics (1981); W. J. J. Rey, Introduction to Robust Methods (1983).
"""

import numpy as np

from piezoest._checks import FloatArray

# Residuals beyond so many standard deviations count less: 95 % efficiency on Gaussian noise.
TUNING: dict[str, float] = {"linear": 1.0, "huber": 1.345, "soft_l1": 1.345, "cauchy": 2.385}
# Least curvature of a loss: beyond its bend a robust one has none, or a negative one.
LEAST_CURVATURE = 1e-16


def bend(loss: str, z: FloatArray) -> FloatArray:
    """Loss rho(z) of a squared residual z, with its first two derivatives, shape (3, N)."""
    if loss == "huber":
        far = np.maximum(z, 1.0)
        outside = z > 1.0
        rho = np.where(outside, 2.0 * np.sqrt(far) - 1.0, z)
        return np.array([rho, far**-0.5, np.where(outside, -0.5 * far**-1.5, 0.0)])
    if loss == "soft_l1":
        root = np.sqrt(1.0 + z)
        return np.array([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])
    if loss == "cauchy":
        return np.array([np.log1p(z), 1.0 / (1.0 + z), -1.0 / (1.0 + z) ** 2])
    return np.array([z, np.ones_like(z), np.zeros_like(z)])
