"""The Preisach operator with a density that is a product of functions of width and place of the relays.

A relay that switches up at alpha and down at beta has the half-width r = (alpha - beta)/2 and the
place s = (alpha + beta)/2. The relays of one r together are a function of the play of
threshold r: x = sum over r of g_r(play_r[u]), with g_r' the density over s (M. Brokate, J.
Sprekels, Hysteresis and Phase Transitions, Springer 1996, sec. 2.4). Here the density over s is
bell-shaped, sech²((s - centre)/width), the same for all r. Minor loops of one size then depend on
their place, which no Prandtl-Ishlinskii operator can do.
Symbols: voltage u [V], play states y [V], thresholds r [V], displacement w [µm].
"""

import numpy as np
from numba.extending import register_jitable

from piezoest.compile import inlined
from piezoest.equations.play import play


@register_jitable
def relays(y, centre, width):
    """Integral of sech²((s - centre)/width) over s from 0 to y [V]."""
    return width * (np.tanh((y - centre) / width) + np.tanh(centre / width))


@inlined
def preisach_step(y, u, gain, thresholds, weights, centre, width):
    """w = gain u + sum_i weights[i] relays(play_i[u]); the states `y` (n,) are updated in place."""
    w = gain * u
    for i in range(len(y)):
        y[i] = play(y[i], u, thresholds[i])
        w = w + weights[i] * relays(y[i], centre, width)
    return w
