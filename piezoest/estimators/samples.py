"""What becomes of a sample: its code in the state, and what loops over records keep of it."""

from typing import Any

from piezoest.compile import inlined
from piezoest.layout import whole

WAITING, UPDATED, MISSING, HELD, REJECTED = 0.0, 1.0, 2.0, 3.0, 4.0
NAMES = ("waiting", "updated", "missing", "held", "rejected")
OUTCOME = whole(WAITING, REJECTED)


@inlined
def keep_outcome(row: int, innovation: Any, variance: Any, covariance: Any, y: Any, S: Any, P: Any) -> None:
    """Write what an update says into the histories that have room; a row of P is a covariance."""
    if y.size > 0:
        y[row] = innovation
    if S.size > 0:
        S[row] = variance
    if P.size > 0:
        n = len(covariance)
        for i in range(n):
            for j in range(n):
                P[row, i * n + j] = covariance[i, j]
