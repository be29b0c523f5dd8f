"""The convex program against SciPy's bounded least squares, on rows and not on sums."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from piezoest.fitting.program import RIDGE, Sums, checked, solve
from piezoest.fitting.rows import FEW


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("penalties", [0, 5])
def test_solved_as_by_scipy_with_penalties_as_rows_more(seed: int, penalties: int) -> None:
    rng = np.random.default_rng(seed)
    n, count = int(rng.integers(1, 30)), FEW * (1 + seed % 3) + seed % 2
    A = rng.standard_normal((count, n)) * 10.0 ** rng.uniform(-2.0, 2.0, n)
    unit = np.std(A, axis=0)
    x = A @ (rng.standard_normal(n) / unit) + rng.standard_normal(count)
    lower = np.where(rng.random(n) < 0.3, -np.inf, rng.uniform(-0.5, 0.5, n) / unit)
    rows = rng.standard_normal((penalties, n)) / unit
    sums, penalty = Sums.of(A, x), rows.T @ rows
    w = solve(sums, lower, penalty)
    more = np.vstack([A, np.sqrt(count) * rows])
    best = lsq_linear(more, np.append(x, np.zeros(penalties)), (lower, np.inf), method="bvls", tol=1e-14).x
    np.testing.assert_allclose(w * unit, best * unit, atol=1e-6)
    if penalties == 0:
        assert checked(sums, lower, penalty, w) < 1e-10
    assert checked(sums, lower, penalty, w + 0.1 / unit) > 1e-6
    assert sums.missed(w) == pytest.approx(float(np.sum((x - A @ w) ** 2)), rel=1e-9)


def test_what_a_record_does_not_tell_stays_at_zero() -> None:
    A = np.random.default_rng(0).standard_normal((100, 4))
    A[:, 2], A[:, 3] = 0.0, A[:, 1]
    w = solve(Sums.of(A, A[:, 0] + A[:, 1]), np.zeros(4), np.zeros((4, 4)))
    # Of two columns that are alike, each has half.
    np.testing.assert_allclose(w, [1.0, 0.5, 0.0, 0.5], atol=100.0 * RIDGE)


def test_no_rounding_makes_what_is_missed_negative() -> None:
    A = np.random.default_rng(5).standard_normal((50, 2)) + 1e6
    assert Sums.of(A, A @ np.array([1.0, 2.0])).missed(np.array([1.0, 2.0])) >= 0.0
