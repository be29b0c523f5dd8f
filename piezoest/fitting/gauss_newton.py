"""The fit of a model that runs free: steps of which each is one convex program, until the optimum.

About any coordinates the displacement is their sensitivities times a step. In one step those in which it is
linear come to their optimum, for what the others are then. Steps that promise more than they keep are damped:
D. W. Marquardt, J. SIAM 11 (1963) 431-441. Where the model cannot explain the record, each step leaves about
the same fraction of the way, and two of them tell which: D. G. Anderson, J. ACM 12 (1965) 547-560.
"""

from collections.abc import Callable

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.losses import TUNING
from piezoest.fitting.problem import Problem
from piezoest.fitting.program import solve
from piezoest.symbolic import Solution

# A robust fit is repeated until its scale, taken from the residual, changes by less.
SCALE_CHANGE, SCALE_ROUNDS = 0.02, 5
# Least scale of a robust loss, relative to the displacement's range: a record without noise has none.
LEAST_SCALE = 1e-9
# Changes of cost and coordinates at which a fit has ended; a standard error is far above them.
TOLERANCE = 1e-10
# A step that keeps less than the poor part of its promise is damped from here, by more and more; one that
# keeps the good part has the next damped less.
DAMPED, POOR, GOOD, MORE, LESS = 1e-3, 0.25, 0.75, 2.0, 3.0
# One step changes a coordinate that has to be above zero by this factor at most.
FARTHEST = 10.0
# Least curvature of a step, relative to a column's own: rounding. More would hold back what a prior ties.
RIDGE = 1e-13


def single_shooting(
    problem: Problem,
    start: FloatArray,
    loss: str,
    scale: float,
    max_iterations: int,
    tolerance: float = TOLERANCE,
) -> Solution:
    """Fit by convex programs on the sensitivities of one pass over the record, from coordinates (n,).

    `loss` is one of `TUNING` and bends at residuals beyond `scale`; `max_iterations` passes over the record
    at most; `tolerance` is the relative change of cost and coordinates at which the fit has ended.
    """
    lower, upper = problem.bounds(start)
    q, damping, more = np.clip(start, lower, upper), 0.0, MORE
    cost, sums = problem.about(q, loss, scale)
    last: tuple[FloatArray, FloatArray] | None = None
    for passes in range(1, max_iterations):
        if not np.all(np.isfinite([cost, *sums.moment, *sums.gram.flat])):
            # Numbers of a size that no stage has; a stream goes on all the same.
            return Solution(q, False, "The model is not finite.", passes)
        own = np.diag(sums.gram)
        near = np.maximum(lower, q / FARTHEST), np.minimum(upper, q * FARTHEST)
        least, most = np.where(lower > 0.0, near, (lower, upper)) - q
        penalty = damping / max(sums.rows, 1.0) * np.diag(own)
        try:
            step = solve(sums, least, penalty, most, RIDGE)
        except np.linalg.LinAlgError:
            # Rounding has made the program concave: with damping it is not.
            damping, more = _more(damping, more)
            continue
        farther = step if last is None else _farther(step, last[1], q - last[0], own)
        other = np.clip(q + np.clip(farther, least, most), lower, upper)
        promised = float(sums.moment @ step - 0.5 * step @ sums.gram @ step)
        ended = promised <= tolerance * cost or float(own @ step**2) <= tolerance**2 * float(own @ q**2)
        other_cost, other_sums = problem.about(other, loss, scale)
        kept = cost - other_cost
        good = kept >= POOR * promised
        if good:
            damping, more = damping / LESS if kept > GOOD * promised else damping, MORE
        elif last is None:
            damping, more = _more(damping, more)
        last = (q, step) if good else None
        if kept >= 0.0:
            q, cost, sums = other, other_cost, other_sums
        if ended:
            return Solution(q, True, "The tolerance is satisfied.", passes + 1)
    return Solution(q, False, "The maximum number of function evaluations is exceeded.", max_iterations)


def _farther(step: FloatArray, before: FloatArray, moved: FloatArray, own: FloatArray) -> FloatArray:
    """The step that would leave nothing, from this one, the one before and how far it has moved (n,)."""
    change = step - before
    size = float(own @ change**2)
    return step - float(own @ (step * change)) / size * (moved + change) if size > 0.0 else step


def _more(damping: float, more: float) -> tuple[float, float]:
    """Damping of the next step, and by how much the one after it would grow."""
    return max(more * damping, DAMPED), MORE * more


def robust(
    problem: Problem, q: FloatArray, wanted: str, noise: float | None, solve: Callable[..., Solution]
) -> tuple[Solution, float]:
    """Fit and scale of a robust loss, in turn, until the scale is that of the fit's own residual.

    Least squares are fitted once.
    """
    if wanted == "linear":
        return solve(problem, q, wanted, 1.0), 1.0
    floor = LEAST_SCALE * (float(np.ptp(problem.x[problem.measured])) or 1.0)
    evaluations, scale, fitted = 0, 0.0, ""
    # A loss that is not convex has false minima, and starts from the fit of one that is.
    for loss in ("soft_l1", *[wanted] * SCALE_ROUNDS):
        missed = np.abs(problem.residual(q)[problem.measured])
        sd = 1.4826 * float(np.median(missed)) if noise is None else noise
        last, scale = scale, TUNING[loss] * max(sd, floor)
        if fitted == wanted and abs(scale - last) < SCALE_CHANGE * scale:
            break
        fitted, solution = loss, solve(problem, q, loss, scale)
        q, evaluations = solution.q, evaluations + solution.evaluations
    return Solution(q, solution.success, solution.message, evaluations), scale
