"""Output-error fit of a whole record, on CasADi."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np

from piezoest._checks import WILDEST, FloatArray, array_1d, check_start, finite, integer, moderate, positive
from piezoest.estimators.base import EstimatorBase, Status, Trace
from piezoest.estimators.batch_result import BatchFitResult, report
from piezoest.estimators.coordinates import Coordinates, coordinates, large_enough
from piezoest.estimators.multiple_shooting import multiple_shooting
from piezoest.estimators.saved_state import COUNT, MOST, Block, Table
from piezoest.estimators.shooting import TUNING, Problem, Solution, single_shooting, spread
from piezoest.estimators.starts import DEFAULT_MODEL, best_start
from piezoest.models import ColemanHodgdon, Creep, LinearGain

Method = Literal["single-shooting", "multiple-shooting"]
Loss = Literal["linear", "huber", "soft_l1", "cauchy"]

METHODS = {"single-shooting": single_shooting, "multiple-shooting": multiple_shooting}
# Until there is a fit: relative standard deviation of the parameters, and noise [µm].
UNCERTAINTY, NOISE = 0.5, 1.5e-3
# A robust fit is repeated until its scale, taken from the residual, changes by less.
SCALE_CHANGE, SCALE_ROUNDS = 0.02, 5
# Least scale of a robust loss, in parts of the displacement's range: a record without noise has none.
LEAST_SCALE = 1e-9


class BatchFit(EstimatorBase):
    """Output-error fit of a whole record: the free-running model misses the displacement least.

    Statistically the best that a record allows, at the cost of keeping it. `fit` takes a
    record; with the face of a streaming estimator, samples are collected and fitted when `model` or
    another result is asked for.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : ColemanHodgdon or LinearGain, optional
        Its kind is the kind that is fitted; the start is the better of it and the linear least-squares
        fit of the derivative form (`HysteresisRLS` without forgetting). By default a
        Coleman-Hodgdon model from that fit alone.
    offset : bool
        Fit the displacement at zero voltage and w_h = 0 too; else it stays at `initial_model`'s, or 0.
    creep : Creep, optional
        Creep terms: the time constants stay, the gains are fitted from those given. The terms are
        at rest, z = 0, before the first sample.
    method : {"single-shooting", "multiple-shooting"}
        One simulation with its sensitivities, by scipy's trust-region reflective method; or 20
        segments with states of their own and continuity as constraints, by IPOPT with the Gauss-Newton
        Hessian, for records on which the former fails.
    loss : {"linear", "huber", "soft_l1", "cauchy"}
        ``"linear"`` is least squares; the others weigh outliers down, with the scale that gives them
        95 % efficiency on Gaussian noise.
    noise : float, optional
        Standard deviation of the displacement's noise [µm]; by default estimated from the residual.
    fixed : mapping, optional
        Values of parameters to hold: any of ``alpha``, ``beta``, ``gamma`` (or ``gain``), ``offset`` [µm],
        ``initial_state`` [µm], ``creep_gains[0]``, …
    max_iterations : int
        Most passes over the record of the one method, most iterations of the other.
    hop : float, optional
        Seconds of record between fits: results then are those of the last whole multiple. By default,
        all samples collected are fitted whenever a result is asked for.

    Raises
    ------
    ValueError
        If a value is out of its range, or `fixed` names an unknown parameter or leaves none.

    Notes
    -----
    The fit's coordinates are (alpha, beta, gamma/(alpha beta)), in which the admissible set is a box.
    Standard errors take the residual for white noise. Source: L. Ljung, System Identification,
    2nd ed. (1999), ch. 7, 9 and 10.
    """

    _saved_too = ("u", "x")

    __slots__ = ("_creep", "_fitted", "_fixed", "_initial", "_result", "_told", "_u", "_x")

    conformance_exceptions: ClassVar[dict[str, str]] = {
        "run_in_parts_is_one_run": (
            "Each run ends with one fit of all samples so far, which its last row shows; the rows before "
            "show the fit that was held until then. With hop they are the same."
        ),
    }

    def __init__(
        self,
        sample_rate: float,
        *,
        initial_model: ColemanHodgdon | LinearGain | None = None,
        offset: bool = False,
        creep: Creep | None = None,
        method: Method = "single-shooting",
        loss: Loss = "linear",
        noise: float | None = None,
        fixed: Mapping[str, float] | None = None,
        max_iterations: int = 100,
        hop: float | None = None,
    ) -> None:
        sample_rate = moderate("sample_rate", sample_rate)
        if not isinstance(initial_model, ColemanHodgdon | LinearGain | None):
            raise ValueError(f"initial_model must be a ColemanHodgdon or a LinearGain, got {initial_model!r}")
        if isinstance(initial_model, LinearGain) and not initial_model.is_admissible:
            raise ValueError("initial_model has a gain of zero, whose sign is not known: pass a rough value")
        if initial_model is not None:
            check_start(initial_model)
        if not isinstance(creep, Creep | None):
            raise ValueError(f"creep must be a Creep, got {creep!r}: its time constants are kept")
        if method not in tuple(METHODS):
            raise ValueError(f"method must be one of {sorted(METHODS)}, got {method!r}")
        if loss not in tuple(TUNING):
            raise ValueError(f"loss must be one of {sorted(TUNING)}, got {loss!r}")
        self._initial = DEFAULT_MODEL if initial_model is None else initial_model
        self._creep = creep
        if not isinstance(fixed, Mapping | None):
            raise ValueError(f"fixed must be a mapping of names to values, got {fixed!r}")
        if hop is not None and not positive("hop", hop) * sample_rate <= MOST:
            raise ValueError(f"hop must be at most {MOST:g} samples long, got {hop:g} s")
        self._fixed = {name: finite(f"fixed[{name!r}]", value) for name, value in (fixed or {}).items()}
        if not offset:
            self._fixed.setdefault("offset", self._initial.offset)
        self._check_fixed()
        self._begin(
            {
                "sample_rate": sample_rate,
                "initial_model": None if initial_model is None else initial_model.to_dict(),
                "offset": bool(offset),
                "creep": None if creep is None else creep.to_dict(),
                "method": method,
                "loss": loss,
                "noise": None if noise is None else moderate("noise", noise),
                "fixed": {name: float(value) for name, value in (fixed or {}).items()},
                "max_iterations": integer("max_iterations", max_iterations, 1),
                "hop": None if hop is None else float(hop),
            },
            np.zeros(1),  # the number of samples in _u and _x, which grow
        )
        self._u, self._x = np.empty(0), np.empty(0)
        self._result: BatchFitResult | None = None
        self._fitted = self._told = -1

    def _check_fixed(self) -> None:
        varied = self._coordinates()
        if unknown := sorted(set(self._fixed) - set(varied.parameters)):
            raise ValueError(f"fixed holds unknown names {unknown}: choose of {varied.parameters}")
        if not varied.free:
            raise ValueError("fixed leaves nothing to fit: hold fewer parameters")
        own = {name: self._fixed.get(name) for name in ("alpha", "beta", "gamma")}
        if any(value is not None and value <= 0.0 for value in own.values()):
            raise ValueError(f"fixed alpha, beta and gamma must be above zero, got {self._fixed}")
        if None not in own.values() and not ColemanHodgdon(**own).is_admissible:  # type: ignore[arg-type]
            raise ValueError(f"fixed parameters are not admissible: {own}: see ColemanHodgdon")

    def _coordinates(self) -> Coordinates:
        terms = 0 if self._creep is None else self._creep.gains.size
        hysteretic = isinstance(self._initial, ColemanHodgdon)
        return coordinates(hysteretic, tuple(sorted(self._fixed)), terms)

    # ------------------------------------------------------------ collecting

    def _room(self, count: int) -> int:
        """Make room for so many samples more; returns the position of the first."""
        filled = int(self._state[0])
        if filled + count > self._u.size:
            size = max(2 * self._u.size, filled + count, 1024)
            for name in ("_u", "_x"):
                longer = np.empty(size)
                longer[:filled] = getattr(self, name)[:filled]
                setattr(self, name, longer)
        self._state[0] = filled + count
        return filled

    def _sample(self, u: float, x: float) -> None:
        k = self._room(1)
        self._u[k] = u if abs(u) < WILDEST else np.nan
        self._x[k] = x if abs(x) < WILDEST else np.nan

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n = u.size // every, len(self.parameter_names)
        kept = {
            name: np.empty((rows, *shape))
            for name, shape in (("theta", (n,)), ("P", (n, n)), ("y", ()), ("S", ()))
        }
        done = 0
        while done < u.size:
            left = u.size if self._hop is None else self._hop - int(self._state[0]) % self._hop
            end = min(done + left, u.size)
            # Until the last sample of the part is there, its rows hold the fit before it.
            for first, last in ((done, end - 1), (end - 1, end)):
                if last == end:
                    self._collect(u[done:end], x[done:end])
                part = slice(first // every, last // every)
                if part.stop > part.start:
                    for name in ("theta", *want):
                        kept[name][part] = getattr(self, name)
            done = end
        return Trace(
            index=np.arange(every - 1, rows * every, every),
            parameter_names=self.parameter_names,
            theta=kept["theta"],
            **{name: kept[name] for name in want},
        )

    def _collect(self, u: FloatArray, x: FloatArray) -> None:
        k = self._room(u.size)
        self._u[k : k + u.size] = np.where(np.abs(u) < WILDEST, u, np.nan)
        self._x[k : k + x.size] = np.where(np.abs(x) < WILDEST, x, np.nan)

    # ------------------------------------------------------------ fitting

    def fit(self, u: Any, x: Any) -> BatchFitResult:
        """Fit a record; what was collected before is dropped.

        Parameters
        ----------
        u, x : array_like, shape (N,)
            Voltage [V] and measured displacement [µm]; NaN where a sample is missing. A missing
            voltage is taken to go straight from its neighbour before to the one after.

        Returns
        -------
        BatchFitResult
            If the solver failed: the best it came by, and its own words.

        Raises
        ------
        ValueError
            If the shapes do not match, there are too few measured samples, or the voltage of a
            hysteresis model's record never changes.
        """
        u, x = array_1d("u", u, allow_nan=True), array_1d("x", x, allow_nan=True)
        if u.size != x.size:
            raise ValueError(f"u and x must have the same length, got {u.size} and {x.size}")
        self.reset()
        self._collect(u, x)
        least = self._fewest()
        if (count := int(np.count_nonzero(self._usable()))) < least:
            raise ValueError(f"x has {count} samples measured with known u, the fit needs at least {least}")
        if not self._excited(u.size):
            raise ValueError("u never changes: record a voltage that goes up and down")
        self._fitted = self._told = u.size
        self._result = self._solve(u.size)
        return self._result

    def _usable(self) -> Any:
        n = int(self._state[0])
        return np.isfinite(self._u[:n]) & np.isfinite(self._x[:n])

    def _fewest(self) -> int:
        return len(self._coordinates().free) + 1

    def _excited(self, count: int) -> bool:
        known = self._u[:count][np.isfinite(self._u[:count])]
        return isinstance(self._initial, LinearGain) or bool(known.size and np.ptp(known) > 0.0)

    @property
    def _hop(self) -> int | None:
        """Samples between fits."""
        hop = self._arguments["hop"]
        return None if hop is None else max(1, round(hop * self.sample_rate))

    @property
    def result(self) -> BatchFitResult | None:
        """Fit of the samples collected; None while they are too few."""
        count = int(self._state[0])
        if self._hop is not None:
            count -= count % self._hop
        if count != self._fitted:
            usable = np.flatnonzero(self._usable()[:count])
            # What is missing at the end adds nothing, not even by rounding.
            told = int(usable[-1]) + 1 if usable.size else 0
            if told != self._told:
                ready = usable.size >= self._fewest() and self._excited(told)
                self._result = self._solved(told) if ready else None
            self._fitted, self._told = count, told
        return self._result

    def _solved(self, count: int) -> BatchFitResult | None:
        """Fit the first so many samples; None where that is not a number, as a stream must not stop."""
        try:
            with np.errstate(all="ignore"):
                found = self._solve(count)
        except (ValueError, np.linalg.LinAlgError):
            return None
        gain, variance = found._last
        numbers = np.concatenate([found.theta, found.P.ravel(), gain, [found.noise, variance]])
        return found if np.all(np.isfinite(numbers)) else None

    def _solve(self, count: int) -> BatchFitResult:
        """Fit the first so many samples."""
        began = time.perf_counter()
        problem, loss = self._problem(count), self._arguments["loss"]
        gains = np.empty(0) if self._creep is None else self._creep.gains
        given = self._initial if self._arguments["initial_model"] is not None else None
        learn = not {"alpha", "beta", "gamma"} <= set(self._fixed)
        kind = type(self._initial)
        q = best_start(problem, self.sample_rate, given, gains, learn and kind is ColemanHodgdon)
        if loss == "linear":
            solution, scale = self._minimised(problem, q, loss, 1.0), 1.0
        else:
            solution, scale = self._robust(problem, q)
        return report(
            problem, solution, kind, self._creep, loss, scale, self._arguments["noise"],
            self._arguments["method"], began,
        )  # fmt: skip

    def _minimised(self, problem: Problem, q: FloatArray, loss: str, scale: float) -> Solution:
        method = METHODS[self._arguments["method"]]
        return method(problem, q, loss, scale, self._arguments["max_iterations"])

    def _robust(self, problem: Problem, q: FloatArray) -> tuple[Solution, float]:
        """Fit and scale, in turn, until the scale is that of the fit's own residual."""
        noise, wanted = self._arguments["noise"], self._arguments["loss"]
        measured = problem.weight > 0.0
        floor = LEAST_SCALE * (float(np.ptp(problem.x[measured])) or 1.0)
        evaluations, scale, fitted = 0, 0.0, ""
        # A loss that is not convex has false minima, and starts from the fit of one that is.
        for loss in ("soft_l1", *[wanted] * SCALE_ROUNDS):
            sd = spread(problem.evaluate(q)[0][measured]) if noise is None else noise
            last, scale = scale, TUNING[loss] * max(sd, floor)
            if fitted == wanted and abs(scale - last) < SCALE_CHANGE * scale:
                break
            fitted = loss
            solution = self._minimised(problem, q, loss, scale)
            q, evaluations = solution.q, evaluations + solution.evaluations
        return solution._replace(evaluations=evaluations), scale

    def _problem(self, count: int) -> Problem:
        u, x = self._u[:count], self._x[:count]
        known = np.isfinite(u)
        if not known.all():
            index = np.arange(count)
            u, x = np.interp(index, index[known], u[known]), np.where(known, x, np.nan)
        held = np.array([self._fixed[name] for name in sorted(self._fixed)])
        decays = np.empty(0) if self._creep is None else self._creep.decays(self.sample_rate)
        return Problem(u, x, self._coordinates(), held, decays)

    # ------------------------------------------------------------ the face

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`; a last one, ``offset``, where it is fitted."""
        names = self._initial.parameter_names
        return names if "offset" in self._fixed else (*names, "offset")

    @property
    def theta(self) -> FloatArray:
        """Parameters, shape (n,): of the fit, or of the initial model while there is none."""
        fit = self.result
        if fit is None:
            return np.append(self._initial.theta, self._initial.offset)[: len(self.parameter_names)]
        return fit.theta[: len(self.parameter_names)].copy()

    @property
    def model(self) -> ColemanHodgdon | LinearGain:
        """Admissible model: of the fit, or the initial one while there is none.

        Its slope is at least 1 % of that of the initial model, where one was given.
        """
        fit = self.result
        if fit is None:
            return self._initial
        given = self._arguments["initial_model"] is not None
        return large_enough(fit.model, self._initial) if given else fit.model

    @property
    def P(self) -> FloatArray:
        """Covariance of `theta`, shape (n, n); while there is no fit, that of a rough guess."""
        fit, n = self.result, len(self.parameter_names)
        if fit is None:
            return np.diag((UNCERTAINTY * np.maximum(np.abs(self.theta), 1.0 * (self.theta == 0.0))) ** 2)
        return fit.P[:n, :n].copy()

    @property
    def standard_errors(self) -> FloatArray:
        """Square roots of the diagonal of `P`, shape (n,)."""
        return np.sqrt(np.fmax(np.diag(self.P), 0.0))

    @property
    def y(self) -> float:
        """Last measured sample less the fit [µm]; 0 while there is none."""
        fit = self.result
        return 0.0 if fit is None else float(fit.residual[np.isfinite(fit.residual)][-1])

    @property
    def S(self) -> float:
        """Variance of a sample like the last about the fit [µm²]."""
        fit = self.result
        if fit is None:
            return float(self._arguments["noise"] or NOISE) ** 2
        return fit.noise**2 + fit._last[1]

    @property
    def K(self) -> FloatArray:
        """Gain that one more sample like the last would have on `theta`, shape (n,)."""
        fit, n = self.result, len(self.parameter_names)
        if fit is None or self.S == 0.0:
            return np.zeros(n)
        return fit._last[0][:n] / self.S

    @property
    def status(self) -> Status:
        """What happened to the samples so far; how the solver fared is in `result`."""
        usable = self._usable()
        updates = int(np.count_nonzero(usable))
        last = "waiting" if usable.size == 0 else "updated" if usable[-1] else "missing"
        return Status(usable.size, updates, usable.size - updates, 0, 0, False, last)

    def reset(self) -> None:
        """Return to the state after construction; the record is dropped."""
        super().reset()
        self._u, self._x = np.empty(0), np.empty(0)
        self._result, self._fitted, self._told = None, -1, -1

    def to_dict(self) -> dict[str, Any]:
        """Return arguments and record as a JSON-safe dictionary; `from_dict` resumes bit for bit."""
        n = int(self._state[0])
        record = {
            name: [value if np.isfinite(value) else None for value in values[:n].tolist()]
            for name, values in (("u", self._u), ("x", self._x))
        }
        return {**super().to_dict(), **record}

    @classmethod
    def _revive(cls, arguments: dict[str, Any]) -> dict[str, Any]:
        creep = arguments["creep"]
        return {**super()._revive(arguments), "creep": None if creep is None else Creep.from_dict(creep)}

    def _table(self) -> Table:
        return Table((Block(0, "the number of samples", COUNT),))

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Make an estimator that continues where `to_dict` was called.

        Parameters
        ----------
        data : dict
            What `to_dict` returned, also after a round trip through JSON.

        Raises
        ------
        ValueError
            If the dictionary is of another class or format, a field is missing or unknown, an argument is
            refused, or its record does not fit.
        """
        estimator = super().from_dict(data)
        n, estimator._state[0] = int(estimator._state[0]), 0.0
        u, x = (array_1d(name, data[name], allow_nan=True) for name in ("u", "x"))
        if not u.size == x.size == n:
            raise ValueError(f"u and x must hold the state's {n} samples, got {u.size} and {x.size}")
        estimator._collect(u, x)
        return estimator
