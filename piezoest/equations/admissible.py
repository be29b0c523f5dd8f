"""Nearest admissible Coleman-Hodgdon parameters.

The set below (1) of Eielsen et al. (2012): alpha > 0, beta > 0, alpha beta < gamma <= 2 alpha beta.
Projection onto a linearised constraint in the metric of a covariance: D. Simon, Kalman
filtering with state constraints, IET Control Theory Appl. 4 (2010) 1303-1318, sec. 2.3.
"""

import numpy as np
from numba.extending import register_jitable

from piezoest.compile import local, local_rows

# Enough for the curved faces from anywhere within a factor of ten; the final clamp makes
# the result admissible however far it came.
_ITERATIONS = 8

# Models within these bounds have a voltage that is a number for every displacement a stage can make:
# of alpha [1/V] and of the slope c = gamma/alpha [µm/V].
SMALLEST, LARGEST = 1e-100, 1e100

# Distance kept from the faces where a model is moved into the set, relative to gamma.
NEAREST_MARGIN = 1e-6


@register_jitable
def is_admissible(alpha, beta, gamma, alpha_least, beta_least, margin):
    """1.0 if (alpha, beta, gamma) lies inside the set by the margins, else 0.0."""
    area = alpha * beta
    return (
        (alpha >= alpha_least)
        * (beta >= beta_least)
        * (gamma >= (1.0 + margin) * area)
        * (gamma <= (2.0 - margin) * area)
        * 1.0
    )


@register_jitable
def _onto_least(theta, P, i, least):
    """Move theta along P's column i until theta[i] >= least, the nearest point in P's metric."""
    variance = P[i, i]
    lack = np.fmax(least - theta[i], 0.0) / (variance + (variance == 0.0))
    for j in range(len(theta)):
        theta[j] = theta[j] + P[j, i] * lack


@register_jitable
def _onto_surface(theta, P, factor, side):
    """Move theta to the nearest point with gamma = factor alpha beta, if it lies beyond by `side`."""
    beyond = (side * (theta[2] - factor * theta[0] * theta[1]) > 0.0) * 1.0
    alpha_0 = theta[0]
    beta_0 = theta[1]
    gamma_0 = theta[2]
    alpha = alpha_0
    beta = beta_0
    multiplier = 0.0
    for _ in range(_ITERATIONS):
        g_alpha = -factor * beta
        g_beta = -factor * alpha
        value = gamma_0 + g_alpha * alpha_0 + g_beta * beta_0 + factor * alpha * beta
        p_alpha = P[0, 0] * g_alpha + P[0, 1] * g_beta + P[0, 2]
        p_beta = P[1, 0] * g_alpha + P[1, 1] * g_beta + P[1, 2]
        p_gamma = P[2, 0] * g_alpha + P[2, 1] * g_beta + P[2, 2]
        norm = g_alpha * p_alpha + g_beta * p_beta + p_gamma
        multiplier = beyond * value / (norm + (norm == 0.0))
        alpha = alpha_0 - p_alpha * multiplier
        beta = beta_0 - p_beta * multiplier
    for j in range(len(theta)):
        theta[j] = theta[j] - multiplier * (P[j, 0] * -factor * beta + P[j, 1] * -factor * alpha + P[j, 2])


@register_jitable
def project_admissible(theta, P, alpha_least, beta_least, margin):
    """Move theta (n,) in place to the nearest admissible point in the metric of P; False if there is none.

    theta[:3] = (alpha, beta, gamma); further entries (an offset) move with them as P's
    correlations say. P (n, n) is not changed. If anything is NaN or unreasonably large, the
    result is False and theta must not be used: a clamp would turn NaN into the smallest gain, and so
    into the largest voltage.
    """
    _onto_least(theta, P, 0, alpha_least)
    _onto_least(theta, P, 1, beta_least)
    _onto_surface(theta, P, 1.0 + margin, -1.0)
    _onto_surface(theta, P, 2.0 - margin, 1.0)
    reach = 0.0
    for i in range(len(theta)):
        reach = reach + np.abs(theta[i])
    theta[0] = np.fmax(theta[0], alpha_least)
    theta[1] = np.fmax(theta[1], beta_least)
    area = theta[0] * theta[1]
    theta[2] = np.fmin(np.fmax(theta[2], (1.0 + margin) * area), (2.0 - margin) * area)
    return reach < LARGEST and theta[2] < LARGEST


@register_jitable
def kept_gain(gain, start, least):
    """Gain with the start's sign and at least `least` times its size; the start's if it is not a number.

    A small gain means a large voltage; a sensor that reads zero must not cause one.
    """
    if not np.abs(gain) < LARGEST:
        return start
    return gain if gain / start >= least else least * start


@register_jitable
def has_inverse(alpha, beta, gamma):
    """True if the parameters are exactly admissible: a > 0, beta > 0, b > 0 and c >= 2b.

    Numbers that overflow in the inverse are not admissible.
    """
    if not (alpha > SMALLEST and alpha < LARGEST and beta > 0.0):
        return False
    c = gamma / alpha
    b = c - beta
    return b > 0.0 and c >= 2.0 * b and c > SMALLEST and c < LARGEST


@register_jitable
def nearest_admissible(theta, margin):
    """Move theta (3,) in place into the set, each parameter measured relative to its own value.

    False if there is no such point, see `project_admissible`.
    """
    P = local_rows(3, 3)
    for i in range(3):
        for j in range(3):
            P[i, j] = 0.0
        scale = np.fmax(np.abs(theta[i]), 1e-12)
        P[i, i] = scale * scale
    first = local(3)
    for i in range(3):
        first[i] = theta[i]
    alpha_least = 1e-9 * np.fmax(np.abs(theta[0]), 1e-12)
    beta_least = 1e-9 * np.fmax(np.abs(theta[1]), 1e-12)
    found = project_admissible(first, P, alpha_least, beta_least, margin)
    for i in range(3):
        theta[i] = first[i]
    return found
