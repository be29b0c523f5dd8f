"""Discrete filters as functions of one sample: first order, and second-order sections.

Source: K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997, ch. 2 (an input
held over the sample) and ch. 8 (the bilinear transform and its warping).
"""

import numpy as np
from numba.extending import register_jitable


@register_jitable
def first_order_pole(cutoff, sample_rate):
    """Pole of the first-order filter with `cutoff` [Hz]: exp(-2 pi cutoff / sample_rate)."""
    return np.exp(-2.0 * np.pi * cutoff / sample_rate)


@register_jitable
def low_pass_step(y, x, pole):
    """Next output of 1/(s/omega + 1), the input held over the sample (W_p of App. A)."""
    return x + pole * (y - x)


@register_jitable
def high_pass_step(low, x, pole):
    """Next (low-pass state, output) of s/(s + omega): the input minus its low-pass."""
    low = low_pass_step(low, x, pole)
    return low, x - low


@register_jitable
def biquad_step(state, x, coefficients):
    """Next output of a second-order section; `state` (2,) is updated in place.

    `coefficients` = (b0, b1, b2, a1, a2) with a0 = 1, transposed direct form II.
    """
    y = coefficients[0] * x + state[0]
    state[0] = coefficients[1] * x - coefficients[3] * y + state[1]
    state[1] = coefficients[2] * x - coefficients[4] * y
    return y


@register_jitable
def butterworth_low_pass(cutoff, sample_rate):
    """Coefficients (5,) of `biquad_step` for a second-order Butterworth low-pass.

    Bilinear transform, warped so that the gain at `cutoff` [Hz] is 1/sqrt(2).
    """
    k = np.tan(np.pi * cutoff / sample_rate)
    a0 = 1.0 + np.sqrt(2.0) * k + k * k
    b0 = k * k / a0
    a1 = 2.0 * (k * k - 1.0) / a0
    a2 = (1.0 - np.sqrt(2.0) * k + k * k) / a0
    return np.array([b0, 2.0 * b0, b0, a1, a2])
