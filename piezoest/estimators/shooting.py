"""Output-error fits: the model runs free over a record, and its parameters make it miss least.

Shared by `BatchFit` (whole record) and `MovingHorizon` (sliding window). L. Ljung, System
Identification, 2nd ed. (1999), ch. 7, 9 and 10; the solver is scipy's trust-region reflective method.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.estimators.coordinates import Coordinates
from piezoest.symbolic import Pass, simulation

# Residuals beyond so many standard deviations count less: 95 % efficiency on Gaussian noise.
# P. J. Huber, Robust Statistics (1981); W. J. J. Rey, Introduction to Robust Methods (1983).
TUNING: dict[str, float] = {"linear": 1.0, "huber": 1.345, "soft_l1": 1.345, "cauchy": 2.385}
# Changes of cost and parameters at which a fit has ended; a standard error is far above them.
TOLERANCE = 1e-10
# Smallest eigenvalue of a scaled information matrix; below it, rounding. Nothing is known of a parameter
# that moves nothing: its standard deviation, in its own unit.
LEAST_INFORMATION = 1e-14
UNKNOWN = 1e6


def bend(loss: str, z: FloatArray) -> FloatArray:
    """Loss rho(z) of a squared residual z, with its first two derivatives, shape (3, N)."""
    one = np.ones_like(z)
    if loss == "huber":
        far = np.maximum(z, 1.0)
        outside = z > 1.0
        rho = np.where(outside, 2.0 * np.sqrt(far) - 1.0, z)
        return np.array([rho, far**-0.5, np.where(outside, -0.5 * far**-1.5, 0.0)])
    if loss == "soft_l1":
        root = np.sqrt(1.0 + z)
        return np.array([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])
    if loss == "cauchy":
        return np.array([np.log1p(z), 1.0 / (1.0 + z), -1.0 / (1.0 + z) ** 2])
    return np.array([z, one, 0.0 * one])


class Prior(NamedTuple):
    """What is known before: root (q - mean) has unit covariance; shapes (n,), (n, n)."""

    mean: FloatArray
    root: FloatArray


class Solution(NamedTuple):
    """Where a fit ended; `message` is the solver's."""

    q: FloatArray
    success: bool
    message: str
    evaluations: int


class Problem:
    """A record and what of the model is to be fitted to it.

    Parameters
    ----------
    u : ndarray, shape (N,)
        Voltage [V], without gaps.
    x : ndarray, shape (N,)
        Measured displacement [µm], NaN where it is missing.
    coordinates : Coordinates
        What is varied.
    held : ndarray
        Values of the coordinates' held parameters.
    decays : ndarray
        Factors exp(-dt/tau_i) of the creep terms.
    root_weight : ndarray, shape (N,), optional
        Each sample's reciprocal standard deviation, up to a common factor.
    prior : Prior, optional
        Knowledge of the coordinates beside the record.
    """

    __slots__ = (
        "_last",
        "_q",
        "_run",
        "coordinates",
        "decays",
        "held",
        "measured",
        "prior",
        "simulation",
        "u",
        "weight",
        "x",
    )

    def __init__(
        self,
        u: FloatArray,
        x: FloatArray,
        coordinates: Coordinates,
        held: FloatArray,
        decays: FloatArray,
        root_weight: FloatArray | None = None,
        prior: Prior | None = None,
    ) -> None:
        known = np.isfinite(x)
        self.u, self.x = u, np.where(known, x, 0.0)
        self.weight = known * (1.0 if root_weight is None else root_weight)
        self.measured = int(np.count_nonzero(self.weight))
        self.coordinates, self.held, self.decays = coordinates, held, decays
        self.simulation = simulation(decays.size)
        self.prior = prior
        self._q: bytes | None = None
        self._run: tuple[Pass, FloatArray]
        self._last: tuple[FloatArray, FloatArray]

    def simulate(self, q: FloatArray) -> tuple[Pass, FloatArray]:
        """Pass over the whole record, and the derivative of (p, s) by q."""
        self.evaluate(q)
        return self._run

    def evaluate(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residual (model - measured), the prior's below it, and its Jacobian by q."""
        if q.tobytes() != self._q:
            v, by_q, _, _ = self.coordinates(q, self.held)
            n_p = self.simulation.n_p
            run = self.simulation.run(self.u, v[:n_p], v[n_p:], self.decays)
            residual = (run.x - self.x) * self.weight
            jacobian = run.jacobian @ by_q
            jacobian *= self.weight[:, None]
            if self.prior is not None:
                residual = np.concatenate([residual, self.prior.root @ (q - self.prior.mean)])
                jacobian = np.concatenate([jacobian, self.prior.root])
            self._run, self._last, self._q = (run, by_q), (residual, jacobian), q.tobytes()
        return self._last

    def cost(self, q: FloatArray) -> float:
        """Half the sum of squares, infinite where the model is not finite."""
        value = 0.5 * float(np.sum(self.evaluate(q)[0] ** 2))
        return value if np.isfinite(value) else np.inf

    def settled(self, q: FloatArray) -> FloatArray:
        """`q` with the best offset and start state for its other coordinates: x is linear in them."""
        names = self.coordinates.free
        linear = [i for i, name in enumerate(names) if name in ("offset", "initial_state")]
        residual, jacobian = self.evaluate(q)
        if not linear or not np.all(np.isfinite(jacobian)):
            return q
        better = q.copy()
        better[linear] -= np.linalg.lstsq(jacobian[:, linear], residual, rcond=None)[0]
        return better


def single_shooting(
    problem: Problem,
    start: FloatArray,
    loss: str,
    scale: float,
    max_iterations: int,
    tolerance: float = TOLERANCE,
) -> Solution:
    """Fit by least squares on the sensitivities of one pass over the record.

    Parameters
    ----------
    problem : Problem
        Record and coordinates.
    start : ndarray, shape (n,)
        Coordinates to start from.
    loss : str
        Of `TUNING`.
    scale : float
        Residual beyond which a robust loss bends.
    max_iterations : int
        Most passes over the record.
    tolerance : float
        Relative change of cost and parameters at which the fit has ended.
    """
    from scipy.optimize import least_squares

    try:
        found = least_squares(
            lambda q: problem.evaluate(q)[0],
            start,
            jac=lambda q: problem.evaluate(q)[1],
            bounds=problem.coordinates.bounds(start),
            x_scale="jac",
            loss="linear" if loss == "linear" else lambda z: bend(loss, z),
            f_scale=scale,
            ftol=tolerance,
            xtol=tolerance,
            gtol=tolerance,
            max_nfev=max_iterations,
        )
    except (ValueError, np.linalg.LinAlgError) as error:
        # Numbers of a size that no stage has; a stream goes on all the same.
        return Solution(start, False, str(error), 0)
    return Solution(found.x, bool(found.success), str(found.message), int(found.nfev))


def spread(residual: FloatArray) -> float:
    """Robust standard deviation: of the median of |residual|."""
    return 1.4826 * float(np.median(np.abs(residual))) if residual.size else 0.0


def covariance(
    problem: Problem, q: FloatArray, loss: str, scale: float, noise: float | None
) -> tuple[FloatArray, float, Any]:
    """Covariance of the coordinates (n, n), the noise's standard deviation, and which are at no bound.

    noise² (J^T J)^-1 from the information matrix; under a robust loss with psi its derivative,
    noise² = E[psi²]/E[psi']² (Huber 1981, sec. 7.6). Coordinates at a bound count as known; of one that
    the record does not tell the variance is large.
    """
    residual, jacobian = problem.evaluate(q)
    r = residual[: problem.u.size][problem.weight > 0.0]
    lower, upper = problem.coordinates.bounds(q)
    near = 1e-9 + 1e-5 * (np.where(np.isfinite(upper - lower), upper - lower, 0.0))
    free = (q - lower > near) & (upper - q > near)
    dof = max(1, r.size - int(np.count_nonzero(free)))
    rho = bend(loss, (r / scale) ** 2)
    slope = float(np.mean(rho[1] + 2.0 * rho[2] * (r / scale) ** 2))
    estimated = np.sqrt(float(np.sum((rho[1] * r) ** 2)) / dof) / max(abs(slope), 1e-12)
    sd = estimated if noise is None else noise
    sd, J = float(sd), jacobian[:, free]
    P = np.zeros((q.size, q.size))
    P[np.ix_(free, free)] = inverse_information(J.T @ J) * sd**2
    return P, sd, free


def inverse_information(information: FloatArray) -> FloatArray:
    """Inverse after scaling to a unit diagonal; large, not infinite, where nothing is known."""
    diagonal = np.diag(information)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = information / np.outer(scale, scale)
    blind = np.flatnonzero(diagonal <= 0.0)
    scaled[blind, blind] = UNKNOWN**-2
    values, vectors = np.linalg.eigh(scaled)
    values = np.fmax(values, LEAST_INFORMATION * values[-1:])
    P = (vectors / values) @ vectors.T / np.outer(scale, scale)
    return 0.5 * (P + P.T)
