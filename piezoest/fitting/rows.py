"""Products with many rows of few columns, without threads.

A threaded BLAS gains nothing in them, and on a computer that is busy with something else its threads wait for
each other: fits took twenty times as long. Nor does the last bit depend on how many threads there are.
"""

import numpy as np

from piezoest._checks import FloatArray

# A product of so few rows is too small for threads.
FEW = 64


def gram(rows: FloatArray) -> FloatArray:
    """Columns times columns (n, n) of rows (N, n)."""
    return across(rows, rows)


def across(rows: FloatArray, others: FloatArray) -> FloatArray:
    """Columns of rows (N, m) times columns of others (N, n), shape (m, n)."""
    whole = rows.shape[0] // FEW * FEW
    a, b = (each[:whole].reshape(-1, FEW, each.shape[1]) for each in (rows, others))
    found = np.matmul(a.transpose(0, 2, 1), b).sum(axis=0)
    return np.asarray(found + rows[whole:].T @ others[whole:])


def onto(rows: FloatArray, x: FloatArray) -> FloatArray:
    """Columns times x (N,), shape (n,)."""
    return np.asarray(np.einsum("ij,i->j", rows, x))


def times(rows: FloatArray, w: FloatArray) -> FloatArray:
    """Rows times coefficients (n,), shape (N,)."""
    return np.asarray(np.einsum("ij,j->i", rows, w))


def dot(a: FloatArray, b: FloatArray) -> float:
    """Sum of products of (N,) and (N,)."""
    return float(np.einsum("i,i->", a, b))
