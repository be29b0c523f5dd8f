"""The Coleman-Hodgdon hysteresis model and its inverse.

Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), whose
equation numbers are used below. Symbols: voltage u [V], displacement w [µm],
alpha [1/V], beta [µm/V], gamma [µm/V²]; in the second form a [1/V], b and c [µm/V].
"""

import numpy as np
from numba.extending import register_jitable

# Newton's steps after the start value of `inverse_increment`; two reach rounding for
# every admissible model, the third is the margin (tests/equations/test_coleman_hodgdon.py).
_NEWTON_STEPS = 3

# Up to here the next term of the series of `relative_decay` is lost in rounding.
_SHORT = 1.0 / 64.0

# Keeps 0/0 out of the start value where slope and travel are both zero.
_TINY = 1e-300


@register_jitable
def loop_parameters(alpha, beta, gamma):
    """(a, b, c) of the second form (2)-(3) from (alpha, beta, gamma), by (4)."""
    c = gamma / alpha
    return alpha, c - beta, c


@register_jitable
def rate_parameters(a, b, c):
    """(alpha, beta, gamma) of the first form (1) from (a, b, c): the inverse of (4)."""
    return a, c - b, a * c


@register_jitable
def rate(w, u, u_dot, alpha, beta, gamma):
    """dw/dt of the first form (1) [µm/s]."""
    return beta * u_dot - alpha * w * np.abs(u_dot) + gamma * np.abs(u_dot) * u


@register_jitable
def relative_decay(travel):
    """(1 - exp(-travel)) / travel, which is 1 at travel = 0.

    For a short travel, such as that of a sample, a series is used: equally exact and much faster.
    """
    if isinstance(travel, float) and travel < _SHORT:
        square = travel * travel
        low = (1.0 - travel * (1.0 / 2.0)) + square * ((1.0 / 6.0) - travel * (1.0 / 24.0))
        high = ((1.0 / 120.0) - travel * (1.0 / 720.0)) + square * (1.0 / 5040.0)
        return low + square * square * high
    at_rest = (travel == 0.0) * 1.0
    return -np.expm1(-travel) / (travel + at_rest) + at_rest


@register_jitable
def hysteresis_step(w_h, du, a, b):
    """w_h after a monotone change of voltage du: (B12)-(B15), the exact solution of (3).

    w_h exp(-a|du|) - sign(du) (b/a)(1 - exp(-a|du|)), written with the relative decay
    R = (1 - exp(-a|du|))/(a|du|), so that a = 0 and du = 0 need no special case.
    """
    travel = a * np.abs(du)
    return _decayed(w_h, du, travel, b, relative_decay(travel))


@register_jitable
def _decayed(w_h, du, travel, b, decay):
    return w_h - decay * (travel * w_h + b * du)


@register_jitable
def hysteresis_linearised(w_h, du, a, b):
    """`hysteresis_step` and its derivatives by w_h, a and b, with a single exponential."""
    distance = np.abs(du)
    travel = a * distance
    decay = relative_decay(travel)
    kept = 1.0 - travel * decay
    at_rest = (travel == 0.0) * 1.0
    decay_slope = (kept - decay) / (travel + at_rest) - 0.5 * at_rest
    by_a = -distance * (decay_slope * (travel * w_h + b * du) + decay * w_h)
    return _decayed(w_h, du, travel, b, decay), kept, by_a, -decay * du


@register_jitable
def hysteresis_jacobian(w_h, du, a, b):
    """Derivatives of `hysteresis_step` by w_h, a and b."""
    _, kept, by_a, by_b = hysteresis_linearised(w_h, du, a, b)
    return kept, by_a, by_b


@register_jitable
def regressor(w, u, u_dot):
    """The regressor (20): (-w|u'|, u', |u'|u), so that dw/dt = theta . regressor (18)."""
    speed = np.abs(u_dot)
    return -w * speed, u_dot, speed * u


@register_jitable
def sample_regressor(u_0, u_1):
    """The voltage terms of the regressor (20), integrated over one sample with a monotone voltage.

    Returns (du, |du| u, |du|): |u'|u integrates exactly. With the mean displacement w over
    the sample (trapezoidal rule, error of third order in du), w_1 - w_0 =
    -alpha w |du| + beta du + gamma |du| u + delta |du|. The last term carries the offset: with
    the loop's centre at (u_c, x_c), (1) stays linear with delta = alpha x_c - gamma u_c, so that
    the offset of x = c u + w_h + x_0 is delta/alpha.
    """
    du = u_1 - u_0
    _, rise, moment = regressor(0.0, 0.5 * (u_0 + u_1), du)
    return rise, moment, np.abs(du)


@register_jitable
def inverse_rate(w_h, r_dot, a, b, c):
    """dw_h/dt while the displacement follows r: (17) with K u' = r'.

    The branches of (17) differ by the sign of r', which is that of u' (C12).
    """
    s = (r_dot >= 0.0) * 2.0 - 1.0
    slope = -s * a * w_h - b
    return slope / (slope + c) * r_dot


@register_jitable
def inverse_increment(w_h, dr, a, b, c):
    """Change of voltage that moves the displacement by dr from state w_h: (C7), (C10).

    With s = sign(dr), e = (b + s a w_h)/c and d = a|dr|/c, the travel z = a|du| solves
    z + e (exp(-z) - 1) = d, whose closed form is
    z = d + e + W0(-e exp(-(d + e))), Lambert's W on its principal branch.
    Evaluated literally this cancels for the short travels between two samples and
    overflows in the paper's form for long ones; here the same root is reached from an
    algebraic start value, exact in both limits, by Newton's method on increments.
    Admissible parameters have 0 <= e <= 1.
    """
    s = np.sign(dr)
    e = np.fmin(np.fmax((b + s * a * w_h) / c, 0.0), 1.0)
    d = a * np.abs(dr) / c
    slope = 1.0 - e - 0.5 * d
    # The root is at most d + e; long travels cancel in the quotient.
    z = np.fmin(2.0 * d / (slope + np.sqrt(slope * slope + 2.0 * d) + _TINY), d + e)
    for _ in range(_NEWTON_STEPS):
        decayed = -z * relative_decay(z)  # exp(-z) - 1
        z = z - (z + e * decayed - d) / (1.0 - e * (1.0 + decayed) + _TINY)
    return s * z / a
