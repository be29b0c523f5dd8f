"""Plays with bends: the Prandtl-Ishlinskii operator for asymmetric loops.

One-sided dead zones change the slope of a play's output above a voltage. K. Kuhnen, European
Journal of Control 9 (2003) 407-418, lets them act on the sum of all plays; here they act on
each play, the voltage itself being the play of threshold zero. That is linear in its
parameters, with regressors from u alone, and with enough plays and bends it is any Preisach
operator (M. Brokate, J. Sprekels, Hysteresis and Phase Transitions, Springer 1996, sec. 2.4).
Symbols: voltage u [V], play states y [V], thresholds r [V], bends d [V], displacement w [µm].
"""

import numpy as np
from numba.extending import register_jitable

from piezoest.equations.play import play, prandtl_ishlinskii_inverse, weighted_sum

# Breakpoints nearer than this, relative to the voltages about, are one: below rounding's reach.
SAME = 1e-13


@register_jitable
def dead_zone(p, d):
    """The part of p above d, minus the same for zero: 0 at p = 0."""
    return np.fmax(p - d, 0.0) - np.fmax(-d, 0.0)


@register_jitable
def between(p, low, high):
    """p, limited to the range between two bends."""
    return np.fmin(np.fmax(p, low), high)


@register_jitable
def bent(p, slope, bends, changes, column, columns):
    """slope p + sum_j changes[j, column] dead_zone(p, bends[j]); `changes` is flat, in row order."""
    x = slope * p
    for j in range(len(bends)):
        x = x + changes[j * columns + column] * dead_zone(p, bends[j])
    return x


@register_jitable
def bent_plays_output(y, u, gain, weights, bends, changes):
    """w of the voltage u and the play states y (n,), which are not changed."""
    if len(bends) == 0:
        return gain * u + weighted_sum(weights, y)
    columns = len(y) + 1
    w = bent(u, gain, bends, changes, 0, columns)
    for i in range(len(y)):
        w = w + bent(y[i], weights[i], bends, changes, i + 1, columns)
    return w


@register_jitable
def bent_plays_step(y, u, gain, thresholds, weights, bends, changes):
    """w after the next voltage; the states `y` (n,) are updated in place."""
    for i in range(len(y)):
        y[i] = play(y[i], u, thresholds[i])
    return bent_plays_output(y, u, gain, weights, bends, changes)


@register_jitable
def _slope_ahead(p, way, slope, bends, changes, column, columns, near):
    """(slope, distance to the next bend) of one play's output as it moves on from p."""
    ahead = np.inf
    for j in range(len(bends)):
        gap = way * (bends[j] - p)
        if gap > near:
            ahead = min(ahead, gap)
        # Above the bend, which is where a way up from it and a way down to it lie.
        if (way > 0.0) != (gap > near):
            slope += changes[j * columns + column]
    return slope, ahead


@register_jitable
def bent_plays_inverse(y, u, w, gain, thresholds, weights, bends, changes):
    """The next voltage, for which `bent_plays_step` gives w; u is the last, to which y belong.

    w rises with u along straight pieces. From the last voltage this walks from breakpoint
    to breakpoint, each a play that begins to move or an output that bends, until w lies on
    the current piece. This is exact; most samples pass no breakpoint or one.
    """
    n = len(y)
    columns = n + 1
    x = bent_plays_output(y, u, gain, weights, bends, changes)
    way = 1.0 if w > x else -1.0
    for _ in range(n + columns * len(bends) + 1):
        near = SAME * (np.abs(u) + (thresholds[n - 1] if n > 0 else 0.0))
        slope, reach = _slope_ahead(u, way, gain, bends, changes, 0, columns, near)
        for i in range(n):
            gap = thresholds[i] - way * (u - y[i])
            if gap > near:
                reach = min(reach, gap)
                break  # the plays of larger thresholds begin to move later
            part, ahead = _slope_ahead(
                u - way * thresholds[i], way, weights[i], bends, changes, i + 1, columns, near
            )
            slope += part
            reach = min(reach, ahead)
        distance = way * (w - x) / slope
        if distance <= reach:
            return u + way * distance
        u += way * reach
        x += way * slope * reach
    return u


@register_jitable
def prandtl_ishlinskii_voltage(y, u, w, gain, thresholds, weights, bends, changes):
    """The next voltage for w; faster if there are no bends."""
    if len(bends) == 0:
        return prandtl_ishlinskii_inverse(y, w, gain, thresholds, weights)
    return bent_plays_inverse(y, u, w, gain, thresholds, weights, bends, changes)
