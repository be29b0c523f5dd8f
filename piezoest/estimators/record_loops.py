"""What compiled loops over records keep of a sample.

Such a loop has the signature `piezoest._jit.RUN_TYPES`.
"""

from __future__ import annotations

from typing import Any

from piezoest._jit import unrolled


@unrolled
def keep_outcome(
    row: int, innovation: Any, variance: Any, covariance: Any, n: int, y: Any, S: Any, P: Any
) -> None:
    """Write what an update says into the histories that have room; `covariance` is flat, of n by n."""
    if y.size > 0:
        y[row] = innovation
    if S.size > 0:
        S[row] = variance
    if P.size > 0:
        for i in range(n * n):
            P[row, i] = covariance[i]
