"""Multiple shooting: an output-error fit over segments with start states of their own.

H. G. Bock, K. J. Plitt, A multiple shooting algorithm for direct solution of optimal control problems,
IFAC Proc. 17 (1984) 1603-1608; for parameter estimation the objective is a sum of squares.
"""

from itertools import pairwise

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.problem import Problem
from piezoest.symbolic import Evaluation, Solution, ipopt

SEGMENTS = 20
# Samples on each side of a segment's start that its start state is guessed from.
NEIGHBOURS = 10
# For a cost of one at the start and parameters of order one.
TOLERANCE = 1e-7


def multiple_shooting(
    problem: Problem, start: FloatArray, loss: str, scale: float, max_iterations: int
) -> Solution:
    """Fit by IPOPT over segments with states of their own, tied together by constraints.

    The Hessian is that of Gauss and Newton, from the same sensitivities as in single shooting. The arguments
    are those of `single_shooting`, for a problem without a prior; the iterations are IPOPT's.
    """
    segments = _Segments(problem, start, loss, scale)
    lower, upper = problem.bounds(start)
    wide = np.full(segments.start.size - start.size, np.inf)
    unit = segments.unit
    try:
        found = ipopt(
            segments.evaluate,
            segments.start / unit,
            np.concatenate([lower, -wide]) / unit,
            np.concatenate([upper, wide]) / unit,
            wide.size,
            max_iterations,
            TOLERANCE,
        )
    except RuntimeError as error:
        return Solution(start, False, f"IPOPT: {error}", 0)
    q = (found.q * unit)[: start.size]
    # Not converged, the segments need not join: the best iterate is then judged in one piece.
    if not found.success and not problem.cost(q) < problem.cost(start):
        q = start
    return Solution(np.clip(q, lower, upper), found.success, found.message, found.evaluations)


class _Segments:
    """Objective and continuity of multiple shooting; z = (q, states at the segments' starts)."""

    def __init__(self, problem: Problem, q: FloatArray, loss: str, scale: float) -> None:
        self.problem, self.loss, self.scale = problem, loss, scale
        N = problem.u.size
        self.edges = np.unique(np.linspace(0, N, min(SEGMENTS, N) + 1).astype(int))
        self.start = np.concatenate([q, *self._states(q)])
        extent = float(np.ptp(problem.x[problem.measured])) or 1.0
        self.unit = np.full(self.start.size, extent)
        # Coordinates relative to what they start from; those at zero are displacements or gains.
        names = problem.coordinates.free
        other = [0.1 if name.startswith("creep") else extent for name in names]
        self.unit[: q.size] = np.where(np.abs(q) > 1e-3 * np.array(other), np.abs(q), other)
        self.normal = 1.0
        # A record without noise has no cost to speak of.
        least = 1e-16 * extent**2 * float(problem.weight @ problem.weight)
        self.normal = 1.0 / max(self.evaluate(self.start / self.unit).objective, least)

    def _states(self, q: FloatArray) -> list[FloatArray]:
        """States to start from: simulated ones, w_h moved to what is measured nearby."""
        problem = self.problem
        v, _, _, _ = problem.coordinates(q, problem.held)
        n_p = problem.coordinates.simulation.n_p
        run, _ = problem.simulate(q)
        measured = np.flatnonzero(problem.measured)
        missed = problem.x[measured] - run.x[measured]
        s, states = v[n_p:], []
        for first, last in pairwise(self.edges[:-1].tolist()):
            u, before = problem.u[first:last], problem.u[max(first - 1, 0)]
            s = problem.coordinates.simulation.run(
                u, v[:n_p], s, problem.decays, before=before, sensitive=False
            ).end
            states.append(s.copy())
            near = int(np.searchsorted(measured, last))
            nearby = missed[max(near - NEIGHBOURS, 0) : near + NEIGHBOURS]
            # A median, for a loss that is robust deserves a start that is.
            if problem.coordinates.model.state_names and nearby.size:
                states[-1][0] += float(np.median(nearby))
        return states

    def evaluate(self, z: FloatArray) -> Evaluation:
        """Everything IPOPT asks for at a point, by one pass over all segments."""
        z = z * self.unit
        problem, simulation = self.problem, self.problem.coordinates.simulation
        n_q, n_p, n_s = len(problem.coordinates.free), simulation.n_p, simulation.n_s
        v, by_q, _, _ = problem.coordinates(z[:n_q], problem.held)
        starts = np.concatenate([v[n_p:], z[n_q:]]).reshape(-1, n_s)
        # Derivative by z of p and all starts; of a segment's (p, s) then of its cost and its end.
        by_z = np.zeros((n_p + starts.size, z.size))
        by_z[: n_p + n_s, :n_q] = by_q
        by_z[n_p + n_s :, n_q:] = np.eye(z.size - n_q)
        objective, gradient, hessian = 0.0, np.zeros(z.size), np.zeros((z.size, z.size))
        ends, ends_by_z = np.empty_like(starts), np.empty((starts.size, z.size))
        for i, s in enumerate(starts):
            rows, own = slice(self.edges[i], self.edges[i + 1]), slice(i * n_s, (i + 1) * n_s)
            before = problem.u[max(rows.start - 1, 0)]
            run = simulation.run(problem.u[rows], v[:n_p], s, problem.decays, before=before)
            V = np.concatenate([by_z[:n_p], by_z[n_p:][own]])
            cost, sums = problem.sums(run, rows, self.loss, self.scale)
            objective += cost
            gradient -= V.T @ sums.moment
            hessian += V.T @ sums.gram @ V
            ends[i], ends_by_z[own] = run.end, run.end_jacobian @ V
        defect = (ends[:-1] - starts[1:]).ravel()
        defect_jacobian = ends_by_z[:-n_s] - by_z[n_p + n_s :]
        unit = self.unit
        state_unit = unit[n_q:]
        return Evaluation(
            objective * self.normal,
            gradient * unit * self.normal,
            defect / state_unit,
            defect_jacobian * unit / state_unit[:, None],
            hessian * np.outer(unit, unit) * self.normal,
        )
