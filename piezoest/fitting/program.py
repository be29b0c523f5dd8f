"""Bounded least squares with a penalty: one convex program, solved by CasADi and checked by SciPy."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.rows import dot, gram, onto
from piezoest.symbolic import quadratic_program

# Least curvature relative to a column's own: what a record does not tell stays near zero.
RIDGE = 1e-9


class Sums(NamedTuple):
    """Sums over rows: columns times columns (n, n), columns times x (n,), x times x, and how many rows."""

    gram: FloatArray
    moment: FloatArray
    square: float
    rows: float

    @classmethod
    def of(cls, columns: FloatArray, x: FloatArray) -> Self:
        """Sums over rows of a matrix (N, n) and what they are to give (N,)."""
        return cls(gram(columns), onto(columns, x), dot(x, x), float(x.size))

    @classmethod
    def none(cls, columns: int) -> Self:
        """Sums over no rows."""
        return cls(np.zeros((columns, columns)), np.zeros(columns), 0.0, 0.0)

    def plus(self, other: Sums, sign: float = 1.0) -> Self:
        """Both, or without the other's rows."""
        return type(self)(
            self.gram + sign * other.gram,
            self.moment + sign * other.moment,
            self.square + sign * other.square,
            self.rows + sign * other.rows,
        )

    def only(self, used: Any) -> Self:
        """Sums of some of the columns."""
        return self._replace(gram=self.gram[np.ix_(used, used)], moment=self.moment[used])

    def through(self, transform: FloatArray) -> Self:
        """Sums of other columns, each a combination (n, m) of these."""
        gram = transform.T @ self.gram @ transform
        return self._replace(gram=gram, moment=transform.T @ self.moment)

    def combined(self, size: int, transform: FloatArray) -> Self:
        """Sums where the first `size` columns are combined by (size, m), and the others stay."""
        rest = self.moment.size - size
        T = np.zeros((self.moment.size, transform.shape[1] + rest))
        T[:size, : transform.shape[1]] = transform
        T[size:, transform.shape[1] :] = np.eye(rest)
        return self.through(T)

    def missed(self, w: FloatArray) -> float:
        """Sum of squares that coefficients (n,) leave."""
        return max(self.square - 2.0 * float(self.moment @ w) + float(w @ self.gram @ w), 0.0)


def total(sums: list[Sums]) -> Sums:
    """All of them together."""
    found = Sums.none(sums[0].moment.size)
    for each in sums:
        found = found.plus(each)
    return found


def solve(
    sums: Sums, lower: FloatArray, penalty: FloatArray, upper: Any = np.inf, ridge: float = RIDGE
) -> FloatArray:
    """Coefficients (n,) that miss least, plus w' penalty w per row, between `lower` and `upper`."""
    scale, H, g = _scaled(sums, penalty, ridge)
    return quadratic_program(H, g, lower * scale, upper * scale) / scale


def checked(sums: Sums, lower: FloatArray, penalty: FloatArray, w: FloatArray, upper: Any = np.inf) -> float:
    """How much less SciPy's bounded least squares leaves than `w` does, relative to what x has."""
    from scipy.optimize import lsq_linear

    scale, H, g = _scaled(sums, penalty)
    L = np.linalg.cholesky(H)
    other = lsq_linear(L.T, np.linalg.solve(L, g), (lower * scale, upper * scale), method="bvls").x

    def cost(v: FloatArray) -> float:
        return float(0.5 * v @ H @ v - g @ v)

    return abs(cost(w * scale) - cost(other)) / max(sums.square / max(sums.rows, 1.0), 1e-300)


def _scaled(
    sums: Sums, penalty: FloatArray, ridge: float = RIDGE
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit of each column, then Hessian and gradient in these units, per row."""
    rows = max(sums.rows, 1.0)
    own = np.diag(sums.gram) / rows
    scale = np.sqrt(np.where(own > 0.0, own, 1.0))
    H = (sums.gram / rows + penalty) / np.outer(scale, scale)
    H[np.diag_indices_from(H)] += ridge
    return scale, H, sums.moment / rows / scale
