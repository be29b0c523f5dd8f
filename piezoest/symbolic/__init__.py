"""The equations with CasADi symbols: derivatives, whole-record simulation, and solvers.

The only package that imports CasADi. The functions of `piezoest.equations` are called with SX
symbols, so nothing is written a second time.
"""

from piezoest.symbolic.solving import Evaluation, Solution, ipopt, quadratic_program, quadratic_solver
from piezoest.symbolic.tracing import Pass, Simulation, jacobian, simulation, trace

__all__ = [
    "Evaluation", "Pass", "Simulation", "Solution", "ipopt", "jacobian", "quadratic_program",
    "quadratic_solver", "simulation", "trace",
]  # fmt: skip
