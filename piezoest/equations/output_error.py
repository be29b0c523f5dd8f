"""The Coleman-Hodgdon model in output-error form: linear in its parameters around a given decay.

With h the hysteresis of a unit slope, h' = -u' - a h |u'| (3), a displacement is
x = c u + b h(a) + x_0 (2), and around a = a_0, with d = b ln(a/a_0),

    x = b h(a_0) + c u + d dh/d(ln a) + x_0,

linear in s = (b, c, d, x_0) with regressors from the voltage alone. Gauss-Newton's linearisation of
an output-error model: L. Ljung, System Identification, 2nd ed. (1999), sec. 10.3 and 11.4-11.5; that
b and d stay separate keeps the regression linear while both are unknown.
"""

import numpy as np
from numba.extending import register_jitable

from piezoest.equations import coleman_hodgdon


@register_jitable
def hysteresis_and_slope(h, by_log_a, du, a):
    """(h, dh/d(ln a)) for b = 1 after a monotone change of voltage du: the exact step and its derivative."""
    kept, by_a, _ = coleman_hodgdon.hysteresis_jacobian(h, du, a, 1.0)
    return coleman_hodgdon.hysteresis_step(h, du, a, 1.0), kept * by_log_a + a * by_a


@register_jitable
def recentre(s, P, step):
    """Go from a_0 to a_0 exp(step): d = b ln(a/a_0) becomes d - step b, in s (n,) and P (n, n)."""
    n = len(s)
    s[2] = s[2] - step * s[0]
    for j in range(n):
        P[2, j] = P[2, j] - step * P[0, j]
    for j in range(n):
        P[j, 2] = P[j, 2] - step * P[j, 0]


@register_jitable
def walk_covariance(b, c, Q):
    """Covariance Q (3, 3) of (b, c, d) if alpha, beta and gamma have a relative standard deviation of 1.

    To first order, by (4): c = gamma/alpha moves by c (e_gamma - e_alpha), b = c - beta by as much less
    beta e_beta, d by b e_alpha. So b, a small difference of large numbers, may change by a fraction of c.
    """
    beta = c - b
    Q[0, 0] = 2.0 * c * c + beta * beta
    Q[0, 1] = 2.0 * c * c
    Q[0, 2] = -c * b
    Q[1, 0] = Q[0, 1]
    Q[1, 1] = 2.0 * c * c
    Q[1, 2] = -c * b
    Q[2, 0] = Q[0, 2]
    Q[2, 1] = Q[1, 2]
    Q[2, 2] = b * b


@register_jitable
def relax(s, P, i, kept, variance):
    """Let state i of s (n,) and P (n, n) go one step on as a first-order Markov process.

    s_i = kept s_i + noise, with the noise that keeps the stationary variance at `variance`.
    """
    n = len(s)
    s[i] = kept * s[i]
    for j in range(n):
        P[i, j] = kept * P[i, j]
    for j in range(n):
        P[j, i] = kept * P[j, i]
    P[i, i] = P[i, i] + (1.0 - kept * kept) * variance


@register_jitable
def log_ratio(b, d, largest):
    """ln(a/a_0) = d/b, kept within +-largest; 0 where there is no hysteresis."""
    none = (b <= 0.0) * 1.0
    return (1.0 - none) * np.fmin(np.fmax(d / (b + none * (1.0 - b)), -largest), largest)
