"""Solvers through CasADi: IPOPT for nonlinear programs, and convex quadratic ones."""

from __future__ import annotations

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


class Minimum(NamedTuple):
    """Where IPOPT ended, and its own words."""

    z: FloatArray
    success: bool
    message: str
    iterations: int


def ipopt(
    evaluate: Callable[[FloatArray], Evaluation],
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    constraints: int,
    max_iterations: int,
    tolerance: float,
) -> Minimum:
    """Minimise subject to bounds and constraints = 0, by IPOPT.

    `evaluate`: gives an `Evaluation` at z (n,); called once a point. `start`, `lower`, `upper` (n,): start
    and bounds. `max_iterations`: IPOPT's ``max_iter``. `tolerance`: IPOPT's ``tol``.
    """
    point = _Point(evaluate)
    n, m = start.size, constraints
    values = _Output("values", [n], [(1, 1), (m, 1)], lambda e: (e.objective, e.constraints), point)
    functions = {
        "grad_f": _Output("grad_f", [n, 0], [(1, 1), (n, 1)], lambda e: (e.objective, e.gradient), point),
        "jac_g": _Output(
            "jac_g", [n, 0], [(m, 1), (m, n)], lambda e: (e.constraints, e.constraint_jacobian), point
        ),
        "hess_lag": _Hessian("hess_lag", [n, 0, 1, m], [(n, n)], lambda e: (np.triu(e.hessian),), point),
    }
    z = casadi.MX.sym("z", n)
    objective, g = values(z)
    problem: Any = {"x": z, "f": objective, "g": g}
    options: Any = {
        **functions,
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
    return Minimum(
        solution["x"].full()[:, 0],
        bool(stats["success"]),
        f"IPOPT: {stats['return_status']}",
        int(stats["iter_count"]),
    )


class _Point:
    """Last point evaluated: IPOPT asks for value, gradient, Jacobian and Hessian one by one."""

    __slots__ = ("_evaluate", "_value", "_z")

    def __init__(self, evaluate: Callable[[FloatArray], Evaluation]) -> None:
        self._evaluate = evaluate
        self._z: bytes | None = None
        self._value: Evaluation

    def __call__(self, z: FloatArray) -> Evaluation:
        if z.tobytes() != self._z:
            self._value, self._z = self._evaluate(z), z.tobytes()
        return self._value


class _Output(casadi.Callback):
    """Something of an `Evaluation` as a CasADi Function of z."""

    def __init__(
        self,
        name: str,
        inputs: list[int],
        outputs: list[tuple[int, int]],
        choose: Callable[[Evaluation], tuple[Any, ...]],
        point: _Point,
    ) -> None:
        super().__init__()
        self._inputs, self._outputs, self._choose, self._point = inputs, outputs, choose, point
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_n_out(self) -> int:
        return len(self._outputs)

    def get_sparsity_in(self, i: int) -> Any:
        return casadi.Sparsity.dense(self._inputs[i], 1)

    def get_sparsity_out(self, i: int) -> Any:
        return casadi.Sparsity.dense(*self._outputs[i])

    def eval(self, arguments: Any) -> list[Any]:
        chosen = self._choose(self._point(arguments[0].full()[:, 0]))
        return [casadi.DM(value) for value in chosen]


class _Hessian(_Output):
    """Upper triangle of the objective's Hessian, times its multiplier."""

    def get_sparsity_out(self, i: int) -> Any:
        return casadi.Sparsity.upper(self._outputs[i][0])

    def eval(self, arguments: Any) -> list[Any]:
        (hessian,) = super().eval(arguments)
        return [casadi.project(hessian * float(arguments[2]), self.get_sparsity_out(0))]


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
    return casadi.conic("program", name, shapes, {**QUADRATIC[name], "error_on_fail": False})


def quadratic_program(H: FloatArray, g: FloatArray, lower: FloatArray, upper: Any = np.inf) -> FloatArray:
    """Minimum of w' H w / 2 - g' w over lower <= w <= upper.

    `H` (n, n): symmetric, positive definite. `g`, `lower`, `upper` (n,): bounds may be infinite.
    """
    found = _conic(g.size)(h=casadi.DM(H), g=-g, lbx=lower, ubx=upper)
    return np.clip(found["x"].full()[:, 0], lower, upper)
