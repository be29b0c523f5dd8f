"""The play operator, the Prandtl-Ishlinskii operator and its exact inverse.

Sources: M. A. Krasnosel'skii, A. V. Pokrovskii, *Systems with Hysteresis*, Springer 1989
(play); P. Krejci, K. Kuhnen, Inverse control of systems with hysteresis and creep, IEE
Proc. Control Theory Appl. 148 (2001) 185-192 (the operator and its inverse).
Symbols: voltage u [V], play states y [V], thresholds r [V], displacement w [µm].
"""

import numpy as np
from numba.extending import register_jitable

from piezoest.compile import inlined


@register_jitable
def play(y, u, r):
    """Next state of the play of threshold r: max(u - r, min(u + r, y))."""
    return np.fmax(u - r, np.fmin(u + r, y))


@inlined
def weighted_sum(weights, y):
    """sum_i weights[i] y[i]."""
    return sum_of_first(len(y), weights, y)


@register_jitable(inline="always")
def sum_of_first(n, weights, y):
    """sum_i weights[i] y[i] of the first n, as four independent sums, which is faster."""
    first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
    fours = n // 4
    for k in range(fours):
        i = 4 * k
        first = first + weights[i] * y[i]
        second = second + weights[i + 1] * y[i + 1]
        third = third + weights[i + 2] * y[i + 2]
        fourth = fourth + weights[i + 3] * y[i + 3]
    for i in range(4 * fours, n):
        first = first + weights[i] * y[i]
    return (first + second) + (third + fourth)


@inlined
def prandtl_ishlinskii_step(y, u, gain, thresholds, weights):
    """w = gain u + sum_i weights[i] play_i[u]; the states `y` (n,) are updated in place."""
    # Apart from the sum, which would keep this loop from vector instructions.
    for i in range(len(y)):
        y[i] = play(y[i], u, thresholds[i])
    return gain * u + weighted_sum(weights, y)


@inlined
def prandtl_ishlinskii_inverse(y, w, gain, thresholds, weights):
    """The u for which `prandtl_ishlinskii_step` gives w; the states `y` (n,) are not changed.

    Seen from the states y, w is a piecewise linear function of u: between the breakpoints
    y[0] - r[0] and y[0] + r[0] no play moves and its slope is the gain; each breakpoint
    y[i] ± r[i] passed on the way out adds weights[i]. For sorted thresholds the breakpoints
    come in the order of i, so one walk finds u: go on along the slope before breakpoint i,
    then shorten what lies beyond it by the ratio of the slopes. Needs sorted thresholds,
    states that an input can have left behind (|y[i] - y[j]| <= |r[i] - r[j]|), and
    gain + weights[0] + … + weights[i] > 0 for every i.
    """
    u = (w - weighted_sum(weights, y)) / gain
    slope = gain
    for i in range(len(y)):
        slope = slope + weights[i]
        beyond = np.fmax(u - (y[i] + thresholds[i]), 0.0) + np.fmin(u - (y[i] - thresholds[i]), 0.0)
        u = u - beyond * (weights[i] / slope)
    return u
