"""The output-error fit: a model runs free over a record, and its parameters make it miss least.

One residual, one Jacobian and one covariance, for `BatchFit` (a whole record), `MovingHorizon` (a sliding
window) and `identify` (a log, with a delay). What depends on the model is in `piezoest.models`, behind
`FreeRunning`. L. Ljung, System Identification, 2nd ed. (1999), ch. 7, 9 and 10; the solver is scipy's
trust-region reflective method.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.estimators.coordinates import Coordinates, late
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import FreeRunning
from piezoest.symbolic import Pass

# Residuals beyond so many standard deviations count less: 95 % efficiency on Gaussian noise.
# P. J. Huber, Robust Statistics (1981); W. J. J. Rey, Introduction to Robust Methods (1983).
TUNING: dict[str, float] = {"linear": 1.0, "huber": 1.345, "soft_l1": 1.345, "cauchy": 2.385}
# A robust fit is repeated until its scale, taken from the residual, changes by less.
SCALE_CHANGE, SCALE_ROUNDS = 0.02, 5
# Least scale of a robust loss, relative to the displacement's range: a record without noise has none.
LEAST_SCALE = 1e-9
# Changes of cost and parameters at which a fit has ended; a standard error is far above them.
TOLERANCE = 1e-10
# Smallest eigenvalue of a scaled information matrix; below it, rounding. Nothing is known of a parameter
# that moves nothing: its standard deviation, in its own unit.
LEAST_INFORMATION = 1e-14
UNKNOWN = 1e6
# Blocks over which the gradients of a coloured residual are summed.
BLOCKS = 25
# Step of the derivative by the delay: averages over the corners of the linear interpolation.
DELAY_STEP = 1e-4


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

    `u` (N,): voltage [V], without gaps. `x` (N,): measured displacement [µm], NaN where it is missing.
    `held`: values of the coordinates' held parameters. `decays`: factors exp(-dt/tau_i) of the creep terms.
    `root_weight` (N,): each sample's reciprocal standard deviation, up to a common factor. `prior`: knowledge
    of the coordinates beside the record. `limits`: narrower bounds of coordinates by name.
    """

    def __init__(
        self,
        u: FloatArray,
        x: FloatArray,
        coordinates: Coordinates,
        held: FloatArray,
        decays: FloatArray | None = None,
        root_weight: FloatArray | None = None,
        prior: Prior | None = None,
        limits: Mapping[str, tuple[float, float]] = {},
    ) -> None:
        known = np.isfinite(x)
        self.u, self.x = u, np.where(known, x, 0.0)
        self.weight = known * (1.0 if root_weight is None else root_weight)
        self.measured: Any = self.weight > 0.0
        self.coordinates, self.held, self.prior = coordinates, held, prior
        self.decays = np.empty(0) if decays is None else decays
        self._limits = limits
        self._q: bytes | None = None
        self._reduced: tuple[bytes, Any] = (b"", None)
        self._run: tuple[Pass, FloatArray]
        self._last: tuple[FloatArray, FloatArray]

    def simulate(self, q: FloatArray) -> tuple[Pass, FloatArray]:
        """Pass over the whole record, and the derivative of (p, s) by q."""
        self.evaluate(q)
        return self._run

    def pass_over(self, q: FloatArray, samples: int | None = None) -> tuple[Pass, FloatArray]:
        """The same over the first so many samples, not kept."""
        v, by_q, _, _ = self.coordinates(q, self.held)
        simulation = self.coordinates.simulation
        p, s, u, slope = v[: simulation.n_p], v[simulation.n_p :], self.u, None
        if self.coordinates.delayed:
            delay, p[-1] = float(p[-1]), 0.0
            step = DELAY_STEP * max(1.0, delay)
            slope = (late(u, delay + step) - late(u, delay - step)) / (2.0 * step)
            u = late(u, delay)
        return simulation.run(u[:samples], p, s, self.decays, slope=slope), by_q

    def evaluate(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residual (model - measured), the prior's below it, and its Jacobian by q."""
        if q.tobytes() != self._q:
            run, by_q = self.pass_over(q)
            residual = (run.x - self.x) * self.weight
            jacobian = run.jacobian @ by_q
            jacobian *= self.weight[:, None]
            if self.prior is not None:
                residual = np.concatenate([residual, self.prior.root @ (q - self.prior.mean)])
                jacobian = np.concatenate([jacobian, self.prior.root])
            self._run, self._last, self._q = (run, by_q), (residual, jacobian), q.tobytes()
        return self._last

    def reduced(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residual and Jacobian of as few rows as there are columns, with the same J^T J, J^T r and r^T r."""
        if self._reduced[0] != q.tobytes():
            residual, jacobian = self.evaluate(q)
            R: Any = np.linalg.qr(np.column_stack([jacobian, residual]), mode="r")
            self._reduced = q.tobytes(), (R[:, -1], R[:, :-1])
        return self._reduced[1]

    def bounds(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds of the coordinates about a start."""
        return self.coordinates.bounds(q, self._limits)

    def cost(self, q: FloatArray) -> float:
        """Half the sum of squares, infinite where the model is not finite."""
        value = 0.5 * float(np.sum(self.evaluate(q)[0] ** 2))
        return value if np.isfinite(value) else np.inf

    def settled(self, q: FloatArray) -> FloatArray:
        """`q` with the best of those coordinates in which x is linear, for the other ones, within bounds."""
        linear = self.coordinates.where(*self.coordinates.model.linear_coordinates)
        residual, jacobian = self.evaluate(q)
        better = q.copy()
        if linear and np.all(np.isfinite(jacobian)):
            better[linear] -= np.linalg.lstsq(jacobian[:, linear], residual, rcond=None)[0]
        return np.clip(better, *self.bounds(q))


def best_start(
    problem: Problem,
    sample_rate: float,
    given: FreeRunning | None = None,
    default: FreeRunning | None = None,
    others: Mapping[str, float] = {},
    **options: Any,
) -> FloatArray:
    """Coordinates to start from: the better of the derivative form's fit and of a first model.

    That is the given one, or one of the record's size, or the default where the record shows none; creep
    gains and delay start from `others`, by name. The options are for `HysteresisRLS`.
    """
    x = np.where(problem.measured, problem.x, np.nan)
    model = problem.coordinates.model
    first = given or model.guess(late(problem.u, others.get("delay", 0.0)), x) or default
    if first is None:
        raise ValueError("the record shows no displacement that rises with the voltage")
    models = [first]
    start: Any = first
    if model.has_derivative_form and not set(model.parameter_names) <= set(problem.coordinates.held):
        rls = HysteresisRLS(
            sample_rate, initial_model=start, memory=None, offset=True, uncertainty=1.0, **options
        )
        rls.run(problem.u, x, every=problem.u.size)
        models += [rls.model] if type(rls.model) is model else []
    starts = [problem.settled(problem.coordinates.of(each, others)) for each in models]
    return min(starts, key=problem.cost)


# ---------------------------------------------------------------- solving


def bend(loss: str, z: FloatArray) -> FloatArray:
    """Loss rho(z) of a squared residual z, with its first two derivatives, shape (3, N)."""
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
    return np.array([z, np.ones_like(z), np.zeros_like(z)])


def single_shooting(
    problem: Problem,
    start: FloatArray,
    loss: str,
    scale: float,
    max_iterations: int,
    tolerance: float = TOLERANCE,
) -> Solution:
    """Fit by least squares on the sensitivities of one pass over the record, from coordinates (n,).

    `loss` is one of `TUNING` and bends at residuals beyond `scale`; `max_iterations` passes over the record
    at most; `tolerance` is the relative change of cost and parameters at which the fit has ended.
    """
    from scipy.optimize import least_squares

    evaluate = problem.reduced if loss == "linear" else problem.evaluate
    try:
        found = least_squares(
            lambda q: evaluate(q)[0],
            start,
            jac=lambda q: evaluate(q)[1],
            bounds=problem.bounds(start),
            x_scale="jac",
            loss="linear" if loss == "linear" else partial(bend, loss),
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


def robust(
    problem: Problem, q: FloatArray, wanted: str, noise: float | None, solve: Callable[..., Solution]
) -> tuple[Solution, float]:
    """Fit and scale of a robust loss, in turn, until the scale is that of the fit's own residual."""
    floor = LEAST_SCALE * (float(np.ptp(problem.x[problem.measured])) or 1.0)
    evaluations, scale, fitted = 0, 0.0, ""
    # A loss that is not convex has false minima, and starts from the fit of one that is.
    for loss in ("soft_l1", *[wanted] * SCALE_ROUNDS):
        missed = np.abs(problem.evaluate(q)[0][problem.measured])
        sd = 1.4826 * float(np.median(missed)) if noise is None else noise
        last, scale = scale, TUNING[loss] * max(sd, floor)
        if fitted == wanted and abs(scale - last) < SCALE_CHANGE * scale:
            break
        fitted, solution = loss, solve(problem, q, loss, scale)
        q, evaluations = solution.q, evaluations + solution.evaluations
    return Solution(q, solution.success, solution.message, evaluations), scale


# ---------------------------------------------------------------- how far to trust it


@dataclass(frozen=True, slots=True)
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
    residual, whole = problem.evaluate(q)
    r = residual[problem.measured]
    lower, upper = problem.bounds(q)
    near = 1e-9 + 1e-5 * (np.where(np.isfinite(upper - lower), upper - lower, 0.0))
    free = (q - lower > near) & (upper - q > near)
    dof = max(1, r.size - int(np.count_nonzero(free)))
    rho = bend(loss, (r / scale) ** 2)
    slope = float(np.mean(rho[1] + 2.0 * rho[2] * (r / scale) ** 2))
    estimated = np.sqrt(float(np.sum((rho[1] * r) ** 2)) / dof) / max(abs(slope), 1e-12)
    noise = float(estimated if noise is None else noise)
    J = whole[problem.measured][:, free]
    inverse = inverse_information(J.T @ J)
    _, _, theta, T = problem.coordinates(q, problem.held)
    P = T[:, free] @ inverse @ T[:, free].T * noise**2
    if coloured:
        edges = np.linspace(0, r.size, BLOCKS + 1).astype(int)
        g = np.array([J[i:j].T @ r[i:j] for i, j in pairwise(edges)]) @ (T[:, free] @ inverse).T
        wide = np.sum(g**2, axis=0) * BLOCKS / (BLOCKS - J.shape[1])
        white = np.diag(P)
        widening = np.sqrt(np.maximum(wide / np.where(white > 0.0, white, np.inf), 1.0))
        P = P * np.outer(widening, widening)
    j = J[-1]
    names = problem.coordinates.free
    return Outcome(
        parameter_names=problem.coordinates.parameters,
        theta=theta,
        P=P,
        at_bound=tuple(name for name, inside in zip(names, free, strict=True) if not inside),
        noise=noise,
        residual=np.where(problem.measured, -residual[: problem.u.size], np.nan),
        last_covariance=T[:, free] @ (inverse @ j) * noise**2,
        last_variance=float(j @ inverse @ j) * noise**2,
    )


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
