"""A record that a free-running model is fitted to, and the convex program about any of its parameters.

One residual and one set of sums for `BatchFit` (a whole record), `MovingHorizon` (a sliding window) and the
Coleman-Hodgdon model of `fit` (a log, with a delay). What depends on the model is in `piezoest.models`,
behind `FreeRunning`. L. Ljung, System Identification, 2nd ed. (1999), ch. 7 and 10.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import Coordinates, late
from piezoest.fitting.losses import LEAST_CURVATURE, bend
from piezoest.fitting.program import Sums, checked
from piezoest.fitting.rows import across, dot
from piezoest.symbolic import Pass

# Step of the derivative by the delay: averages over the corners of the linear interpolation.
DELAY_STEP = 1e-4


class Prior(NamedTuple):
    """What is known before: root (q - mean) has unit covariance; shapes (n,), (n, n)."""

    mean: FloatArray
    root: FloatArray


class Problem:
    """A record and what of the model is to be fitted to it.

    `u` (N,): voltage [V], without gaps. `x` (N,): measured displacement [µm], NaN where it is missing.
    `held`: values of the coordinates' held parameters. `decays`: factors exp(-dt/tau_i) of the creep terms.
    `root_weight` (N,): each sample's reciprocal standard deviation, up to a common factor. `prior`: knowledge
    of the coordinates beside the record. `limits`: narrower bounds of coordinates by name. `beside` (N, m):
    columns that are fitted beside the model, as a drift is; only least squares over the whole record know
    of them.
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
        beside: FloatArray | None = None,
    ) -> None:
        known = np.isfinite(x)
        self.u, self.x = u, np.where(known, x, 0.0)
        self.weight = known * (1.0 if root_weight is None else root_weight)
        self.measured: Any = self.weight > 0.0
        self.coordinates, self.held, self.prior = coordinates, held, prior
        self.decays = np.empty(0) if decays is None else decays
        self._limits = limits
        self._beside: FloatArray | None = None
        if beside is not None and beside.shape[1] > 0:
            self._beside = np.linalg.qr(beside * self.weight[:, None])[0]
        self._q: bytes | None = None
        self._run: tuple[Pass, FloatArray]

    def simulate(self, q: FloatArray) -> tuple[Pass, FloatArray]:
        """Pass over the whole record, and the derivative of (p, s) by q; the last one is kept."""
        if q.tobytes() != self._q:
            self._run, self._q = self.pass_over(q), q.tobytes()
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

    def left(self, values: FloatArray) -> FloatArray:
        """What the columns beside the model leave of weighted values, shape (N,) or (N, k).

        The linear part is solved at every step: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973)
        413-432.
        """
        if self._beside is None:
            return values
        columns = values.reshape(values.shape[0], -1)
        known = np.einsum("im,mn->in", self._beside, across(self._beside, columns))
        return np.asarray(values - known.reshape(values.shape))

    def residual(self, q: FloatArray) -> FloatArray:
        """Weighted residual (N,), measured less simulated; zero where nothing was measured."""
        return self.left((self.x - self.simulate(q)[0].x) * self.weight)

    def sums(self, run: Pass, rows: slice, loss: str = "linear", scale: float = 1.0) -> tuple[float, Sums]:
        """Half the sum of the losses of a pass over some rows, and sums that have its derivatives by (p, s).

        A loss is one of `TUNING`, and bends at residuals beyond `scale`.
        """
        weight = self.weight[rows]
        missed = self.left((self.x[rows] - run.x) * weight)
        rho = z = (missed / scale) ** 2
        if loss != "linear":
            rho, slope, change = bend(loss, z)
            root = np.sqrt(np.maximum(slope + 2.0 * change * z, LEAST_CURVATURE))
            weight, missed = weight * root, missed * slope / root
        J = run.jacobian * weight[:, None]
        sums = Sums.of(J, missed)
        if self._beside is not None:
            # As of `left(J)`, which is a large matrix: what is missed holds nothing of the columns any more.
            known = across(self._beside, J)
            sums = Sums(sums.gram - known.T @ known, sums.moment, sums.square, sums.rows)
        return 0.5 * scale**2 * float(rho.sum()), sums

    def about(
        self, q: FloatArray, loss: str = "linear", scale: float = 1.0, samples: int | None = None
    ) -> tuple[float, Sums]:
        """Cost of the first so many samples and of the prior at q, and the program of a step from there.

        The cost is infinite where the model is not finite.
        """
        run, by_q = self.simulate(q)
        some = Pass(run.x[:samples], run.jacobian[:samples], run.end, run.end_jacobian)
        cost, sums = self.sums(some, slice(samples), loss, scale)
        sums = sums.through(by_q)
        if self.prior is not None:
            known = Sums.of(self.prior.root, self.prior.root @ (self.prior.mean - q))
            cost, sums = cost + 0.5 * known.square, sums.plus(known)
        return cost if np.isfinite(cost) else np.inf, sums

    def cost(self, q: FloatArray) -> float:
        """Half the sum of squares."""
        return self.about(q)[0]

    def bounds(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds of the coordinates about a start."""
        return self.coordinates.bounds(q, self._limits)

    def gap(self, q: FloatArray) -> float:
        """How much less SciPy's bounded least squares leaves by one more step, relative to what x has."""
        (_, sums), (lower, upper) = self.about(q), self.bounds(q)
        sums = Sums(sums.gram, sums.moment, dot(self.x, self.x), sums.rows)
        return checked(sums, lower - q, np.zeros_like(sums.gram), np.zeros_like(q), upper - q)
