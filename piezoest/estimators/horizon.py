"""Moving-horizon estimation: the output-error problem on a sliding window, on CasADi."""

from __future__ import annotations

import time
from typing import Any, ClassVar

import numpy as np

from piezoest._checks import FloatArray, check_start, integer, moderate, positive
from piezoest.estimators import horizon_kernel as kernel
from piezoest.estimators.arrival import moved_on
from piezoest.estimators.base import EstimatorBase, Status, Trace
from piezoest.estimators.coordinates import Coordinates, coordinates, large_enough
from piezoest.estimators.saved_state import Table
from piezoest.estimators.shooting import Prior, Problem, Solution, inverse_information, single_shooting
from piezoest.estimators.thinning import thinned
from piezoest.models import ColemanHodgdon, LinearGain

# Most samples of a window, all of which are kept.
LONGEST = 1e7
# Points that a window is thinned out to, if the user does not say.
POINTS = 2000
# Start's standard deviation of an offset, in parts of b/a (the largest w_h).
OFFSET_UNCERTAINTY = 1e3
# Relative change at which a solve has ended: far below what a hop's new samples move.
TOLERANCE = 1e-8


class MovingHorizon(EstimatorBase):
    """Moving-horizon estimation: an output-error fit of the last `window` seconds, once every `hop`.

    What lies before the window counts through the arrival cost: the Gauss-Newton posterior
    of the samples that have left it, widened by the process noise. Each solve starts from the last
    one; between solves, and after one that fails, the last good model is held.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    window : float
        Length of the window [s].
    hop : float
        Time between solves [s], shorter than `window`.
    decimation : int, optional
        Samples per point of the problem; by default as many as leave about 2000 points.
    initial_model : ColemanHodgdon or LinearGain, optional
        Model to start from; its kind is the kind that is estimated. Default
        ``ColemanHodgdon(0.02, 0.12, 0.0036)``, a common stack actuator.
    offset : bool
        Estimate the displacement at zero voltage and w_h = 0 too; else it stays at `initial_model`'s.
    uncertainty : float
        Standard deviation of each initial parameter, in parts of its value.
    process_noise : float
        Random walk of each parameter outside the window, in parts of its value per square root of a
        second; of gamma/(alpha beta) - 1 in place of gamma, of b/a for the offset, of the noise for w_h.
    noise : float
        Standard deviation of the displacement's noise [µm]; where the last window's residual was
        larger, the model being wrong, that is taken.
    max_iterations : int
        Most simulations of the window in one solve.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Thinning needs no anti-aliasing filter. The voltage's path is not thinned: between two points
    w_h is exact for any monotone voltage, and every turning point is a point. The displacement
    is averaged over the samples around a point, which is the model's output there but for the
    curvature within so few samples (of w_h; below 1e-5 µm at 10 samples, 50 kHz and 5 Hz); where the
    voltage turns or a sample is missing, the point's own sample is taken. A voltage that turns
    in most points is taken at full rate. An odd decimation uses all samples, an even one all but
    one of each.

    Source: C. V. Rao, J. B. Rawlings, D. Q. Mayne, IEEE Trans. Autom. Control 48 (2003) 246-258.
    """

    __slots__ = ("_hop", "_initial", "_layout", "_message", "_seconds", "_window")

    conformance_exceptions: ClassVar[dict[str, str]] = {}

    def __init__(
        self,
        sample_rate: float,
        *,
        window: float = 0.4,
        hop: float = 0.1,
        decimation: int | None = None,
        initial_model: ColemanHodgdon | LinearGain | None = None,
        offset: bool = False,
        uncertainty: float = 0.5,
        process_noise: float = 0.1,
        noise: float = 1.5e-3,
        max_iterations: int = 50,
    ) -> None:
        sample_rate = moderate("sample_rate", sample_rate)
        window, hop = positive("window", window), positive("hop", hop)
        if not window * sample_rate <= LONGEST:
            raise ValueError(f"window must be at most {LONGEST:g} samples long, got {window:g} s")
        if round(hop * sample_rate) >= round(window * sample_rate):
            raise ValueError(f"hop must be shorter than the window of {window:g} s, got {hop:g} s")
        initial = ColemanHodgdon(0.02, 0.12, 0.0036) if initial_model is None else initial_model
        if not isinstance(initial, ColemanHodgdon | LinearGain):
            raise ValueError(f"initial_model must be a ColemanHodgdon or a LinearGain, got {initial!r}")
        if not initial.is_admissible:
            raise ValueError(f"initial_model must be admissible, got {initial}: use nearest_admissible()")
        check_start(initial)
        self._initial = initial
        self._window, self._hop = max(2, round(window * sample_rate)), max(1, round(hop * sample_rate))
        if decimation is None:
            decimation = max(1, self._window // POINTS)
        self._arguments = {
            "sample_rate": sample_rate,
            "window": window,
            "hop": hop,
            "decimation": integer("decimation", decimation, 1),
            "initial_model": initial.to_dict(),
            "offset": bool(offset),
            "uncertainty": moderate("uncertainty", uncertainty),
            "process_noise": moderate("process_noise", process_noise, or_zero=True),
            "noise": moderate("noise", noise),
            "max_iterations": integer("max_iterations", max_iterations, 1),
        }
        n, m = len(self._coordinates().free), len(self.parameter_names)
        self._layout = kernel.Layout.of(n, m, self._window)
        self._begin(self._arguments, self._new_state())
        self._message, self._seconds = "", float("nan")

    def _table(self) -> Table:
        return kernel.table(self._layout, self._window, self._arguments["noise"], self._fits)

    def _coordinates(self) -> Coordinates:
        held = () if self._arguments["offset"] else ("offset",)
        return coordinates(isinstance(self._initial, ColemanHodgdon), held, 0)

    def _new_state(self) -> FloatArray:
        layout, varied = self._layout, self._coordinates()
        state = np.zeros(layout.size)
        q = varied.of(self._initial, 0.0, np.empty(0))
        deviation = self._arguments["uncertainty"] * self._typical(q)
        for i, name in enumerate(varied.free):
            if name == "offset":
                deviation[i] *= OFFSET_UNCERTAINTY
        state[layout.q] = state[layout.mean] = q
        state[layout.root] = np.diag(1.0 / deviation).ravel()
        self._hold(state, q, np.diag(deviation**2))
        state[kernel.NOISE] = self._arguments["noise"]
        state[kernel.VARIANCE] = state[kernel.NOISE] ** 2
        state[layout.rings :] = kernel.NOTHING
        return state

    def _typical(self, q: FloatArray) -> FloatArray:
        """Size of each coordinate: what uncertainty and process noise are parts of."""
        value = dict(zip(self._coordinates().free, q, strict=True))
        if isinstance(self._initial, ColemanHodgdon):
            value["ratio"] -= 1.0
            largest = value["ratio"] * value["beta"] / value["alpha"]
            value["initial_state"] = largest / self._arguments["uncertainty"]
        else:
            largest = 10.0 * abs(value["gain"])
        if "offset" in value:
            value["offset"] = largest
        return np.maximum(np.abs(list(value.values())), 1e-12)

    def _hold(self, state: FloatArray, q: FloatArray, covariance: FloatArray) -> None:
        """Make the model of q the one that is held."""
        v, _, theta, T = self._coordinates()(q, self._held)
        m = len(self.parameter_names)
        state[kernel.A : kernel.OFFSET + 1] = v[:4]
        state[self._layout.theta] = theta[:m]
        P = T[:m] @ covariance @ T[:m].T
        state[self._layout.P] = (0.5 * (P + P.T)).ravel()

    @property
    def _held(self) -> FloatArray:
        return np.empty(0) if self._arguments["offset"] else np.array([self._initial.offset])

    # ------------------------------------------------------------ samples

    def _sample(self, u: float, x: float) -> None:
        kernel.step(self._state, u, x, self._layout.rings, self._window)
        if int(self._state[kernel.SAMPLES]) % self._hop == 0:
            self._solve()

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, m, layout = u.size // every, len(self.parameter_names), self._layout
        theta, P, S = np.empty((rows, m)), np.empty((rows, m * m)), np.empty(rows)
        y = np.empty(u.size)
        done = 0
        while done < u.size:
            left = self._hop - int(self._state[kernel.SAMPLES]) % self._hop
            end = min(done + left, u.size)
            kernel.chunk(self._state, u[done:end], x[done:end], layout.rings, self._window, y[done:end])
            # Rows up to the one before the solve hold the old model.
            for first, last in ((done, end - 1), (end - 1, end)):
                if last == end and end - done == left:
                    self._solve()
                part = slice(first // every, last // every)
                theta[part] = self._state[layout.theta]
                P[part] = self._state[layout.P]
                S[part] = self._state[kernel.VARIANCE]
            done = end
        return Trace(
            index=np.arange(every - 1, rows * every, every),
            theta=theta,
            parameter_names=self.parameter_names,
            y=y[every - 1 :: every].copy() if "y" in want else None,
            S=S if "S" in want else None,
            P=P.reshape(-1, m, m) if "P" in want else None,
        )

    # ------------------------------------------------------------ the solve

    def _in_order(self) -> tuple[FloatArray, FloatArray, int]:
        """Voltage and displacement of the window, oldest first, and its first sample's number."""
        state, W, start = self._state, self._window, self._layout.rings
        samples = int(state[kernel.SAMPLES])
        order = np.arange(max(0, samples - W), samples)
        u, x = state[start : start + W][order % W], state[start + W : start + 2 * W][order % W]
        x[x == kernel.NOTHING] = np.nan
        return u, x, int(order[0])

    def _solve(self) -> None:
        """Fit the window, move the arrival cost on by a hop."""
        began = time.perf_counter()
        u, x, first = self._in_order()
        known = u != kernel.NOTHING
        if not known.any():
            return
        u[~known] = u[known][0]  # before the first known voltage; nothing is measured there
        state, layout, n = self._state, self._layout, self._layout.q.stop - self._layout.q.start
        # The window's first sample at the next solve, counted from this one's.
        leaving = max(0, int(state[kernel.SAMPLES]) + self._hop - self._window) - first
        points, shift, mean_x, weight = thinned(u, x, first, self._arguments["decimation"], leaving)
        mean_x -= state[kernel.C] * shift
        prior = Prior(state[layout.mean].copy(), state[layout.root].reshape(n, n).copy())
        problem = Problem(
            u[points], mean_x, self._coordinates(), self._held, np.empty(0),
            weight / state[kernel.NOISE], prior,
        )  # fmt: skip
        q = state[layout.q].copy()
        state[kernel.SOLVES] += 1.0
        kept = state.copy()
        try:
            with np.errstate(all="ignore"):
                self._message = self._fit(problem, q, points, leaving)
        except (ValueError, np.linalg.LinAlgError) as error:
            self._message = str(error)
            state[:] = kept
            state[kernel.FAILURES] += 1.0
        if not np.all(np.isfinite(state)):
            state[:] = kept
            state[kernel.FAILURES] += 1.0
        self._seconds = time.perf_counter() - began

    def _fit(self, problem: Problem, q: FloatArray, points: Any, leaving: int) -> str:
        """Solve, hold what is good, and move the arrival cost on; returns the solver's words."""
        state = self._state
        found = single_shooting(problem, q, "linear", 1.0, self._arguments["max_iterations"], TOLERANCE)
        good = self._take_over(problem, found)
        if good:
            q = found.q
            state[kernel.UPDATES] += state[kernel.LAST] == kernel.HELD
            state[kernel.LAST] = kernel.UPDATED if state[kernel.LAST] == kernel.HELD else state[kernel.LAST]
        else:
            state[kernel.FAILURES] += 1.0
        self._move_on(problem, q, int(np.searchsorted(points, leaving)), leaving)
        if good and problem.measured:
            residual = problem.evaluate(q)[0][: points.size]
            chi = np.sqrt(float(residual @ residual) / problem.measured)
            state[kernel.NOISE] = max(self._arguments["noise"], state[kernel.NOISE] * chi)
        return found.message

    def _take_over(self, problem: Problem, found: Solution) -> bool:
        """Hold what was found, if it is any good."""
        if not found.success or not np.isfinite(problem.cost(found.q)):
            return False
        _, jacobian = problem.evaluate(found.q)
        try:
            covariance = inverse_information(jacobian.T @ jacobian)
        except np.linalg.LinAlgError:
            return False
        if not np.all(np.isfinite(covariance)):
            return False
        state = self._state
        self._hold(state, found.q, covariance)
        run, by_q = problem.simulate(found.q)
        state[kernel.W_H] = run.end[0]
        row = run.jacobian[-1] @ by_q
        _, _, _, T = self._coordinates()(found.q, self._held)
        state[kernel.VARIANCE] = state[kernel.NOISE] ** 2 + row @ covariance @ row
        state[self._layout.gain] = (T[: len(self.parameter_names)] @ covariance @ row) / state[
            kernel.VARIANCE
        ]
        return True

    def _move_on(self, problem: Problem, q: FloatArray, k: int, leaving: int) -> None:
        """Arrival cost and start of the next window, which begins at point k."""
        state, layout = self._state, self._layout
        state[layout.q] = q
        if leaving == 0:
            return
        walk = self._arguments["process_noise"] * self._typical(q) * np.sqrt(leaving / self.sample_rate)
        names = problem.coordinates.free
        if "initial_state" in names:
            walk[names.index("initial_state")] = self._arguments["process_noise"] * state[kernel.NOISE]
        try:
            follower, prior = moved_on(problem, q, k, walk)
        except np.linalg.LinAlgError:
            return
        if np.all(np.isfinite(prior.root)) and np.all(np.isfinite(prior.mean)):
            state[layout.q], state[layout.mean], state[layout.root] = follower, prior.mean, prior.root.ravel()

    # ------------------------------------------------------------ the face

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`; a last one, ``offset``, where it is estimated."""
        names = self._initial.parameter_names
        return (*names, "offset") if self._arguments["offset"] else names

    @property
    def theta(self) -> FloatArray:
        """Parameters as held, shape (n,)."""
        return self._state[self._layout.theta].copy()

    @property
    def model(self) -> ColemanHodgdon | LinearGain:
        """Admissible model as held: of the last good solve, its slope at least 1 % of the start's."""
        return large_enough(self._model_of(self._state), self._initial)

    def _model_of(self, state: FloatArray) -> ColemanHodgdon | LinearGain:
        theta, n = state[self._layout.theta], self._initial.theta.size
        offset = float(theta[n]) if theta.size > n else self._initial.offset
        return type(self._initial).from_theta(theta[:n], offset)

    def _fits(self, state: FloatArray) -> bool:
        """Whether the model held is admissible and that of theta, and the coordinates are within bounds."""
        model = self._model_of(state)
        own = (model.a, model.b, model.c) if isinstance(model, ColemanHodgdon) else (0.0, 0.0, model.gain)
        lower, upper = self._coordinates().bounds(q := state[self._layout.q])
        within = np.all((lower <= q) & (q <= upper))
        same = np.allclose((*own, model.offset), state[kernel.A : kernel.OFFSET + 1])
        return bool(within and same and model.is_admissible)

    @property
    def P(self) -> FloatArray:
        """Covariance of `theta` at the last good solve, shape (n, n)."""
        n = len(self.parameter_names)
        return self._state[self._layout.P].reshape(n, n).copy()

    @property
    def standard_errors(self) -> FloatArray:
        """Square roots of the diagonal of `P`, shape (n,)."""
        return np.sqrt(np.fmax(np.diag(self.P), 0.0))

    @property
    def y(self) -> float:
        """Last measured displacement less that of the held model [µm]."""
        return float(self._state[kernel.INNOVATION])

    @property
    def S(self) -> float:
        """Variance of an innovation at the last good solve [µm²]."""
        return float(self._state[kernel.VARIANCE])

    @property
    def K(self) -> FloatArray:
        """Gain of the window's last sample on `theta`, at the last good solve, shape (n,)."""
        return self._state[self._layout.gain].copy()

    @property
    def status(self) -> Status:
        """What happened to the samples so far.

        ``updates`` counts the good solves, ``held`` the measured samples between them.
        """
        state = self._state
        samples, missing, updates = (int(state[i]) for i in (kernel.SAMPLES, kernel.MISSING, kernel.UPDATES))
        last = ("waiting", "updated", "missing", "held")[int(state[kernel.LAST])]
        return Status(samples, updates, missing, samples - missing - updates, 0, False, last)

    @property
    def solves(self) -> int:
        """Solves so far, failed ones too: never more than one a hop."""
        return int(self._state[kernel.SOLVES])

    @property
    def failures(self) -> int:
        """Solves that failed, after which the last good model was held."""
        return int(self._state[kernel.FAILURES])

    @property
    def solver_message(self) -> str:
        """What the solver said last; empty before the first solve, and not saved."""
        return self._message

    @property
    def last_solve_seconds(self) -> float:
        """Time that the last solve took [s]; NaN before the first."""
        return self._seconds

    def reset(self) -> None:
        """Return to the state after construction."""
        super().reset()
        self._message, self._seconds = "", float("nan")
