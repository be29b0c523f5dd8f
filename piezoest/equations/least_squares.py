"""Recursive least squares: Appendix A of the paper in its two time bases.

Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), (A1)-(A7), after
Ioannou and Sun, Robust Adaptive Control, ch. 4. A covariance P of n parameters is updated in place and
kept exactly symmetric.

Symbols: theta parameters, phi regressor, z output, R variance of its noise; `product` receives, or holds, P
phi.
"""

import numpy as np
from numba.extending import register_jitable

from piezoest.compile import inlined, like
from piezoest.equations.integrators import NODES, WEIGHTS

# What an update moves must have squares below this; a trace counts this many times: beyond 1e60 a covariance
# has wound up. Then no gain takes theta where the next innovation's square would pass the bound for good.
LARGEST, TRACE_WEIGHT = 1e200, 1e140
# A step of the continuous law that leaves this times the innovation is one too long for its gain.
UNSTABLE = 2.0
# A regressor whose phi' P phi is less has no direction to forget along.
LEAST_QUADRATIC = 1e-100


@inlined
def predicted_output(theta, phi):
    """theta . phi (A2)."""
    z = theta[0] * phi[0]
    for i in range(1, len(theta)):
        z = z + theta[i] * phi[i]
    return z


@inlined
def covariance_times(P, phi, out):
    """Write P phi into `out` (n,) and return phi' P phi, the n_s² of (A7)."""
    n = len(out)
    for i in range(n):
        total = P[i, 0] * phi[0]
        for j in range(1, n):
            total = total + P[i, j] * phi[j]
        out[i] = total
    return predicted_output(out, phi)


@inlined
def trace(P):
    """Trace of P: the norm ||P|| of (A6) here (for P > 0 at least the spectral norm)."""
    total = P[0, 0]
    for i in range(1, len(P)):
        total = total + P[i, i]
    return total


@inlined
def innovation(theta, P, phi, z, product):
    """Innovation y = z - theta . phi and phi' P phi; `product` (n,) receives P phi."""
    y = z - predicted_output(theta, phi)
    return y, covariance_times(P, phi, product)


@inlined
def is_covariance(P):
    """Whether all variances of P are above zero; rounding can make them negative."""
    least = P[0, 0]
    for i in range(1, len(P)):
        least = min(least, P[i, i])
    return least > 0.0


@inlined
def is_safe(P, y, spread, product):
    """Whether an update by the gain P phi/spread gives reasonable numbers; `product` holds P phi.

    This is checked before the update. An update that is not safe is skipped, and the last good estimate
    stays. NaN or infinity anywhere in theta, P, phi or z makes one of these numbers NaN or infinite. A
    covariance with a variance that is not above zero is not safe either.
    """
    least = min(spread, P[0, 0])  # one comparison for all: this is asked of every sample
    for i in range(1, len(P)):
        least = min(least, P[i, i])
    reach = (predicted_output(product, product) + y * y) + trace(P) * TRACE_WEIGHT
    return least > 0.0 and reach < LARGEST


@inlined
def discrete_correction(theta, P, y, quadratic, forgetting, R, bound, product):
    """One sample of recursive least squares, after `innovation`; returns the innovation's variance S.

    With mu = `forgetting` (mu = exp(-dt/memory) forgets as (A4) does):
    S = phi' P phi / mu + R, K = P phi / (mu S), theta += K y, P = (P - K phi' P) / mu.
    P is kept if the update would take its trace above `bound` (R0 of A6). Unlike (A6) taken
    literally, this cannot freeze P for ever.
    """
    n = len(theta)
    spread = quadratic + forgetting * R
    gain = 1.0 / spread
    # trace(P) - |P phi|^2 / spread <= bound mu times spread^2: without waiting for the division, and with the
    # sign that rounding may have given a covariance, which then heals.
    excess = trace(P) - bound * forgetting
    within = (excess * spread * spread <= predicted_output(product, product) * spread) * 1.0
    inverse = 1.0 / forgetting
    grow = 1.0 + within * (inverse - 1.0)
    for i in range(n):
        share = gain * product[i]
        theta[i] = theta[i] + share * y
        for j in range(i, n):
            entry = (P[i, j] - share * (within * product[j])) * grow
            P[i, j] = entry
            P[j, i] = entry
    return quadratic * inverse + R


@register_jitable
def continuous_rates(theta, P, phi, z, forgetting_rate, normalised, theta_rate, P_rate):
    """d theta/dt (A5) and dP/dt (A6, inside the bound) with m² of (A7), or m² = 1 if not normalised."""
    n = len(theta)
    product = like(theta)
    m_squared = 1.0 + normalised * covariance_times(P, phi, product)
    epsilon = (z - predicted_output(theta, phi)) / m_squared
    for i in range(n):
        theta_rate[i] = product[i] * epsilon
        for j in range(i, n):
            entry = forgetting_rate * P[i, j] - product[i] * product[j] / m_squared
            P_rate[i, j] = entry
            P_rate[j, i] = entry


@register_jitable
def continuous_step(theta, P, phi, z, h, forgetting_rate, normalised, rates):
    """What a step h of (A5)-(A7) by Bogacki and Shampine, phi and z held, would change; returns (y, S).

    y = z - theta . phi and S = 1 + phi' P phi, both before the step. Its mean rates go into `rates.theta` and
    `rates.P`; `continuous_correction` goes the step.
    """
    n = len(theta)
    theta_slope, theta_stage, P_slope, P_stage = like(theta), like(theta), like(P), like(P)
    y = z - predicted_output(theta, phi)
    S = 1.0 + covariance_times(P, phi, theta_slope)
    for i in range(n):
        theta_slope[i] = 0.0
        rates.theta[i] = 0.0
        for j in range(n):
            P_slope[i, j] = 0.0
            rates.P[i, j] = 0.0
    for k in range(3):
        for i in range(n):
            theta_stage[i] = theta[i] + NODES[k] * h * theta_slope[i]
            for j in range(n):
                P_stage[i, j] = P[i, j] + NODES[k] * h * P_slope[i, j]
        continuous_rates(theta_stage, P_stage, phi, z, forgetting_rate, normalised, theta_slope, P_slope)
        for i in range(n):
            rates.theta[i] = rates.theta[i] + WEIGHTS[k] * theta_slope[i]
            for j in range(n):
                rates.P[i, j] = rates.P[i, j] + WEIGHTS[k] * P_slope[i, j]
    return y, S


@register_jitable
def continuous_is_safe(P, phi, y, S, h, rates):
    """Whether a `continuous_step` gives reasonable numbers, as in `is_safe`, and is stable.

    Without normalisation a step can be too long for the gain. The innovation would then grow in every step.
    """
    n = len(P)
    reach = (y * y + S * S) + trace(P) * TRACE_WEIGHT
    for i in range(n):
        reach = reach + h * rates.theta[i] * (h * rates.theta[i])
    for i in range(n):
        for j in range(n):
            reach = reach + h * rates.P[i, j] * (h * rates.P[i, j])
    left = y - h * predicted_output(rates.theta, phi)
    stable = np.abs(left) <= UNSTABLE * np.abs(y)
    return is_covariance(P) and stable and reach < LARGEST


@register_jitable
def continuous_correction(theta, P, h, bound, rates):
    """Go a step of `continuous_step`; as in (A6), P moves only while ||P|| <= `bound`, or becomes smaller."""
    n = len(theta)
    size = trace(P)
    growth = h * trace(rates.P)
    within = np.fmin((size + growth <= bound) * 1.0 + (growth <= 0.0) * 1.0, 1.0)
    for i in range(n):
        theta[i] = theta[i] + h * rates.theta[i]
        for j in range(n):
            P[i, j] = P[i, j] + within * h * rates.P[i, j]


@inlined
def directional_correction(theta, P, y, q, forgetting, R, bound, product):
    """One sample that forgets only along the present regressor, after `innovation`; returns S.

    R. Kulhavy, Restricted exponential forgetting in real-time identification, Automatica 23
    (1987) 589-600; in terms of the information matrix, L. Cao, H. Schwartz, Automatica 36 (2000)
    1725-1731. With q = phi' P phi and mu = `forgetting`: K = P phi/(R + q),
    P^-1 += (mu - (1 - mu) R/q) phi phi'/R. This is exponential forgetting along phi; other directions
    are kept. `bound` as in `discrete_correction`.
    """
    n = len(theta)
    S = q + R
    lost = (1.0 - forgetting) * R
    has_direction = (q > LEAST_QUADRATIC) * 1.0
    shrink = has_direction * (forgetting * q - lost) / (forgetting * S * (q + (1.0 - has_direction)))
    size = 0.0
    removed = 0.0
    for i in range(n):
        theta[i] = theta[i] + product[i] * y / S
        size = size + P[i, i]
        removed = removed + product[i] * product[i]
    within = np.fmin((size - removed * shrink <= bound) * 1.0 + (shrink >= 0.0) * 1.0, 1.0)
    for i in range(n):
        for j in range(i, n):
            entry = P[i, j] - within * shrink * product[i] * product[j]
            P[i, j] = entry
            P[j, i] = entry
    return S


@inlined
def variable_forgetting(y, quadratic, R, forgetting, least):
    """Forgetting factor from the innovation's energy: a short memory when the model no longer fits.

    T. Fortescue, L. Kershenbaum, B. Ydstie, Implementation of self-tuning regulators with variable
    forgetting factors, Automatica 17 (1981) 831-835: mu = 1 - (1 - phi' K) y²/(N_0 R), N_0 the
    nominal memory in samples, 1/(1 - `forgetting`); never below `least`. `quadratic` = phi' P phi.
    """
    energy = y * y / (R + quadratic)
    return np.fmax(1.0 - energy * (1.0 - forgetting), least)


@inlined
def cusum(total, value, drift):
    """One-sided cumulative sum of what exceeds `drift`, never below zero.

    E. Page, Continuous inspection schemes, Biometrika 41 (1954) 100-115; F. Gustafsson, Adaptive
    Filtering and Change Detection (2000), sec. 2.6.
    """
    return np.fmax(total + value - drift, 0.0)


@inlined
def random_walk(variance, growth, ceiling):
    """P_ii after a step of a random walk: it grows by a constant while it is below a limit.

    L. Ljung, System Identification, 2nd ed. (1999), sec. 11.2, the Kalman filter's
    interpretation of recursive least squares. Unlike division by a forgetting factor this grows
    P by a constant: a direction without excitation is forgotten linearly and not
    exponentially.
    """
    return variance + growth * (variance < ceiling)


@inlined
def propagate_error(C, phi, gain, filtered, pole, ratio, differenced):
    """Covariance C of the estimate's error after an update, under white noise before the filters.

    The error obeys d = (I - K phi') d + K e. White noise v of standard deviation `ratio` reaches e
    through a first-order low-pass of `pole`, which the gain K is passed through here instead
    (`filtered`, in place), and, where `differenced` is 1.0, as v_k - v_(k-1): of two
    successive gains only G = K_k - (I - K_k phi') K_(k-1) then counts.
    """
    n = len(phi)
    product, rest, fresh = like(phi), like(phi), like(phi)
    quadratic = covariance_times(C, phi, product)
    reach = predicted_output(filtered, phi)
    for i in range(n):
        rest[i] = product[i] - quadratic * gain[i]
        before = filtered[i]
        now = gain[i] + pole * (before - gain[i])
        filtered[i] = now
        fresh[i] = (now - differenced * (before - gain[i] * reach)) * ratio
    # (I - K phi') C (I - K phi')' + G G'
    for i in range(n):
        for j in range(i, n):
            entry = C[i, j] - gain[i] * product[j] - rest[i] * gain[j] + fresh[i] * fresh[j]
            C[i, j] = entry
            C[j, i] = entry


@inlined
def above_floor(P, floor, root):
    """1.0 if every eigenvalue of P exceeds `floor`, else 0.0: Cholesky on P - floor I, into `root` (n, n).

    Exact; needs n³/6 products.
    """
    n = len(P)
    positive = 1.0
    for j in range(n):
        pivot = P[j, j] - floor
        for k in range(j):
            pivot = pivot - root[j, k] * root[j, k]
        positive = positive * (pivot > 0.0)
        # A pivot that failed still needs a finite root for the columns after it.
        root[j, j] = np.sqrt(np.fmax(pivot, 1e-300))
        for i in range(j + 1, n):
            entry = P[i, j]
            for k in range(j):
                entry = entry - root[i, k] * root[j, k]
            root[i, j] = entry / root[j, j]
    return positive


@inlined
def add_covariance(P, P_0):
    """Announce a change: P += P_0, which adds the initial uncertainty to the present one.

    F. Gustafsson, Adaptive Filtering and Change Detection (2000), sec. 5.1.
    """
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] = P[i, j] + P_0[i, j]


@inlined
def restore_covariance(P, P_0):
    """Covariance resetting: P = P_0 (Ioannou and Sun, sec. 4.3.6)."""
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] = P_0[i, j]
