"""Arrival cost of a sliding window: what is known from the samples that have left it.

C. V. Rao, J. B. Rawlings, D. Q. Mayne, Constrained state estimation for nonlinear discrete-time systems,
IEEE Trans. Autom. Control 48 (2003) 246-258; here the Gauss-Newton posterior of those samples.
"""

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.outcome import inverse_information
from piezoest.fitting.problem import Prior, Problem

# Keeps a correlation matrix positive definite that rounding would not, and the squares of its root in range.
JITTER = 1e-9


def arrival_cost(problem: Problem, q: FloatArray, k: int, walk: FloatArray) -> tuple[FloatArray, Prior]:
    """Coordinates and prior of the window that starts at point k of this one."""
    _, sums = problem.about(q, samples=k)
    covariance = inverse_information(sums.gram)
    step = covariance @ sums.moment
    G, follower = np.eye(q.size), q.copy()
    if state := problem.coordinates.where(*problem.coordinates.model.state_names):
        # The states at point k, which the next window starts from.
        run, by_q = problem.pass_over(q, k + 1)
        follower[state], G[state] = run.end, run.end_jacobian @ by_q
    covariance = G @ covariance @ G.T + np.diag(walk**2)
    scale = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(scale, scale) + JITTER * np.eye(q.size)
    root = np.linalg.inv(np.linalg.cholesky(correlation)) / scale
    return follower, Prior(follower + G @ step, root)
