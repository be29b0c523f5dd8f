"""Solvers through CasADi: IPOPT for nonlinear programs, and convex quadratic ones."""

import contextlib
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import casadi
import numpy as np

from piezoest._checks import FloatArray


class Evaluation(NamedTuple):
    """A nonlinear programme at one point.

    objective; gradient (n,); constraints (m,); constraint_jacobian (m, n); hessian (n, n), of the objective
    or what stands for it.
    """

    objective: float
    gradient: FloatArray
    constraints: FloatArray
    constraint_jacobian: FloatArray
    hessian: FloatArray


class Solution(NamedTuple):
    """Where a solver ended, its own words, and at how many points it was."""

    q: FloatArray
    success: bool
    message: str
    evaluations: int


def ipopt(
    evaluate: Callable[[FloatArray], Evaluation],
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    constraints: int,
    max_iterations: int,
    tolerance: float,
) -> Solution:
    """Minimise subject to bounds and constraints = 0, by IPOPT."""
    point = _Point(evaluate, start.size, constraints)
    q, none = casadi.MX.sym("q", start.size), casadi.MX.sym("p", 0)
    weight, multipliers = casadi.MX.sym("w"), casadi.MX.sym("l", constraints)
    f, gradient, g, jacobian, hessian = point(q)
    upper_half = weight * casadi.triu(hessian)
    problem: Any = {"x": q, "f": f, "g": g}
    options: Any = {
        "grad_f": casadi.Function("grad_f", [q, none], [f, gradient]),
        "jac_g": casadi.Function("jac_g", [q, none], [g, jacobian]),
        "hess_lag": casadi.Function("hess_lag", [q, none, weight, multipliers], [upper_half]),
        "print_time": False,
        "no_nlp_grad": True,
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "max_iter": max_iterations,
            "tol": tolerance,
            # Admissible means admissible: the bounds are not relaxed.
            "bound_relax_factor": 0.0,
        },
    }
    solver = casadi.nlpsol("solver", "ipopt", problem, options)
    solution = solver(x0=start, lbx=lower, ubx=upper, lbg=0.0, ubg=0.0)
    stats = solver.stats()
    return Solution(
        solution["x"].full()[:, 0],
        bool(stats["success"]),
        f"IPOPT: {stats['return_status']}",
        point.last.cache_info().misses,
    )


class _Point(casadi.Callback):
    """An `Evaluation` as a CasADi Function of q; the last is kept: IPOPT asks for its parts one by one."""

    def __init__(self, evaluate: Callable[[FloatArray], Evaluation], n: int, m: int) -> None:
        super().__init__()
        self.last = lru_cache(maxsize=1)(lambda q: evaluate(np.frombuffer(q)))
        self._inputs, self._outputs = n, ((1, 1), (n, 1), (m, 1), (m, n), (n, n))
        self.construct("point", {})

    def get_n_out(self) -> int:
        return len(self._outputs)

    def get_sparsity_in(self, i: int) -> Any:
        return casadi.Sparsity.dense(self._inputs, 1)

    def get_sparsity_out(self, i: int) -> Any:
        return casadi.Sparsity.dense(*self._outputs[i])

    def eval(self, arguments: Any) -> list[Any]:
        return [casadi.DM(value) for value in self.last(arguments[0].full()[:, 0].tobytes())]


# Solvers of convex programs, the fastest first; which of them there are depends on how CasADi was built.
QUADRATIC: dict[str, dict[str, Any]] = {
    "daqp": {},
    "qpoases": {"printLevel": "none", "sparse": False},
    "qrqp": {"print_iter": False},
}


@lru_cache(maxsize=1)
def quadratic_solver() -> str:
    """Name of the solver of convex programs that is used."""
    return next(name for name in QUADRATIC if casadi.has_conic(name))


@lru_cache(maxsize=64)
def _conic(size: int) -> Any:
    name = quadratic_solver()
    shapes = {"h": casadi.Sparsity.dense(size, size), "a": casadi.Sparsity(0, size)}
    return casadi.conic("program", name, shapes, QUADRATIC[name])


def quadratic_program(H: FloatArray, g: FloatArray, lower: FloatArray, upper: Any = np.inf) -> FloatArray:
    """Minimum of w' H w / 2 - g' w over lower <= w <= upper; LinAlgError if the solver finds none."""
    if np.isfinite(H).all() and np.isfinite(g).all():
        with contextlib.suppress(RuntimeError):
            found = _conic(g.size)(h=casadi.DM(H), g=-g, lbx=lower, ubx=upper)["x"].full()[:, 0]
            if np.isfinite(found).all():
                return np.clip(found, lower, upper)
    raise np.linalg.LinAlgError(
        "a program is not convex, or its numbers are too large: no solver ends; check the units of the record"
    )
