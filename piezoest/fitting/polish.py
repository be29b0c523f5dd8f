"""The Coleman-Hodgdon model's nonlinear program: alpha, beta, gamma, offset, start and delay together.

The linear fits at one alpha after the other end near the optimum; a few passes with the derivatives that
CasADi makes end in it, and give the standard errors of all, the delay among them.
"""

from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import coordinates
from piezoest.fitting.gauss_newton import single_shooting
from piezoest.fitting.loop_columns import LoopColumns
from piezoest.fitting.outcome import outcome
from piezoest.fitting.problem import Problem
from piezoest.fitting.regression import Fitted, Log
from piezoest.fitting.runs import IntArray
from piezoest.fitting.search import LONGEST_DELAY
from piezoest.models import ColemanHodgdon

# What a record can tell from a straight line: alpha times the voltage's range, and b/c.
CURVATURES, BENT = (np.exp(-4.0), np.exp(4.0)), (1e-3, 0.4995)
# Its delay is longer than that of plays by no more than this [samples].
BEYOND_PLAYS = 2.0
# Most passes over the record, and the relative change at which it has ended.
MOST_PASSES, TOLERANCE = 40, 1e-6


class Polished(NamedTuple):
    """Columns of another alpha, coefficients, delay, what is missed, standard errors by name, SciPy's gap.

    `parameters` is how many were fitted.
    """

    basis: LoopColumns
    w: FloatArray
    delay: float
    cost: float
    standard_errors: dict[str, float]
    gap: float
    parameters: int


def polished(log: Log, fitted: Fitted, delay: float, *, fit_delay: bool, near: float) -> Polished:
    """The optimum near a linear fit; `log.u` is the voltage as it was written, without delay.

    `near`: the delay that plays have; what a loop of another shape leaves looks like more.
    """
    w, offset = fitted.w.copy(), fitted.design.offset
    others, beside = _beside(log, fitted)
    x = np.where(log.counts, log.x, np.nan)
    varied = coordinates(ColemanHodgdon, () if fit_delay else ("delay",), delayed=True)
    limits = {
        "alpha": (CURVATURES[0] / (2.0 * log.half), CURVATURES[1] / (2.0 * log.half)),
        "ratio": (1.0 / (1.0 - BENT[0]), 1.0 / (1.0 - BENT[1])),
        "delay": (0.0, min(near + BEYOND_PLAYS, LONGEST_DELAY)),
    }
    held = np.empty(0) if fit_delay else np.array([delay])
    problem = Problem(log.u, x, varied, held, limits=limits, beside=beside)
    model: Any = fitted.design.model(w)
    place = fitted.design.basis.initial_state(w, model) * model.alpha / model.b
    start = varied.of(model, {"delay": delay, "place": place})
    solution = single_shooting(problem, start, "linear", 1.0, MOST_PASSES, TOLERANCE)
    end = outcome(problem, solution.q, coloured=True)
    value = end.value
    found = ColemanHodgdon.from_theta(end.theta[:3], value["offset"])
    w[: offset + 1] = found.c - 2.0 * found.b, found.b, value["initial_state"], found.offset
    missed = problem.x - problem.simulate(solution.q)[0].x
    w[others] = np.linalg.lstsq(beside[log.counts], missed[log.counts], rcond=None)[0]
    errors = dict(zip(end.parameter_names, end.standard_errors.tolist(), strict=True))
    return Polished(
        LoopColumns(found.alpha), w, value["delay"], problem.cost(solution.q), errors,
        problem.gap(solution.q), len(varied.free),
    )  # fmt: skip


def _beside(log: Log, fitted: Fitted) -> tuple[IntArray, FloatArray]:
    """Which columns of a fit are no loop's (m,), and they themselves (N, m): drift and jumps."""
    others = fitted.used[fitted.used > fitted.design.offset]
    index = np.arange(log.u.size)
    ways = np.column_stack([index / fitted.design.samples, index[:, None] >= log.jumps])
    return others, ways[:, others - fitted.design.offset - 1]
