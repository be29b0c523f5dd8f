"""Recursive least squares: Appendix A of the paper in its two time bases.

Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), (A1)-(A7), after
Ioannou and Sun, Robust Adaptive Control, ch. 4. A covariance P of n parameters is a flat
array of n*n numbers in row order, updated in place and kept exactly symmetric.

Symbols: theta parameters, phi regressor, z output, R variance of its noise.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from piezoest._jit import unrolled
from piezoest.equations.integrators import NODES, WEIGHTS

# What an update moves must have squares below this; a trace counts this many times: beyond 1e60 a covariance
# has wound up. Then no gain takes theta where the next innovation's square would pass the bound for good.
LARGEST, TRACE_WEIGHT = 1e200, 1e140
# A step of the continuous law that leaves this times the innovation is one too long for its gain.
UNSTABLE = 2.0
# A regressor whose phi' P phi is less has no direction to forget along.
LEAST_TOLD = 1e-100


@unrolled
def predicted_output(theta, phi, n):
    """theta . phi (A2)."""
    z = theta[0] * phi[0]
    for i in range(1, n):
        z = z + theta[i] * phi[i]
    return z


@unrolled
def covariance_times(P, phi, n, out):
    """Write P phi into `out` (n,) and return phi' P phi, the n_s² of (A7)."""
    for i in range(n):
        total = P[i * n] * phi[0]
        for j in range(1, n):
            total = total + P[i * n + j] * phi[j]
        out[i] = total
    return predicted_output(out, phi, n)


@unrolled
def trace(P, n):
    """Trace of P: the norm ||P|| of (A6) here (for P > 0 at least the spectral norm)."""
    total = P[0]
    for i in range(1, n):
        total = total + P[i * n + i]
    return total


@unrolled
def innovation(theta, P, phi, z, n, work):
    """Innovation y = z - theta . phi and phi' P phi; `work` (n,) receives P phi."""
    y = z - predicted_output(theta, phi, n)
    return y, covariance_times(P, phi, n, work)


@unrolled
def is_covariance(P, n):
    """Whether all variances of P are above zero: rounding can take more than there is."""
    least = P[0]
    for i in range(1, n):
        least = min(least, P[i * n + i])
    return least > 0.0


@unrolled
def is_safe(P, n, y, spread, work):
    """Whether an update by the gain P phi/spread moves nothing beyond all measure; `work` holds P phi.

    Asked before the update: what is not safe is not taken, and the last good estimate stays. NaN or
    infinity anywhere in theta, P, phi or z ends up in one of these numbers. A covariance that
    rounding has taken a variance from is not safe either.
    """
    least = min(spread, P[0])  # one comparison for all: this is asked of every sample
    for i in range(1, n):
        least = min(least, P[i * n + i])
    reach = (predicted_output(work, work, n) + y * y) + trace(P, n) * TRACE_WEIGHT
    return least > 0.0 and reach < LARGEST


@unrolled
def discrete_update(theta, P, phi, z, n, forgetting, R, bound, enable, work):
    """One sample of recursive least squares; returns the innovation y and its variance S.

    With mu = `forgetting` (mu = exp(-dt/memory) forgets as (A4) does):
    S = phi' P phi / mu + R, K = P phi / (mu S), theta += K y, P = (P - K phi' P) / mu.
    P keeps its value where the update would take its trace above `bound` (R0 of A6; unlike
    (A6) to the letter this cannot freeze P for good). With `enable` 0.0 nothing changes.
    `work` (n,) holds P phi.
    """
    y, quadratic = innovation(theta, P, phi, z, n, work)
    S = discrete_correction(theta, P, n, y, quadratic, forgetting, R, bound, enable, work)
    return y, S


@unrolled
def discrete_correction(theta, P, n, y, quadratic, forgetting, R, bound, enable, work):
    """The part of `discrete_update` behind `innovation`; returns S."""
    spread = quadratic + forgetting * R
    gain = enable / spread
    # trace(P) - |P phi|^2 / spread <= bound mu times spread^2: without waiting for the division, and with the
    # sign that rounding may have given a covariance, which then heals.
    excess = trace(P, n) - bound * forgetting
    within = (excess * spread * spread <= predicted_output(work, work, n) * spread) * enable
    inverse = 1.0 / forgetting
    grow = 1.0 + within * (inverse - 1.0)
    for i in range(n):
        share = gain * work[i]
        theta[i] = theta[i] + share * y
        for j in range(i, n):
            entry = (P[i * n + j] - share * (within * work[j])) * grow
            P[i * n + j] = entry
            P[j * n + i] = entry
    return quadratic * inverse + R


@register_jitable
def continuous_rates(theta, P, phi, z, n, forgetting_rate, normalised, theta_rate, P_rate, work):
    """d theta/dt (A5) and dP/dt (A6, inside the bound) with m² of (A7), or m² = 1 if not normalised."""
    m_squared = 1.0 + normalised * covariance_times(P, phi, n, work)
    epsilon = (z - predicted_output(theta, phi, n)) / m_squared
    for i in range(n):
        theta_rate[i] = work[i] * epsilon
        for j in range(i, n):
            entry = forgetting_rate * P[i * n + j] - work[i] * work[j] / m_squared
            P_rate[i * n + j] = entry
            P_rate[j * n + i] = entry


@register_jitable
def continuous_update(theta, P, phi, z, n, h, forgetting_rate, normalised, bound, enable, work):
    """A step h of (A5)-(A7) by Bogacki and Shampine, phi and z held over it; returns (y, S).

    y = z - theta . phi and S = 1 + phi' P phi, both before the step. As in (A6), P moves only
    while ||P|| <= `bound`, or where the step makes it smaller. `work` has n + 4 (n + n*n)
    numbers.
    """
    y, S = continuous_step(theta, P, phi, z, n, h, forgetting_rate, normalised, work)
    continuous_correction(theta, P, n, h, bound, enable, work)
    return y, S


@register_jitable
def continuous_step(theta, P, phi, z, n, h, forgetting_rate, normalised, work):
    """The part of `continuous_update` that changes nothing: its rates go into `work`, from 2 n + n*n on."""
    m = n + n * n
    product = work[:n]
    slope = work[n : n + m]
    total = work[n + m : n + 2 * m]
    stage = work[n + 2 * m : n + 3 * m]
    y = z - predicted_output(theta, phi, n)
    S = 1.0 + covariance_times(P, phi, n, product)
    for i in range(m):
        slope[i] = 0.0
        total[i] = 0.0
    for k in range(3):
        for i in range(n):
            stage[i] = theta[i] + NODES[k] * h * slope[i]
        for i in range(n * n):
            stage[n + i] = P[i] + NODES[k] * h * slope[n + i]
        continuous_rates(
            stage[:n], stage[n:m], phi, z, n, forgetting_rate, normalised, slope[:n], slope[n:m], product
        )
        for i in range(m):
            total[i] = total[i] + WEIGHTS[k] * slope[i]
    return y, S


@register_jitable
def continuous_is_safe(P, phi, n, y, S, h, work):
    """Whether a `continuous_step` moves nothing beyond all measure, as `is_safe`, and is stable.

    A step that is too long for the gain, as without the normalisation it can be, would leave more of the
    innovation than there was, and the next one more than that.
    """
    m = n + n * n
    total = work[n + m : n + 2 * m]
    reach = (y * y + S * S) + trace(P, n) * TRACE_WEIGHT
    for i in range(m):
        reach = reach + h * total[i] * (h * total[i])
    left = y - h * predicted_output(total, phi, n)
    stable = np.abs(left) <= UNSTABLE * np.abs(y)
    return is_covariance(P, n) and stable and reach < LARGEST


@register_jitable
def continuous_correction(theta, P, n, h, bound, enable, work):
    """The part of `continuous_update` that moves theta and P, by the rates in `work`."""
    m = n + n * n
    total = work[n + m : n + 2 * m]
    size = trace(P, n)
    growth = h * trace(total[n:m], n)
    within = np.fmin((size + growth <= bound) * 1.0 + (growth <= 0.0) * 1.0, 1.0) * enable
    for i in range(n):
        theta[i] = theta[i] + enable * h * total[i]
    for i in range(n * n):
        P[i] = P[i] + within * h * total[n + i]


@unrolled
def directional_update(theta, P, phi, z, n, forgetting, R, bound, enable, work):
    """One sample that forgets only along the present regressor; returns (y, S).

    R. Kulhavy, Restricted exponential forgetting in real-time identification, Automatica 23
    (1987) 589-600; in terms of the information matrix, L. Cao, H. Schwartz, Automatica 36 (2000)
    1725-1731. With q = phi' P phi and mu = `forgetting`: K = P phi/(R + q),
    P^-1 += (mu - (1 - mu) R/q) phi phi'/R. Along phi this is exponential forgetting, across it
    nothing is lost. `bound`, `enable` and `work` as in `discrete_update`.
    """
    y, q = innovation(theta, P, phi, z, n, work)
    S = directional_correction(theta, P, n, y, q, forgetting, R, bound, enable, work)
    return y, S


@unrolled
def directional_correction(theta, P, n, y, q, forgetting, R, bound, enable, work):
    """The part of `directional_update` behind `innovation`; returns S."""
    S = q + R
    lost = (1.0 - forgetting) * R
    told = (q > LEAST_TOLD) * 1.0
    shrink = told * (forgetting * q - lost) / (forgetting * S * (q + (1.0 - told)))
    size = 0.0
    removed = 0.0
    for i in range(n):
        theta[i] = theta[i] + enable * work[i] * y / S
        size = size + P[i * n + i]
        removed = removed + work[i] * work[i]
    within = np.fmin((size - removed * shrink <= bound) * 1.0 + (shrink >= 0.0) * 1.0, 1.0) * enable
    for i in range(n):
        for j in range(i, n):
            entry = P[i * n + j] - within * shrink * work[i] * work[j]
            P[i * n + j] = entry
            P[j * n + i] = entry
    return S


@unrolled
def variable_forgetting(y, quadratic, R, forgetting, least):
    """Forgetting factor from the innovation's energy: short where the model no longer fits.

    T. Fortescue, L. Kershenbaum, B. Ydstie, Implementation of self-tuning regulators with variable
    forgetting factors, Automatica 17 (1981) 831-835: mu = 1 - (1 - phi' K) y²/(N_0 R), N_0 the
    nominal memory in samples, 1/(1 - `forgetting`); never below `least`. `quadratic` = phi' P phi.
    """
    energy = y * y / (R + quadratic)
    return np.fmax(1.0 - energy * (1.0 - forgetting), least)


@unrolled
def cusum(total, value, drift):
    """One-sided cumulative sum of what exceeds `drift`, never below zero.

    E. Page, Continuous inspection schemes, Biometrika 41 (1954) 100-115; F. Gustafsson, Adaptive
    Filtering and Change Detection (2000), sec. 2.6.
    """
    return np.fmax(total + value - drift, 0.0)


@unrolled
def random_walk(variance, growth, ceiling):
    """P_ii after the parameter has walked: it grows by a constant as long as it is below a ceiling.

    L. Ljung, System Identification, 2nd ed. (1999), sec. 11.2, the Kalman filter's
    interpretation of recursive least squares. Unlike division by a forgetting factor this grows
    P by a constant: a direction without excitation is forgotten linearly and not
    exponentially.
    """
    return variance + growth * (variance < ceiling)


@unrolled
def propagate_error(C, phi, gain, filtered, n, pole, ratio, differenced, work):
    """Covariance C of the estimate's error after an update, under white noise before the filters.

    The error obeys d = (I - K phi') d + K e. White noise v of standard deviation `ratio` reaches e
    through a first-order low-pass of `pole`, which the gain K is passed through here instead
    (`filtered`, in place), and, where `differenced` is 1.0, as v_k - v_(k-1): of two
    successive gains only G = K_k - (I - K_k phi') K_(k-1) then counts. `work` has 3 n numbers.
    """
    product = work[:n]
    rest = work[n : 2 * n]
    fresh = work[2 * n : 3 * n]
    quadratic = covariance_times(C, phi, n, product)
    reach = predicted_output(filtered, phi, n)
    for i in range(n):
        rest[i] = product[i] - quadratic * gain[i]
        before = filtered[i]
        now = gain[i] + pole * (before - gain[i])
        filtered[i] = now
        fresh[i] = (now - differenced * (before - gain[i] * reach)) * ratio
    # (I - K phi') C (I - K phi')' + G G'
    for i in range(n):
        for j in range(i, n):
            entry = C[i * n + j] - gain[i] * product[j] - rest[i] * gain[j] + fresh[i] * fresh[j]
            C[i * n + j] = entry
            C[j * n + i] = entry


@unrolled
def above_floor(P, n, floor, work):
    """1.0 if every eigenvalue of P exceeds `floor`, else 0.0: Cholesky on P - floor I.

    Exact for the price of n³/6 products; `work` has n*n numbers.
    """
    positive = 1.0
    for j in range(n):
        pivot = P[j * n + j] - floor
        for k in range(j):
            pivot = pivot - work[j * n + k] * work[j * n + k]
        positive = positive * (pivot > 0.0)
        # A pivot that failed still needs a finite root for the columns after it.
        root = np.sqrt(np.fmax(pivot, 1e-300))
        work[j * n + j] = root
        for i in range(j + 1, n):
            entry = P[i * n + j]
            for k in range(j):
                entry = entry - work[i * n + k] * work[j * n + k]
            work[i * n + j] = entry / root
    return positive


@unrolled
def add_covariance(P, P_0, n):
    """Say that a change was seen: P += P_0, the start's uncertainty on top of the present one.

    F. Gustafsson, Adaptive Filtering and Change Detection (2000), sec. 5.1.
    """
    for i in range(n * n):
        P[i] = P[i] + P_0[i]


@unrolled
def restore_covariance(P, P_0, n):
    """Covariance resetting: P = P_0 (Ioannou and Sun, sec. 4.3.6)."""
    for i in range(n * n):
        P[i] = P_0[i]
