"""Output-error fit of a whole record, on CasADi."""

import time
from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np

from piezoest._checks import WILDEST, FloatArray, array_1d, finite, instance, integer, moderate, positive
from piezoest.estimators.base import DEFAULT_MODEL, Status
from piezoest.estimators.batch_result import BatchFitResult
from piezoest.estimators.hopping import LEAST_HANDED_OUT, Hopping
from piezoest.fitting.coordinates import Coordinates, bridged, coordinates
from piezoest.fitting.gauss_newton import robust, single_shooting
from piezoest.fitting.losses import TUNING
from piezoest.fitting.multiple_shooting import multiple_shooting
from piezoest.fitting.outcome import outcome
from piezoest.fitting.problem import Problem
from piezoest.fitting.start import best_start
from piezoest.layout import COUNT, MOST, record
from piezoest.models import Creep, FreeRunning

Method = Literal["single-shooting", "multiple-shooting"]
Loss = Literal["linear", "huber", "soft_l1", "cauchy"]

METHODS = {"single-shooting": single_shooting, "multiple-shooting": multiple_shooting}
# Until there is a fit: relative standard deviation of the parameters, and noise [µm].
UNCERTAINTY, NOISE = 0.5, 1.5e-3

# Beside it there is the record, which grows.
STATE = record(samples=COUNT)


class BatchFit(Hopping):
    """Output-error fit of a whole record: minimises the error of the simulated displacement.

    This is the most accurate use of a record, but the record must be stored. `fit` fits a record. With
    ``step`` and ``run`` samples are collected, and fitted when `model` or another result is read.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : FreeRunning, optional
        A ColemanHodgdon, a LinearGain or another model that can be fitted; a model of this class is fitted.
        The fit starts from it or, for Coleman-Hodgdon, from the best of fits that are linear for a given
        alpha, whichever misses less. Default: a Coleman-Hodgdon model that is scaled to the record.
    offset : bool
        Also fit the displacement at zero voltage and w_h = 0; else it is `initial_model`'s, or 0.
    creep : Creep, optional
        Creep terms. The gains are fitted and the time constants are kept. Before the first sample the terms
        are at rest, z = 0.
    method : {"single-shooting", "multiple-shooting"}
        ``"single-shooting"``: Gauss-Newton steps, each a convex program with bounds on the sensitivities of
        one simulation. ``"multiple-shooting"``: 20 segments with continuity as constraints, by IPOPT with the
        Gauss-Newton Hessian, for records on which the first method fails.
    loss : {"linear", "huber", "soft_l1", "cauchy"}
        ``"linear"`` is least squares. The others reduce the weight of outliers; their scale gives 95 %
        efficiency for Gaussian noise.
    noise : float, optional
        Standard deviation of the displacement's noise [µm]. Default: estimated from the residual.
    fixed : mapping, optional
        Values of parameters that are not fitted: any of ``alpha``, ``beta``, ``gamma`` (or ``gain``),
        ``offset`` [µm], ``initial_state`` [µm], ``creep_gains[0]``, …
    max_iterations : int
        Largest number of passes over the record, or of iterations with multiple shooting.
    hop : float, optional
        Seconds of record between fits; results then belong to the last whole multiple. Default: all
        collected samples are fitted whenever a result is read.

    Raises
    ------
    ValueError
        If a value is out of its range, or `fixed` names an unknown parameter or leaves none.

    Notes
    -----
    The fit uses the coordinates (alpha, beta, gamma/(alpha beta)), in which the admissible set is a box.
    Standard errors assume that the residual is white noise. Source: L. Ljung, System Identification,
    2nd ed. (1999), ch. 7, 9 and 10.

    Examples
    --------
    >>> import piezoest as pz
    >>> fs, true = 1000.0, pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
    >>> u = pz.signals.triangle(amplitude=33.0, frequency=5.0, periods=3, sample_rate=fs).values
    >>> estimator = pz.BatchFit(fs)
    >>> trace = estimator.run(u, true.simulate(u))
    >>> estimator.theta.round(5)
    array([0.021  , 0.147  , 0.00429])
    """

    _saved_too = ("u", "x")

    __slots__ = ("_creep", "_fitted", "_fixed", "_found", "_hop", "_last_used", "_record")

    conformance_exceptions: ClassVar[dict[str, str]] = {
        "run_in_parts_is_one_run": (
            "Each run ends with one fit of all samples so far, which its last row shows; the rows before "
            "show the fit that was held until then. With hop they are the same."
        )
    }

    def __init__(
        self,
        sample_rate: float,
        *,
        initial_model: FreeRunning | None = None,
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
        initial = self._start_from(initial_model, FreeRunning, admissible=False)
        initial.coordinate_values()  # refuses what has no admissible model near it
        self._creep = instance("creep", creep, Creep | None, "a Creep: its time constants are kept")
        for name, given, known in (("method", method, METHODS), ("loss", loss, TUNING)):
            if given not in tuple(known):
                raise ValueError(f"{name} must be one of {sorted(known)}, got {given!r}")
        fixed = instance("fixed", {} if fixed is None else fixed, Mapping, "a mapping of names to values")
        if hop is not None and not positive("hop", hop) * sample_rate <= MOST:
            raise ValueError(f"hop must be at most {MOST:g} samples long, got {hop:g} s")
        self._fixed = {name: finite(f"fixed[{name!r}]", value) for name, value in fixed.items()}
        given_fixed = dict(self._fixed)
        if not offset:
            self._fixed.setdefault("offset", self._initial.offset)
        varied = self._coordinates
        if unknown := sorted(set(self._fixed) - set(varied.parameters)):
            raise ValueError(f"fixed holds unknown names {unknown}: choose from {varied.parameters}")
        if not varied.free:
            raise ValueError("fixed leaves nothing to fit: hold fewer parameters")
        varied.model.check_fixed(self._fixed)
        self._hop = None if hop is None else max(1, round(hop * sample_rate))
        self._begin(
            {
                "sample_rate": sample_rate,
                "initial_model": None if initial_model is None else initial_model.to_dict(),
                "offset": bool(offset),
                "creep": None if creep is None else creep.to_dict(),
                "method": method,
                "loss": loss,
                "noise": None if noise is None else moderate("noise", noise),
                "fixed": given_fixed,
                "max_iterations": integer("max_iterations", max_iterations, 1),
                "hop": None if hop is None else float(hop),
            },
            STATE,
            {},
        )
        self._forget()

    def _forget(self) -> None:
        """Begin with an empty record, of which nothing is found."""
        self._record = np.empty((2, 0))
        self._found: BatchFitResult | None = None
        self._fitted = self._last_used = -1

    @property
    def _coordinates(self) -> Coordinates:
        terms = 0 if self._creep is None else self._creep.gains.size
        return coordinates(type(self._initial), tuple(sorted(self._fixed)), terms)

    @property
    def _count(self) -> int:
        return int(self._state["samples"])

    def _lengthen(self, filled: int, least: int) -> None:
        """Make room for so many samples in all."""
        longer = np.empty((2, max(2 * filled, least, 1024)))
        longer[:, :filled] = self._record[:, :filled]
        self._record = longer

    def _sample(self, u: float, x: float) -> None:
        samples = self._state["samples"]
        k = int(samples)
        if k == self._record.shape[1]:
            self._lengthen(k, k + 1)
        self._record[0, k] = u if abs(u) < WILDEST else np.nan
        self._record[1, k] = x if abs(x) < WILDEST else np.nan
        samples[...] = k + 1

    def _collect(self, u: FloatArray, x: FloatArray) -> None:
        k, given = self._count, np.array([u, x])
        if (end := k + u.size) > self._record.shape[1]:
            self._lengthen(k, end)
        self._record[:, k:end] = np.where(np.abs(given) < WILDEST, given, np.nan)
        self._state["samples"] = end

    @property
    def _left(self) -> int | None:
        return None if self._hop is None else self._hop - self._count % self._hop

    def _usable(self) -> Any:
        return np.all(np.isfinite(self._record[:, : self._count]), axis=0)

    def _lacking(self, count: int) -> str:
        """What the first so many samples lack for a fit; empty if nothing."""
        usable, least = int(np.count_nonzero(self._usable()[:count])), len(self._coordinates.free) + 1
        if usable < least:
            return f"x has {usable} samples measured with known u, the fit needs at least {least}"
        if self._initial.state_names and not np.nanmin(u := self._record[0, :count]) < np.nanmax(u):
            return "u never changes: record a voltage that goes up and down"
        return ""

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
            If the solver failed: the best that it found, and its own words.

        Raises
        ------
        ValueError
            If the shapes do not match, there are too few measured samples, or the voltage of a
            hysteresis model's record never changes.
        """
        u, x = self._records(u, x)
        self.reset()
        self._collect(u, x)
        if lacking := self._lacking(u.size):
            raise ValueError(lacking)
        self._fitted = self._last_used = u.size
        self._found = found = self._solve(u.size)
        return found

    @property
    def result(self) -> BatchFitResult | None:
        """Fit of the samples collected; None while they are too few."""
        count = self._count
        count -= 0 if self._hop is None else count % self._hop
        if count != self._fitted:
            usable = np.flatnonzero(self._usable()[:count])
            # What is missing at the end adds nothing, not even by rounding.
            used = int(usable[-1]) + 1 if usable.size else 0
            if used != self._last_used:
                self._found = None if self._lacking(used) else self._solved(used)
            self._fitted, self._last_used = count, used
        return self._found

    def _solved(self, count: int) -> BatchFitResult | None:
        """Fit the first so many samples; None where that is not a number, as a stream must not stop."""
        try:
            with np.errstate(all="ignore"):
                found = self._solve(count)
        except (ValueError, np.linalg.LinAlgError):
            return None
        return found if found.is_finite else None

    def _solve(self, count: int) -> BatchFitResult:
        """Fit the first so many samples."""
        began = time.perf_counter()
        arguments, creep = self._arguments, self._creep
        loss, noise = arguments["loss"], arguments["noise"]
        gains = {} if creep is None else {f"creep_gains[{i}]": g for i, g in enumerate(creep.gains)}
        u, x = self._record[:, :count]
        problem = Problem(
            bridged(u),
            np.where(np.isfinite(u), x, np.nan),
            self._coordinates,
            np.array([self._fixed[name] for name in self._coordinates.held]),
            None if creep is None else creep.decays(self.sample_rate),
        )
        given = None if arguments["initial_model"] is None else self._initial
        q = best_start(problem, given, DEFAULT_MODEL, gains)
        solve = partial(METHODS[arguments["method"]], max_iterations=arguments["max_iterations"])
        solution, scale = robust(problem, q, loss, noise, solve)
        end = outcome(problem, solution.q, loss, scale, noise)
        value = end.value
        return BatchFitResult(
            **{field.name: getattr(end, field.name) for field in fields(end)},
            model=self._model_of(np.append(end.theta[: self._initial.theta.size], value["offset"])),
            creep=None if creep is None else Creep([value[name] for name in gains], creep.time_constants),
            success=solution.success,
            message=solution.message,
            evaluations=solution.evaluations,
            seconds=time.perf_counter() - began,
            method=arguments["method"],
        )

    @property
    def theta(self) -> FloatArray:
        """Parameters, shape (n,): of the fit, or of the initial model while there is none."""
        fit = self.result
        if fit is None:
            return np.append(self._initial.theta, self._initial.offset)[: len(self.parameter_names)]
        return fit.theta[: len(self.parameter_names)].copy()

    @property
    def model(self) -> FreeRunning:
        """Admissible model: of the fit, or the initial one while there is none.

        Its slope is at least 1 % of that of the initial model, where one was given.
        """
        fit = self.result
        if fit is None:
            return self._initial
        given = self._arguments["initial_model"] is not None
        return fit.model.lifted(self._initial, LEAST_HANDED_OUT) if given else fit.model

    @property
    def P(self) -> FloatArray:
        """Covariance of `theta`, shape (n, n); while there is no fit, that of a rough guess."""
        fit, n = self.result, len(self.parameter_names)
        if fit is None:
            return np.diag((UNCERTAINTY * np.maximum(np.abs(self.theta), 1.0 * (self.theta == 0.0))) ** 2)
        return fit.P[:n, :n].copy()

    @property
    def y(self) -> float:
        """Last measured sample less the fit [µm]; 0 while there is none."""
        fit = self.result
        return 0.0 if fit is None else float(fit.residual[np.isfinite(fit.residual)][-1])

    @property
    def S(self) -> float:
        """Variance of a sample like the last about the fit [µm²]."""
        if (fit := self.result) is None:
            return float(self._arguments["noise"] or NOISE) ** 2
        return fit.noise**2 + fit.last_variance

    @property
    def K(self) -> FloatArray:
        """Gain that one more sample like the last would have on `theta`, shape (n,)."""
        n, S = len(self.parameter_names), self.S
        return np.zeros(n) if (fit := self.result) is None or S == 0.0 else fit.last_covariance[:n] / S

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
        self._forget()

    def to_dict(self) -> dict[str, Any]:
        """Return arguments and record as a JSON-safe dictionary, from which `from_dict` continues exactly."""
        rows = self._record[:, : self._count].tolist()
        given = ([value if np.isfinite(value) else None for value in row] for row in rows)
        return super().to_dict() | dict(zip(self._saved_too, given, strict=True))

    def _restore(self, data: dict[str, Any]) -> None:
        super()._restore(data)
        n, self._state["samples"] = self._count, 0.0
        u, x = (array_1d(name, data[name], allow_nan=True) for name in self._saved_too)
        if not u.size == x.size == n:
            raise ValueError(f"u and x must hold the state's {n} samples, got {u.size} and {x.size}")
        self._collect(u, x)
