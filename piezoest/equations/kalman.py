"""The extended Kalman filter's steps for a joint state of one hysteresis and its parameters.

D. Simon, Optimal State Estimation (2006), sec. 13.2 and 5.3. The state is s = (w_h, a, b, c) or
(w_h, a, b, c, offset): parameters are constant but for process noise, so that only the
first row of the transition's Jacobian differs from the identity. A covariance P of n states
is a flat array of n*n numbers in row order, updated in place and kept exactly symmetric.
"""

from __future__ import annotations

import numpy as np

from piezoest._jit import unrolled

# The square of an innovation and its variance must stay below the first; beyond the second a variance has
# wound up.
LARGEST, LARGEST_TRACE = 1e200, 1e60


@unrolled
def bilinear_variance(P, du, a, n):
    """Variance that the product a w_h adds to w_h over du, beyond the filter's first order.

    With errors of a and w_h of covariance P, -a w_h |u'| (3) has the variance of a product of
    Gaussians, P_aa P_ww + P_aw². That error keeps its sign while the voltage travels about
    1/a, so that it adds up as a random walk of |du|/a times its variance. Without this term
    the covariance after a start from wrong parameters is too small by orders of magnitude
    (tests/estimators/test_consistency.py). The product's mean, P_aw |u'|, is left out: on a stage
    that is not the model it feeds back through P and biases the estimate.
    """
    distance = np.abs(du)
    return (P[n + 1] * P[0] + P[1] * P[1]) * distance / (np.abs(a) + (a == 0.0))


@unrolled
def predict_covariance(P, row, m, q, n, work):
    """P = F P F' + diag(q), F the identity but for the first m of its first `row`; `work` has n numbers."""
    for j in range(n):
        total = row[0] * P[j]
        for i in range(1, m):
            total = total + row[i] * P[i * n + j]
        work[j] = total
    corner = work[0] * row[0]
    for j in range(1, m):
        corner = corner + work[j] * row[j]
    for j in range(1, n):
        P[j] = work[j]
        P[j * n] = work[j]
    P[0] = corner
    for i in range(n):
        P[i * n + i] = P[i * n + i] + q[i]


@unrolled
def measure(s, h, n):
    """h . s: the predicted measurement of a linear measurement."""
    x = h[0] * s[0]
    for i in range(1, n):
        x = x + h[i] * s[i]
    return x


@unrolled
def update(s, P, h, y, R, n, gain, work):
    """Measurement update for one measurement; returns the innovation's variance S.

    S = h P h' + R, K = P h'/S, s += K y, and Joseph's form of the covariance,
    (I - K h) P (I - K h)' + K R K', row by row so that P stays symmetric. `gain` (n,)
    receives K; `work` has 2 n numbers.
    """
    S = innovation_variance(P, h, R, n, work)
    correct(s, P, h, y, R, S, n, gain, work)
    return S


@unrolled
def innovation_variance(P, h, R, n, work):
    """S = h P h' + R; `work` (n,) receives P h'."""
    S = R + 0.0
    for i in range(n):
        total = P[i * n] * h[0]
        for j in range(1, n):
            total = total + P[i * n + j] * h[j]
        work[i] = total  # of P h', which is h P
        S = S + h[i] * total
    return S


@unrolled
def is_safe(y, S):
    """Whether an update by the innovation y of variance S moves nothing beyond all measure.

    Asked before the update, as `least_squares.is_safe`: NaN or infinity anywhere in the state, P, h or the
    measurement ends up in one of these numbers.
    """
    return S > 0.0 and y * y + S < LARGEST


@unrolled
def is_covariance(P, n):
    """Whether no variance of P is lost, and the first, which alone can grow without end, is a number."""
    least = P[0]
    for i in range(1, n):
        least = min(least, P[i * n + i])
    return least >= 0.0 and P[0] < LARGEST_TRACE


@unrolled
def correct(s, P, h, y, R, S, n, gain, work):
    """The part of `update` behind `innovation_variance`."""
    each = 1.0 / S
    for i in range(n):
        gain[i] = work[i] * each
        s[i] = s[i] + gain[i] * y
    # (I - K h) P h' - R K
    for i in range(n):
        total = (P[i * n] - gain[i] * work[0]) * h[0]
        for j in range(1, n):
            total = total + (P[i * n + j] - gain[i] * work[j]) * h[j]
        work[n + i] = total - R * gain[i]
    for i in range(n):
        for j in range(i, n):
            entry = P[i * n + j] - gain[i] * work[j] - work[n + i] * gain[j]
            P[i * n + j] = entry
            P[j * n + i] = entry


@unrolled
def project(s, P, g, least, n, work):
    """Move s to the nearest point with g . s >= least in the metric of P; P is not changed.

    D. Simon, IET Control Theory Appl. 4 (2010) 1303-1318, sec. 2.3. Returns 1.0 if it moved.
    """
    lack = least - measure(s, g, n)
    outside = (lack > 0.0) * 1.0
    norm = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total = total + P[i * n + j] * g[j]
        work[i] = total
        norm = norm + g[i] * total
    # A norm that has underflown has no direction to go in: whoever asks clamps what is left over.
    told = (norm * LARGEST_TRACE > np.abs(lack)) * outside
    for i in range(n):
        s[i] = s[i] + told * work[i] * lack / (norm + (norm == 0.0))
    return outside
