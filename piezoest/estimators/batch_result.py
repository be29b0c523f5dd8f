"""Outcome of `BatchFit`."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from piezoest._checks import FloatArray
from piezoest.estimators.shooting import Problem, Solution, covariance
from piezoest.models import ColemanHodgdon, Creep, LinearGain


@dataclass(frozen=True, slots=True)
class BatchFitResult:
    """Outcome of an output-error fit.

    Parameters
    ----------
    model : ColemanHodgdon or LinearGain
        The admissible model that misses the record least.
    parameter_names : tuple of str
        Names of the entries of `theta`: alpha, beta, gamma (or gain), offset, initial_state,
        creep_gains[0], …
    theta : ndarray, shape (n,)
        All parameters, held ones too.
    P : ndarray, shape (n, n)
        Covariance of `theta` from the information matrix; zero for parameters that were held or
        ended at a bound, very large if the record does not tell the parameters apart.
    at_bound : tuple of str
        Coordinates that ended at the edge of the admissible set; ``"ratio"`` is gamma/(alpha beta),
        between 1 and 2.
    creep : Creep or None
        Creep with the fitted gains.
    noise : float
        Standard deviation of the residual [µm], corrected for the number of parameters.
    residual : ndarray, shape (N,)
        Measured less simulated displacement [µm]; NaN where a sample is missing.
    success : bool
        Whether the solver converged. If not, the parameters are the best it came by.
    message : str
        The solver's own words.
    evaluations : int
        Passes over the record that the solver took.
    seconds : float
        Time that the fit took.
    method : str
        ``"single-shooting"`` or ``"multiple-shooting"``.
    """

    model: ColemanHodgdon | LinearGain
    parameter_names: tuple[str, ...]
    theta: FloatArray
    P: FloatArray = field(repr=False)
    at_bound: tuple[str, ...]
    creep: Creep | None
    noise: float
    residual: FloatArray = field(repr=False)
    success: bool
    message: str
    evaluations: int
    seconds: float
    method: str
    # With j the derivative of the last measured output by the coordinates q: T P_q j, theta's
    # covariance with that output, and j P_q j, the output's variance.
    _last: tuple[FloatArray, float] = field(repr=False, default=(np.empty(0), 0.0))

    @property
    def standard_errors(self) -> FloatArray:
        """Square roots of the diagonal of `P`, shape (n,)."""
        return np.sqrt(np.diag(self.P))

    @property
    def initial_state(self) -> float:
        """w_h at the first sample [µm]; 0 for a linear gain."""
        return self._value("initial_state")

    def _value(self, name: str) -> float:
        return float(self.theta[self.parameter_names.index(name)]) if name in self.parameter_names else 0.0


def report(
    problem: Problem,
    solution: Solution,
    kind: type[ColemanHodgdon] | type[LinearGain],
    creep: Creep | None,
    loss: str,
    scale: float,
    noise: float | None,
    method: str,
    began: float,
) -> BatchFitResult:
    """Model, covariance and residual of a solution.

    Parameters
    ----------
    problem, solution : Problem, Solution
        What was solved, and where the solver ended.
    kind : type
        Class of the model.
    creep : Creep or None
        Creep terms whose gains were fitted.
    loss, scale : str, float
        Loss, and the residual beyond which it bends.
    noise : float or None
        Standard deviation of the displacement's noise [µm], None to take the residual's.
    method : str
        For the record.
    began : float
        Time of the start, by ``time.perf_counter``.
    """
    q, coordinates = solution.q, problem.coordinates
    P, noise, inside = covariance(problem, q, loss, scale, noise)
    _, _, theta, T = coordinates(q, problem.held)
    residual, jacobian = problem.evaluate(q)
    measured = problem.weight > 0.0
    value = dict(zip(coordinates.parameters, theta, strict=True))
    if creep is not None:
        gains = [value[f"creep_gains[{i}]"] for i in range(creep.gains.size)]
        creep = Creep(gains, creep.time_constants)
    j = jacobian[np.flatnonzero(measured)[-1]]
    return BatchFitResult(
        model=kind.from_theta(theta[: len(kind.parameter_names)], value["offset"]),
        parameter_names=coordinates.parameters,
        theta=theta,
        P=T @ P @ T.T,
        at_bound=tuple(name for name, free in zip(coordinates.free, inside, strict=True) if not free),
        creep=creep,
        noise=noise,
        residual=np.where(measured, -residual, np.nan),
        success=solution.success,
        message=solution.message,
        evaluations=solution.evaluations,
        seconds=time.perf_counter() - began,
        method=method,
        _last=(T @ (P @ j), float(j @ P @ j)),
    )
