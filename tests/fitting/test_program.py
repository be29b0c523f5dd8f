"""The convex program against SciPy and its own optimality conditions, and sums against dense algebra."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from piezoest._checks import FloatArray
from piezoest.fitting.program import RIDGE, Sums, checked, solve, total
from piezoest.fitting.rows import FEW, gram, onto, times
from piezoest.symbolic import quadratic_program

SEEDS = range(12)


def problem(seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Columns (N, n), what they are to give, and bounds, of which some are not there."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 30))
    columns = rng.standard_normal((200, n)) * 10.0 ** rng.uniform(-2.0, 2.0, n)
    x = columns @ (rng.standard_normal(n) / np.std(columns, axis=0)) + rng.standard_normal(200)
    lower = np.where(rng.random(n) < 0.3, -np.inf, rng.uniform(-0.5, 0.5, n) / np.std(columns, axis=0))
    return columns, x, lower


@pytest.mark.parametrize("seed", SEEDS)
def test_program_meets_its_optimality_conditions(seed: int) -> None:
    A, x, lower = problem(seed)
    A = A / np.std(A, axis=0)
    H, g = A.T @ A / 200.0, A.T @ x / 200.0
    w = quadratic_program(H, g, lower)
    gradient = H @ w - g
    at_bound = w - lower < 1e-9
    assert np.all(w >= lower)
    assert np.all(gradient[at_bound] > -1e-8)
    np.testing.assert_allclose(gradient[~at_bound], 0.0, atol=1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_solved_as_by_scipy(seed: int) -> None:
    A, x, lower = problem(seed)
    sums = Sums.of(A, x)
    w = solve(sums, lower, np.zeros((lower.size, lower.size)))
    expected = lsq_linear(A, x, (lower, np.inf), method="bvls", tol=1e-14).x
    np.testing.assert_allclose(w * np.std(A, axis=0), expected * np.std(A, axis=0), atol=1e-6)
    assert checked(sums, lower, np.zeros((lower.size, lower.size)), w) < 1e-10


def test_a_penalty_is_as_rows_more() -> None:
    A, x, lower = problem(1)
    rng = np.random.default_rng(1)
    rows = rng.standard_normal((5, A.shape[1])) / np.std(A, axis=0)
    w = solve(Sums.of(A, x), lower, rows.T @ rows)
    more = np.vstack([A, np.sqrt(200.0) * rows])
    expected = lsq_linear(more, np.append(x, np.zeros(5)), (lower, np.inf), method="bvls", tol=1e-14).x
    np.testing.assert_allclose(w * np.std(A, axis=0), expected * np.std(A, axis=0), atol=1e-6)


def test_what_a_record_does_not_tell_stays_at_zero() -> None:
    A = np.random.default_rng(0).standard_normal((100, 4))
    A[:, 2], A[:, 3] = 0.0, A[:, 1]
    w = solve(Sums.of(A, A[:, 0] + A[:, 1]), np.zeros(4), np.zeros((4, 4)))
    # Of two columns that are alike, each has half.
    np.testing.assert_allclose(w, [1.0, 0.5, 0.0, 0.5], atol=100.0 * RIDGE)


def test_a_worse_answer_is_seen() -> None:
    A, x, lower = problem(2)
    none = np.zeros((lower.size, lower.size))
    w = solve(Sums.of(A, x), lower, none)
    assert checked(Sums.of(A, x), lower, none, w + 0.1 / np.std(A, axis=0)) > 1e-6


def alike(one: Sums, other: Sums) -> None:
    for name in Sums._fields:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-10, atol=1e-10)


def test_sums_are_those_of_the_rows() -> None:
    rng = np.random.default_rng(3)
    A, x, w = rng.standard_normal((300, 6)), rng.standard_normal(300), rng.standard_normal(6)
    whole, parts = Sums.of(A, x), [Sums.of(A[k : k + 70], x[k : k + 70]) for k in range(0, 300, 70)]
    alike(total(parts), whole)
    alike(whole.plus(parts[0], -1.0), Sums.of(A[70:], x[70:]))
    for one in Sums.none(6).plus(whole), whole:
        assert one.missed(w) == pytest.approx(float(np.sum((x - A @ w) ** 2)), rel=1e-12)


def test_sums_of_combined_columns() -> None:
    rng = np.random.default_rng(4)
    A, x = rng.standard_normal((50, 6)), rng.standard_normal(50)
    T = rng.standard_normal((6, 2))
    alike(Sums.of(A, x).through(T), Sums.of(A @ T, x))
    few = rng.standard_normal((4, 2))
    combined = Sums.of(np.hstack([A[:, :4] @ few, A[:, 4:]]), x)
    alike(Sums.of(A, x).combined(4, few), combined)


def test_no_rounding_makes_what_is_missed_negative() -> None:
    A = np.random.default_rng(5).standard_normal((50, 2)) + 1e6
    assert Sums.of(A, A @ np.array([1.0, 2.0])).missed(np.array([1.0, 2.0])) >= 0.0


@pytest.mark.parametrize("count", [0, 1, FEW - 1, FEW, 3 * FEW + 5])
def test_products_of_rows(count: int) -> None:
    rng = np.random.default_rng(count)
    rows, x, w = rng.standard_normal((count, 5)), rng.standard_normal(count), rng.standard_normal(5)
    np.testing.assert_allclose(gram(rows), rows.T @ rows, atol=1e-12)
    np.testing.assert_allclose(onto(rows, x), rows.T @ x, atol=1e-12)
    np.testing.assert_allclose(times(rows, w), rows @ w, atol=1e-12)
