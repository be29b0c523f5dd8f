"""Moving-horizon estimation: the output-error problem on a sliding window, on CasADi."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from piezoest._checks import WILDEST, FloatArray, integer, moderate, positive
from piezoest.estimators import horizon_kernel as kernel
from piezoest.estimators.hopping import LEAST_HANDED_OUT, Hopping
from piezoest.estimators.samples import HELD, UPDATED
from piezoest.estimators.saved_state import Rule, no_more_than
from piezoest.estimators.thinning import thinned
from piezoest.fitting.coordinates import Coordinates, coordinates
from piezoest.fitting.gauss_newton import single_shooting
from piezoest.fitting.outcome import inverse_information
from piezoest.fitting.problem import Prior, Problem
from piezoest.layout import fill
from piezoest.models import FreeRunning
from piezoest.symbolic import Solution

# Most samples of a window, all of which are kept.
LONGEST = 1e7
# Points that a window is thinned out to, if the user does not say.
POINTS = 2000
# Start's standard deviation of an offset, relative to b/a (the largest w_h).
OFFSET_UNCERTAINTY = 1e3
# Relative change at which a solve has ended: far below what a hop's new samples move.
TOLERANCE = 1e-8
# Keeps a correlation matrix positive definite that rounding would not, and the squares of its root in range.
JITTER = 1e-9


class MovingHorizon(Hopping):
    """Moving-horizon estimation: an output-error fit of the last `window` seconds, once every `hop`.

    Older samples are represented by the arrival cost: the Gauss-Newton posterior of the samples that have
    left the window, widened by the process noise. Each fit starts from the last one. Between fits, and
    after a failed one, the last good model is kept.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    window : float
        Length of the window [s].
    hop : float
        Time between fits [s], shorter than `window`.
    decimation : int, optional
        Samples per point of the problem. Default: chosen for about 2000 points.
    initial_model : FreeRunning, optional
        Initial model; a model of this class is estimated: a ColemanHodgdon, a LinearGain or another with a
        `loop`. Default ``ColemanHodgdon(0.02, 0.12, 0.0036)``, a common stack actuator.
    offset : bool
        Also estimate the displacement at zero voltage and w_h = 0; else it is `initial_model`'s.
    uncertainty : float
        Standard deviation of each initial parameter, relative to its value.
    process_noise : float
        Random walk of each parameter outside the window, relative to its value, per root second. For gamma
        it is relative to gamma/(alpha beta) - 1, for the offset to b/a, and for w_h to the noise.
    noise : float
        Standard deviation of the displacement's noise [µm]. If the residual of the last window was larger,
        because the model is not exact, the residual is used.
    max_iterations : int
        Largest number of simulations of the window in one fit.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Decimation needs no anti-aliasing filter. Every turning point of the voltage is a point of the problem,
    and between two points w_h is exact for a monotone voltage. The displacement is averaged over the
    samples around a point; the error of this is below 1e-5 µm for 10 samples at 50 kHz and 5 Hz. At a
    turning point, or next to a missing sample, the single sample is used. A voltage that turns in most
    points is not decimated. An odd decimation uses all samples, an even one all but one of each group.

    Source: C. V. Rao, J. B. Rawlings, D. Q. Mayne, IEEE Trans. Autom. Control 48 (2003) 246-258.

    Examples
    --------
    >>> import piezoest as pz
    >>> fs, true = 500.0, pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
    >>> u = pz.signals.triangle(amplitude=33.0, frequency=5.0, periods=3, sample_rate=fs).values
    >>> estimator = pz.MovingHorizon(fs)
    >>> trace = estimator.run(u, true.simulate(u))
    >>> estimator.status.last
    'updated'
    """

    __slots__ = ("_hop", "_message", "_window")

    def __init__(
        self,
        sample_rate: float,
        *,
        window: float = 0.4,
        hop: float = 0.1,
        decimation: int | None = None,
        initial_model: FreeRunning | None = None,
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
        initial = self._start_from(initial_model, FreeRunning)
        self._window, self._hop = max(2, round(window * sample_rate)), max(1, round(hop * sample_rate))
        if decimation is None:
            decimation = max(1, self._window // POINTS)
        noise = moderate("noise", noise)
        self._arguments = {
            "sample_rate": sample_rate,
            "window": window,
            "hop": hop,
            "decimation": integer("decimation", decimation, 1),
            "initial_model": initial.to_dict(),
            "offset": bool(offset),
            "uncertainty": moderate("uncertainty", uncertainty),
            "process_noise": moderate("process_noise", process_noise, or_zero=True),
            "noise": noise,
            "max_iterations": integer("max_iterations", max_iterations, 1),
        }
        varied, m = self._coordinates, len(self.parameter_names)
        q = varied.of(initial)
        deviation = self._sizes(q)
        deviation[varied.where("offset")] *= OFFSET_UNCERTAINTY
        deviation[~np.isin(varied.free, initial.state_names)] *= self._arguments["uncertainty"]
        values = {
            "noise": noise, "S": noise**2, "q": q, "mean": q, "root": np.diag(1.0 / deviation),
            "u": kernel.NOTHING, "x": kernel.NOTHING, **self._held_at(q, np.diag(deviation**2)),
        }  # fmt: skip
        self._begin(self._arguments, kernel.layout(q.size, m, self._window, noise), values)
        self._message = ""

    def _rules(self, state: Any) -> Iterable[Rule]:
        yield no_more_than(state["samples"], state["missing"])
        yield no_more_than(state["solves"], state["failures"])
        model, held = self._model_of(state["theta"]), state["model"]
        lower, upper = self._coordinates.bounds(q := state["q"])
        same = np.allclose((*model.loop, model.offset), [held[name] for name in ("a", "b", "c", "offset")])
        yield (
            "the model as held must be admissible and that of theta, the coordinates within bounds",
            np.all((lower <= q) & (q <= upper)) and same and model.is_admissible,
        )
        window = np.array([state["u"], state["x"]])
        yield (
            "the window must hold samples, or what stands for missing ones",
            np.all((np.abs(window) < WILDEST) | (window == kernel.NOTHING)),
        )

    @property
    def _coordinates(self) -> Coordinates:
        return coordinates(type(self._initial), () if self._arguments["offset"] else ("offset",))

    @property
    def _held(self) -> FloatArray:
        return np.empty(0) if self._arguments["offset"] else np.array([self._initial.offset])

    def _sizes(self, q: FloatArray) -> FloatArray:
        """Size of each coordinate: what uncertainty and process noise are relative to."""
        names = self._coordinates.free
        size = self._initial.sizes(dict(zip(names, q.tolist(), strict=True)))
        return np.maximum(np.abs([size[name] for name in names]), 1e-12)

    def _held_at(self, q: FloatArray, covariance: FloatArray, **more: Any) -> dict[str, Any]:
        """Fields of the state that say which model is held, for that of q."""
        _, _, theta, T = self._coordinates(q, self._held)
        m = len(self.parameter_names)
        model = self._model_of(theta[:m])
        (a, b, c), P = model.loop, T[:m] @ covariance @ T[:m].T
        numbers = {"a": a, "b": b, "c": c, "offset": model.offset, **more}
        return {"theta": theta[:m], "P": 0.5 * (P + P.T), "model": numbers}

    # ------------------------------------------------------------ samples

    def _sample(self, u: float, x: float) -> None:
        kernel.step.of(self._layout)(self._state, u, x)
        if int(self._state["samples"]) % self._hop == 0:
            self._solve()

    @property
    def _left(self) -> int:
        return self._hop - int(self._state["samples"]) % self._hop

    def _collect(self, u: FloatArray, x: FloatArray) -> FloatArray:
        y, at_end = np.empty(u.size), u.size == self._left
        kernel.run.of(self._layout)(self._state, u, x, y)
        if at_end:
            self._solve()
        return y

    # ------------------------------------------------------------ the solve

    def _in_order(self) -> tuple[FloatArray, FloatArray, int]:
        """Voltage and displacement of the window, oldest first, and its first sample's number."""
        samples = int(self._state["samples"])
        order = np.arange(max(0, samples - self._window), samples)
        u, x = (self._state[name][order % self._window] for name in ("u", "x"))
        x[x == kernel.NOTHING] = np.nan
        return u, x, int(order[0])

    def _solve(self) -> None:
        """Fit the window, move the arrival cost on by a hop; without success hold what is held."""
        state = self._state
        u, x, first = self._in_order()
        known = u != kernel.NOTHING
        if not known.any():
            return
        u[~known] = u[known][0]  # before the first known voltage; nothing is measured there
        # The window's first sample at the next solve, counted from this one's.
        leaving = max(0, int(state["samples"]) + self._hop - self._window) - first
        points, shift, mean_x, weight = thinned(u, x, first, self._arguments["decimation"], leaving)
        problem = Problem(
            u[points], mean_x - state["model"]["c"] * shift, self._coordinates, self._held,
            root_weight=weight / state["noise"], prior=Prior(state["mean"].copy(), state["root"].copy()),
        )  # fmt: skip
        state["solves"] += 1.0
        kept = state.copy()
        try:
            with np.errstate(all="ignore"):
                self._message = self._fit(problem, points, leaving)
            failed = not np.all(np.isfinite(np.frombuffer(state)))
        except (ValueError, np.linalg.LinAlgError) as error:
            self._message, failed = str(error), True
        if failed:
            state[...] = kept
            state["failures"] += 1.0

    def _fit(self, problem: Problem, points: Any, leaving: int) -> str:
        """Solve, hold what is good, and move the arrival cost on; returns the solver's words."""
        state, q = self._state, self._state["q"].copy()
        found = single_shooting(problem, q, "linear", 1.0, self._arguments["max_iterations"], TOLERANCE)
        good = self._accepts(problem, found)
        if good:
            q = found.q
            if state["last"] == HELD:
                state["updates"] += 1.0
                state["last"] = UPDATED
        else:
            state["failures"] += 1.0
        self._move_on(problem, q, int(np.searchsorted(points, leaving)), leaving)
        if good and (count := int(np.count_nonzero(problem.measured))):
            residual = problem.residual(q)
            chi = np.sqrt(float(residual @ residual) / count)
            state["noise"] = max(self._arguments["noise"], state["noise"] * chi)
        return found.message

    def _accepts(self, problem: Problem, found: Solution) -> bool:
        """Hold what was found, if it is any good."""
        _, sums = problem.about(found.q)
        if not (found.success and np.all(np.isfinite(sums.gram))):
            return False
        covariance = inverse_information(sums.gram)
        run, by_q = problem.simulate(found.q)
        row = run.jacobian[-1] @ by_q
        variance = self._state["noise"] ** 2 + row @ covariance @ row
        T = self._coordinates(found.q, self._held)[3][: len(self.parameter_names)]
        values = {"S": variance, "K": T @ covariance @ row / variance}
        fill(self._state, self._layout, values | self._held_at(found.q, covariance, w_h=run.end[0]))
        return True

    def _move_on(self, problem: Problem, q: FloatArray, k: int, leaving: int) -> None:
        """Arrival cost and start of the next window, which begins at point k."""
        state = self._state
        state["q"] = q
        if leaving == 0:
            return
        walk = self._sizes(q) * np.sqrt(leaving / self.sample_rate)
        walk[problem.coordinates.where(*self._initial.state_names)] = state["noise"]
        try:
            follower, prior = _arrival_cost(problem, q, k, walk * self._arguments["process_noise"])
        except np.linalg.LinAlgError:
            return
        if np.all(np.isfinite(prior.root)) and np.all(np.isfinite(prior.mean)):
            fill(state, self._layout, {"q": follower, "mean": prior.mean, "root": prior.root})

    # ------------------------------------------------------------ methods of all estimators

    @property
    def model(self) -> FreeRunning:
        """Admissible model as held: of the last good solve, its slope at least 1 % of the start's."""
        return self._model_of(self._state["theta"]).lifted(self._initial, LEAST_HANDED_OUT)

    def _counts(self, state: Any) -> dict[str, int]:
        found = super()._counts(state)  # updates are the good solves, held the measured samples between them
        return found | {"held": found["samples"] - found["missing"] - found["updates"]}

    @property
    def solves(self) -> int:
        """Solves so far, failed ones too: never more than one a hop."""
        return int(self._state["solves"])

    @property
    def failures(self) -> int:
        """Solves that failed, after which the last good model was held."""
        return int(self._state["failures"])

    @property
    def solver_message(self) -> str:
        """What the solver said last; empty before the first solve, and not saved."""
        return self._message

    def reset(self) -> None:
        """Return to the state after construction."""
        super().reset()
        self._message = ""


def _arrival_cost(problem: Problem, q: FloatArray, k: int, walk: FloatArray) -> tuple[FloatArray, Prior]:
    """Coordinates and prior of the window that starts at point k of this one.

    The Gauss-Newton posterior of the samples that leave the window.
    """
    _, sums = problem.about(q, samples=k)
    covariance = inverse_information(sums.gram)
    step = covariance @ sums.moment
    G, follower = np.eye(q.size), q.copy()
    if state := problem.coordinates.where(*problem.coordinates.model.state_names):
        # The states at point k, which the next window starts from.
        run, by_q = problem.pass_over(q, k + 1)
        follower[state], G[state] = run.end, run.end_jacobian @ by_q
    covariance = G @ covariance @ G.T + np.diag(walk**2)
    scale = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(scale, scale) + JITTER * np.eye(q.size)
    root = np.linalg.inv(np.linalg.cholesky(correlation)) / scale
    return follower, Prior(follower + G @ step, root)
