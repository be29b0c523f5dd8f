"""What the end of a nonlinear fit says of the parameters.

L. Ljung, System Identification, 2nd ed. (1999), ch. 9.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.losses import bend
from piezoest.fitting.problem import Problem
from piezoest.fitting.rows import onto

# Smallest eigenvalue of a scaled information matrix; below it, rounding. Nothing is known of a parameter
# that moves nothing: its standard deviation, in its own unit.
LEAST_INFORMATION = 1e-14
UNKNOWN = 1e6
# Blocks in time over which the gradients of a coloured residual are summed.
BLOCKS = 25


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a solution says of the parameters.

    Their names; theta (n,) and P (n, n) of all parameters, zero in P where one was held or ended at a bound;
    coordinates at a bound by name; noise's standard deviation [µm]; residual (N,), measured less simulated
    [µm], NaN where nothing was measured; and with j the derivative of the last measured output by the
    coordinates, theta's covariance with that output (n,) and the output's variance.
    """

    parameter_names: tuple[str, ...]
    theta: FloatArray
    P: FloatArray = field(repr=False)
    at_bound: tuple[str, ...]
    noise: float
    residual: FloatArray = field(repr=False)
    last_covariance: FloatArray = field(repr=False)
    last_variance: float

    @property
    def is_finite(self) -> bool:
        """Whether all of it is numbers."""
        noise = self.noise + self.last_variance
        return all(np.all(np.isfinite(each)) for each in (self.theta, self.P, self.last_covariance, noise))

    @property
    def value(self) -> dict[str, float]:
        """Parameters by their names."""
        return dict(zip(self.parameter_names, self.theta.tolist(), strict=True))

    @property
    def standard_errors(self) -> FloatArray:
        """Square roots of the diagonal of `P`, shape (n,)."""
        return np.sqrt(np.diag(self.P))


def outcome(
    problem: Problem,
    q: FloatArray,
    loss: str = "linear",
    scale: float = 1.0,
    noise: float | None = None,
    *,
    coloured: bool = False,
) -> Outcome:
    """Parameters and their covariance at the end of a fit without prior.

    noise² (J^T J)^-1 from the information matrix; under a robust loss with psi its derivative,
    noise² = E[psi²]/E[psi']² (Huber 1981, sec. 7.6). Coordinates at a bound count as known; of one that
    the record does not tell the variance is large.

    `noise` is the standard deviation of the displacement's [µm], without it the residual's. `coloured`
    widens P for a residual r that is not white: by the sandwich (J^T J)^-1 (sum over blocks of g g^T)
    (J^T J)^-1 with g = J^T r of one of `BLOCKS` blocks in time. White noise gives the usual formula in the
    mean; each variance is the larger of the two.
    """
    known, residual = np.flatnonzero(problem.measured), problem.residual(q)
    r = residual[known]
    lower, upper = problem.bounds(q)
    near = 1e-9 + 1e-5 * (np.where(np.isfinite(upper - lower), upper - lower, 0.0))
    free = (q - lower > near) & (upper - q > near)
    dof = max(1, r.size - int(np.count_nonzero(free)))
    rho = bend(loss, (r / scale) ** 2)
    slope = float(np.mean(rho[1] + 2.0 * rho[2] * (r / scale) ** 2))
    estimated = np.sqrt(float(np.sum((rho[1] * r) ** 2)) / dof) / max(abs(slope), 1e-12)
    noise = float(estimated if noise is None else noise)
    run, by_q = problem.simulate(q)
    inverse = inverse_information(problem.about(q)[1].gram[np.ix_(free, free)])
    _, _, theta, T = problem.coordinates(q, problem.held)
    P = T[:, free] @ inverse @ T[:, free].T * noise**2
    if coloured:
        edges = np.append(known[np.linspace(0, r.size, BLOCKS + 1).astype(int)[:-1]], residual.size)
        J = problem.left(run.jacobian * problem.weight[:, None])
        g = np.array([onto(J[i:j], residual[i:j]) for i, j in pairwise(edges)]) @ by_q[:, free]
        P = sandwich(g @ (T[:, free] @ inverse).T, np.diag(P), int(free.sum()))
    j = run.jacobian[known[-1]] @ by_q[:, free] * problem.weight[known[-1]]
    return Outcome(
        parameter_names=problem.coordinates.parameters,
        theta=theta,
        P=P,
        at_bound=tuple(
            name for name, inside in zip(problem.coordinates.free, free, strict=True) if not inside
        ),
        noise=noise,
        residual=np.where(problem.measured, residual, np.nan),
        last_covariance=T[:, free] @ (inverse @ j) * noise**2,
        last_variance=float(j @ inverse @ j) * noise**2,
    )


def sandwich(moved: FloatArray, white: FloatArray, lost: int) -> FloatArray:
    """Covariance (n, n) for a residual that is not white; no variance is below that of a white one.

    `moved` (BLOCKS, n): what each of the blocks in time, of which so many are lost to the fit, moves.
    """
    wide = moved.T @ moved * BLOCKS / (BLOCKS - lost)
    widening = np.sqrt(np.maximum(white / np.maximum(np.diag(wide), 1e-300), 1.0))
    return np.asarray(wide * np.outer(widening, widening))


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
