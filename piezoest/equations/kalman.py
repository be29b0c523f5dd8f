"""The extended Kalman filter's steps for a joint state of one hysteresis and its parameters.

D. Simon, Optimal State Estimation (2006), sec. 13.2 and 5.3. The state is s = (w_h, a, b, c) or
(w_h, a, b, c, offset): parameters are constant but for process noise, so that only the
first row of the transition's Jacobian differs from the identity. A covariance P is updated in place and
kept exactly symmetric.
"""

import numpy as np

from piezoest.compile import inlined, like
from piezoest.equations.least_squares import covariance_times, predicted_output

# The square of an innovation and its variance must stay below the first; beyond the second a variance has
# wound up.
LARGEST, LARGEST_TRACE = 1e200, 1e60


@inlined
def bilinear_variance(P, du, a):
    """Variance of second order that the product a w_h adds to w_h over du.

    With errors of a and w_h of covariance P, -a w_h |u'| (3) has the variance of a product of
    Gaussians, P_aa P_ww + P_aw². That error keeps its sign while the voltage travels about
    1/a, so that it adds up as a random walk of |du|/a times its variance. Without this term
    the covariance after a start from wrong parameters is too small by orders of magnitude
    (tests/estimators/test_consistency.py). The product's mean, P_aw |u'|, is left out: on a stage
    that is not the model it feeds back through P and biases the estimate.
    """
    distance = np.abs(du)
    return (P[1, 1] * P[0, 0] + P[0, 1] * P[0, 1]) * distance / (np.abs(a) + (a == 0.0))


@inlined
def predict_covariance(P, row, m, q):
    """P = F P F' + diag(q), where F is the identity except for the first m numbers of its first `row`."""
    n = len(row)
    first = like(row)
    for j in range(n):
        total = row[0] * P[0, j]
        for i in range(1, m):
            total = total + row[i] * P[i, j]
        first[j] = total
    corner = first[0] * row[0]
    for j in range(1, m):
        corner = corner + first[j] * row[j]
    for j in range(1, n):
        P[0, j] = first[j]
        P[j, 0] = first[j]
    P[0, 0] = corner
    for i in range(n):
        P[i, i] = P[i, i] + q[i]


@inlined
def innovation_variance(P, h, R, product):
    """S = h P h' + R; `product` (n,) receives P h'."""
    n = len(h)
    S = R + 0.0
    for i in range(n):
        total = P[i, 0] * h[0]
        for j in range(1, n):
            total = total + P[i, j] * h[j]
        product[i] = total  # of P h', which is h P
        S = S + h[i] * total
    return S


@inlined
def is_safe(y, S):
    """Whether an update by the innovation y of variance S gives reasonable numbers.

    Asked before the update, as `least_squares.is_safe`: NaN or infinity anywhere in the state, P, h or the
    measurement ends up in one of these numbers.
    """
    return S > 0.0 and y * y + S < LARGEST


@inlined
def is_covariance(P):
    """Whether all variances of P are valid and the first one, which can grow without limit, is finite."""
    least = P[0, 0]
    for i in range(1, len(P)):
        least = min(least, P[i, i])
    return least >= 0.0 and P[0, 0] < LARGEST_TRACE


@inlined
def correct(s, P, h, y, R, S, gain, product):
    """Measurement update, after `innovation_variance`, which left P h' in `product`.

    K = P h'/S, s += K y, and Joseph's form of the covariance, (I - K h) P (I - K h)' + K R K', row by row so
    that P stays symmetric. `gain` (n,) receives K.
    """
    n = len(s)
    rest = like(s)
    each = 1.0 / S
    for i in range(n):
        gain[i] = product[i] * each
        s[i] = s[i] + gain[i] * y
    # (I - K h) P h' - R K
    for i in range(n):
        total = (P[i, 0] - gain[i] * product[0]) * h[0]
        for j in range(1, n):
            total = total + (P[i, j] - gain[i] * product[j]) * h[j]
        rest[i] = total - R * gain[i]
    for i in range(n):
        for j in range(i, n):
            entry = P[i, j] - gain[i] * product[j] - rest[i] * gain[j]
            P[i, j] = entry
            P[j, i] = entry


@inlined
def project(s, P, g, least):
    """Move s to the nearest point with g . s >= least in the metric of P; P is not changed.

    D. Simon, IET Control Theory Appl. 4 (2010) 1303-1318, sec. 2.3. Returns 1.0 if it moved.
    """
    product = like(s)
    lack = least - predicted_output(s, g)
    outside = (lack > 0.0) * 1.0
    norm = covariance_times(P, g, product)
    # A norm that has underflown has no direction to go in: whoever asks clamps what is left over.
    reached = (norm * LARGEST_TRACE > np.abs(lack)) * outside
    for i in range(len(s)):
        s[i] = s[i] + reached * product[i] * lack / (norm + (norm == 0.0))
    return outside
