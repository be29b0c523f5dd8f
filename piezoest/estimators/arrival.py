"""Arrival cost of a sliding window: what the samples that left it told.

C. V. Rao, J. B. Rawlings, D. Q. Mayne, Constrained state estimation for nonlinear discrete-time systems,
IEEE Trans. Autom. Control 48 (2003) 246-258; here the Gauss-Newton posterior of those samples.
"""

from __future__ import annotations

import numpy as np

from piezoest._checks import FloatArray
from piezoest.estimators.shooting import Prior, Problem, inverse_information

# Keeps a correlation matrix positive definite that rounding would not.
JITTER = 1e-12


def moved_on(problem: Problem, q: FloatArray, k: int, walk: FloatArray) -> tuple[FloatArray, Prior]:
    """Coordinates and prior of the window that starts at point k of this one.

    Parameters
    ----------
    problem : Problem
        The window, with its prior.
    q : ndarray, shape (n,)
        Coordinates to linearise about.
    k : int
        Points before this one leave the window.
    walk : ndarray, shape (n,)
        Standard deviation of the coordinates' random walk meanwhile.
    """
    prior = problem.prior
    assert prior is not None
    residual, jacobian = problem.evaluate(q)
    J, r = jacobian[:k], residual[:k]
    covariance = inverse_information(prior.root.T @ prior.root + J.T @ J)
    step = -covariance @ (prior.root.T @ (prior.root @ (q - prior.mean)) + J.T @ r)
    G, follower = np.eye(q.size), q.copy()
    if "initial_state" in problem.coordinates.free:
        i = problem.coordinates.free.index("initial_state")
        follower[i], G[i] = _state_at(problem, q, k)
    covariance = G @ covariance @ G.T + np.diag(walk**2)
    scale = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(scale, scale) + JITTER * np.eye(q.size)
    root = np.linalg.inv(np.linalg.cholesky(correlation)) / scale
    return follower, Prior(follower + G @ step, root)


def _state_at(problem: Problem, q: FloatArray, k: int) -> tuple[float, FloatArray]:
    """w_h at point k, and its derivative by q: what the output has beside c u + offset."""
    run, by_q = problem.simulate(q)
    v, _, _, _ = problem.coordinates(q, problem.held)
    w_h = run.x[k] - v[2] * problem.u[k] - v[3]
    return float(w_h), run.jacobian[k] @ by_q - problem.u[k] * by_q[2] - by_q[3]
