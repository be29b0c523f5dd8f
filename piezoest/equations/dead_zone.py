"""One-sided dead zones: the memoryless bend that makes a Prandtl-Ishlinskii loop asymmetric.

Source: K. Kuhnen, Modeling, identification and compensation of complex hysteretic
nonlinearities: a modified Prandtl-Ishlinskii approach, European Journal of Control 9 (2003)
407-418. Symbols: displacement before the bend v [µm], after it x [µm], thresholds d [µm].
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable


@register_jitable
def dead_zone(v, d):
    """max(v - d, 0) for d >= 0, min(v - d, 0) for d < 0."""
    return np.fmax(v - d, 0.0) * (d >= 0.0) + np.fmin(v - d, 0.0) * (d < 0.0)


@register_jitable(inline="always")
def bend(v, thresholds, weights):
    """x = v + sum_j weights[j] dead_zone(v, thresholds[j])."""
    x = v
    for j in range(thresholds.shape[0]):
        x = x + weights[j] * dead_zone(v, thresholds[j])
    return x


@register_jitable(inline="always")
def bend_inverse(x, thresholds, weights):
    """The v for which `bend` gives x, for rising thresholds and slopes above zero throughout.

    Outwards from zero each threshold passed adds its weight to the slope: go on along the
    slope before it, then shorten what lies beyond by the ratio of the slopes.
    """
    v = x
    slope = 1.0
    n = thresholds.shape[0]
    for j in range(n):
        share = weights[j] * (thresholds[j] >= 0.0)
        slope = slope + share
        v = v - np.fmax(v - thresholds[j], 0.0) * (share / slope)
    slope = 1.0
    for k in range(n):
        j = n - 1 - k
        share = weights[j] * (thresholds[j] < 0.0)
        slope = slope + share
        v = v - np.fmin(v - thresholds[j], 0.0) * (share / slope)
    return v
