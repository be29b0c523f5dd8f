"""One fit for every model: a record in, the model that misses it least out, and how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from piezoest._checks import FloatArray, array_1d, finite, fraction, positive
from piezoest.estimators.coordinates import bridged, late
from piezoest.fitting import search, trust
from piezoest.fitting.design import Design
from piezoest.fitting.flaws import Flaws, flawed
from piezoest.fitting.forms import FORMS, Form
from piezoest.fitting.loop_columns import LoopColumns
from piezoest.fitting.outliers import lonely, unsettled
from piezoest.fitting.play_columns import PlayColumns
from piezoest.fitting.polish import polished
from piezoest.fitting.regression import Fitted, Log, Regression, sums_of
from piezoest.fitting.runs import BoolArray
from piezoest.models import Model
from piezoest.symbolic import quadratic_solver

FEWEST_SAMPLES = 50
# Times that a start which has not settled is looked for, each without what was found before.
PASSES = 3
NONLINEAR = "SciPy's least squares, with derivatives by CasADi"
LINEAR = "{} through CasADi; SciPy's bounded least squares agrees to {:.0e}"


class Prediction(NamedTuple):
    """Displacement (N,) [µm], and between what a reading is to be expected, 95 times in 100."""

    x: FloatArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True)
class Fit:
    """A model fitted to a record.

    Parameters
    ----------
    model : Model
        With offset.
    form : str
        Its kind, one of `FORMS`.
    parameters : int
        How many were fitted; slopes at their bound do not count.
    standard_errors : dict of str to float
        Of the parameters that were estimated, by their names, in their units; honest for residuals that are
        not white.
    delay : float
        Samples by which the displacement lags the voltage.
    delay_estimated : bool
        Whether the delay was estimated.
    initial_state : float or ndarray
        What `model.simulate` is to begin with on this record: plays [V]; a loop, and behind plays creep [µm].
    held_out : float
        Root of the mean square of what each of five blocks but the first misses under the fit of the
        others [µm].
    ahead : float
        The same of the last two blocks under the fit of those before them [µm].
    spread : Spread
        How far readings lie from the prediction, 95 times in 100 [µm].
    counts : ndarray of bool, shape (N,)
        Which samples were fitted: not those that are missing, spikes, or not yet settled.
    left_out : int
        Samples at the start that were left out, because the stage had not settled.
    spikes : int
        Samples that were left out because they alone are far off.
    drift : float
        Drift over the record that was fitted beside the model [µm].
    solver : str
        What solved, and what checked it.
    """

    model: Model
    form: str
    parameters: int
    standard_errors: dict[str, float]
    delay: float
    delay_estimated: bool
    initial_state: Any = field(repr=False)
    held_out: float
    ahead: float
    spread: trust.Spread
    counts: BoolArray = field(repr=False)
    left_out: int
    spikes: int
    drift: float
    solver: str
    _design: Design = field(repr=False)
    _w: FloatArray = field(repr=False)
    _rest: FloatArray = field(repr=False)
    _u: FloatArray = field(repr=False)

    @property
    def label(self) -> str:
        """Kind of the model in words."""
        return FORMS[self.form].label

    def predict(self, u: FloatArray | None = None) -> Prediction:
        """Free-running displacement, which sees only the voltage.

        Parameters
        ----------
        u : array_like, shape (N,), optional
            Voltage [V] of another record, from a stage that rests at 0 V before it; by default the fitted
            record's, with its drift and jumps.
        """
        if u is None:
            return self.continued(self._u)
        half = self.spread.along(_without_gaps(u), np.zeros(1))
        x = self.elsewhere(u)
        return Prediction(x, x - half, x + half)

    def elsewhere(self, u: FloatArray, *, sample_rate: float | None = None) -> FloatArray:
        """Displacement along a voltage, from a stage that rests at 0 V before it [µm].

        Drift and jumps are not in it.

        Parameters
        ----------
        u : ndarray, shape (N,)
            [V].
        sample_rate : float, optional
            [Hz]; by default that of the fitted record.
        """
        u, own = _without_gaps(u), self._design.sample_rate
        rate = own if sample_rate is None else positive("sample_rate", sample_rate)
        v = late(u, self.delay * rate / own)
        design, w = replace(self._design.afresh(v[0]), sample_rate=rate), self._w.copy()
        w[design.crept] = self._rest
        w[design.offset + 1 :] = 0.0
        return design.output(v, w)

    def continued(self, u: FloatArray) -> Prediction:
        """Displacement along a voltage that begins as the fitted one does, and goes on.

        What had drifted by the end of the record stays.

        Parameters
        ----------
        u : array_like, shape (N,)
            [V].
        """
        u = _without_gaps(u)
        x = self._design.output(late(u, self.delay), self._w)
        half = self.spread.along(u, np.maximum(np.arange(u.size) - self._u.size, 0.0))
        return Prediction(x, x - half, x + half)

    def __repr__(self) -> str:
        return (
            f"<Fit of {self.label}: {self.held_out:.3g} µm rms on blocks left out, "
            f"{self.parameters} parameters, delay {self.delay:.3g} samples>"
        )


def fit(
    u: FloatArray,
    x: FloatArray,
    *,
    sample_rate: float,
    model: str = "plays",
    delay: float | Literal["auto"] = 0.0,
    flaws: Flaws | None = None,
    settle: float | None = None,
) -> Fit:
    """Fit a model to a record: what the free-running model misses is least.

    All in which a model is linear (slopes of plays, their bends, gain, offset, drift, jumps) is one convex
    program, solved by CasADi and checked by SciPy. Smoothness of neighbouring slopes is chosen by five
    blocks of which each is predicted from the others. Creep gains, alpha, the delay and the stage's state
    before the record are found outside it. Spikes and dropouts are left out, and so is a start that has
    not settled; jumps of the displacement are fitted beside the model.

    Parameters
    ----------
    u, x : array_like, shape (N,)
        Voltage [V] and displacement [µm]; NaN where a sample is missing.
    sample_rate : float
        [Hz].
    model : str
        One of ``"line"``, ``"coleman-hodgdon"``, ``"plays"``, ``"plays-creep"``, ``"plays-asymmetric"`` and
        ``"plays-asymmetric-creep"``.
    delay : float or "auto"
        Samples by which the displacement lags the voltage, 0 to 10; ``"auto"`` looks for it. A record of one
        amplitude and frequency cannot tell it from the width of the loop.
    flaws : Flaws, optional
        Spikes, dropouts and jumps; by default they are looked for.
    settle : float, optional
        Seconds to leave out at the start; by default as long as it is off by more than four robust standard
        deviations, at most a fifth.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        If the arrays differ in length or hold too few samples, the voltage does not move, the displacement
        falls as it rises, or an argument is unknown or out of its range.

    Examples
    --------
    >>> import numpy as np, piezoest as pz
    >>> u = 50.0 + 40.0 * np.sin(np.linspace(0.0, 60.0, 6000))
    >>> x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u, allow_jumps=True)
    >>> found = pz.fit(u, x, sample_rate=1000.0, model="coleman-hodgdon")
    >>> print(np.round(found.model.alpha, 4))
    0.02
    """
    _known(model)
    return Fitter(u, x, sample_rate=sample_rate, delay=delay, flaws=flaws, settle=settle).form(model)


def _without_gaps(u: FloatArray) -> FloatArray:
    u = array_1d("u", u, allow_nan=True)
    if not np.any(np.isfinite(u)):
        raise ValueError(f"u must hold a voltage, none of its {u.size} samples is a number")
    return bridged(u)


def _known(model: str) -> None:
    if model not in FORMS:
        raise ValueError(f"model must be one of {', '.join(FORMS)}, got {model!r}")


class Fitter:
    """A record made ready for fits of all kinds, with one delay, one start and the same samples left out.

    The parameters are those of `fit`. `start` says where plays were before the record, `delay` is the one
    used, and `delay_estimated`, `left_out` and `spikes` are as in `Fit`.
    """

    def __init__(
        self,
        u: FloatArray,
        x: FloatArray,
        *,
        sample_rate: float,
        delay: float | Literal["auto"] = 0.0,
        flaws: Flaws | None = None,
        settle: float | None = None,
    ) -> None:
        u, x = (array_1d(name, each, allow_nan=True) for name, each in (("u", u), ("x", x)))
        if u.size != x.size:
            raise ValueError(f"u and x must have one length, got {u.size} and {x.size}")
        self._rate = positive("sample_rate", sample_rate)
        counts = np.isfinite(u) & np.isfinite(x)
        if np.count_nonzero(counts) < FEWEST_SAMPLES:
            raise ValueError(
                f"u and x have {np.count_nonzero(counts)} samples in common, at least {FEWEST_SAMPLES} are "
                "needed"
            )
        self._given = bridged(u)
        if np.ptp(self._given) == 0.0:
            raise ValueError(f"u must move, it stays at {self._given[0]:g} V")
        if isinstance(delay, str) and delay != "auto":
            raise ValueError(f"delay must be 'auto' or a number of samples, got {delay!r}")
        if delay != "auto":
            delay = fraction("delay", finite("delay", delay), 0.0, search.LONGEST_DELAY)
        flaws = flawed(u, x) if flaws is None else flaws
        if flaws.unusable.size != u.size:
            raise ValueError(f"flaws must be those of u and x: {u.size} samples, got {flaws.unusable.size}")
        counts &= ~flaws.unusable
        self.delay_estimated = delay == "auto"
        self._log = Log(
            self._given, np.where(counts, x, 0.0), counts, self._rate, flaws.jumps.astype(np.float64)
        )
        gain = search.line_gain(self._log)
        if gain <= 0.0:
            raise ValueError(
                f"x must rise with u, a straight line has {gain:.4g} µm/V: change the sign of one of them"
            )
        self.start = search.best_start(self._log)
        self.delay = search.best_delay(self._log, self.start) if isinstance(delay, str) else delay
        self._log = replace(self._log, u=late(self._given, self.delay))
        self.start = search.best_start(self._log)
        self._leave_out(settle)

    def _leave_out(self, settle: float | None) -> None:
        """Do without what plays with bends show to be spikes, and a start that has not settled."""
        given, self.left_out = self._log, 0
        if settle is not None:
            self.left_out = int(fraction("settle", settle, 0.0, 0.5 * given.u.size / self._rate) * self._rate)
        for _ in range(PASSES):
            # Without the first block, for what happens at the start must not be explained by it.
            bent = self._bent
            others = bent.all.plus(bent.sums[0], -1.0)
            w = bent.solved(search.SMOOTH, bent.columns(drift=False), others)
            residual = np.where(given.counts, given.x - bent.design.output(given.u, w), np.nan)
            further = self.left_out if settle is not None else max(unsettled(residual), self.left_out)
            spikes = lonely(residual)
            spikes[:further] = False
            counts = given.counts & ~spikes
            counts[:further] = False
            self._log, settled = replace(given, counts=counts), further == self.left_out
            self.left_out = further
            del self._bent
            if settled:
                break
            # What had not settled had looked like another start, and moved the fit.
            self.start = search.best_start(self._log)
        self.spikes = int(np.count_nonzero(spikes))

    @property
    def _bent_plays(self) -> PlayColumns:
        return search.plays(self._log, self.start, bends=search.BENDS)

    @cached_property
    def _bent(self) -> Regression:
        """Sums of plays with bends, from which those without follow."""
        return search.regression(self._log, self._bent_plays)

    @cached_property
    def _plain(self) -> dict[bool, Fitted]:
        """Plays without creep, with and without bends."""
        bent = self._bent
        basis, T = self._bent_plays.merged()
        design = replace(bent.design, basis=basis)
        sums = [each.combined(bent.design.basis.size, T) for each in bent.sums]
        return {True: bent.best(), False: Regression(design, sums).best()}

    def form(self, name: str) -> Fit:
        """Fit a model of one kind.

        Parameters
        ----------
        name : str
            One of `FORMS`.
        """
        _known(name)
        fitted = self._fitted(FORMS[name])
        return self._outcome(name, fitted)

    def _fitted(self, form: Form) -> Fitted:
        if form.loop:
            every = max(1, int(np.count_nonzero(self._log.counts)) // 20_000)
            return search.regression(self._log, LoopColumns(search.best_alpha(self._log, every))).best()
        if not form.plays:
            return search.regression(self._log, search.plays(self._log, self.start, 1)).best()
        plain = self._plain[form.bends]
        return search.with_creep(self._log, plain, search.creep_times(self._log)) if form.creep else plain

    def _outcome(self, name: str, fitted: Fitted) -> Fit:
        """Model and figures of a fit, made final by the nonlinear program where there is one."""
        form, log = FORMS[name], self._log
        delay = self.delay
        if form.loop:
            given = replace(log, u=self._given)
            fitted, delay, errors = polished(given, fitted, delay, fit_delay=self.delay_estimated)
            log = replace(log, u=late(self._given, delay))
            again = search.regression(log, fitted.design.basis).best()
            fitted = replace(again, w=fitted.w)
            solver, parameters = NONLINEAR, 5 + self.delay_estimated
        else:
            regressed = Regression(
                fitted.design, sums_of(fitted.design, log, fitted.w[: fitted.design.basis.size])
            )
            solver = LINEAR.format(quadratic_solver(), regressed.gap(fitted))
            # Creep gains are no columns of the last linear program, but they were fitted as well.
            with_gains = replace(fitted, used=np.union1d(fitted.used, np.r_[fitted.design.gains]))
            errors = trust.standard_errors(regressed, with_gains, log)
            parameters = int(trust.free_columns(regressed, with_gains).size)
        missed = trust.residuals(fitted, log)
        wider, rest = _beyond(fitted)
        design, w = wider if fitted.design.basis.goes_on else (fitted.design, fitted.w)
        own, creep = w[: design.basis.size], design.creep if design.terms else None
        model = design.basis.model(own, float(w[design.offset]), creep, log.sample_rate)
        return Fit(
            model=model,
            form=name,
            parameters=parameters,
            standard_errors={
                name: errors.get(name, 0.0) for name in (*model.parameter_names, "offset", "delay")
            },
            delay=delay,
            delay_estimated=self.delay_estimated,
            initial_state=_initial_state(design, w, model),
            held_out=fitted.held_out,
            ahead=fitted.ahead,
            spread=trust.spread_of(missed, log, model.line[0]),
            counts=log.counts,
            left_out=self.left_out,
            spikes=self.spikes,
            drift=float(w[design.offset + 1]),
            solver=solver,
            _design=wider[0],
            _w=wider[1],
            _rest=rest,
            _u=self._given,
        )


def _initial_state(design: Design, w: FloatArray, model: Model) -> Any:
    """What the model's `simulate` is to begin with: of creep, its terms relative to their gains."""
    state = design.basis.initial_state(w[: design.basis.size], model)
    return np.concatenate([state, w[design.crept] / design.creep.gains]) if design.terms else state


def _beyond(fitted: Fitted) -> tuple[tuple[Design, FloatArray], FloatArray]:
    """Design and coefficients that go on beyond the record, and what creep has of that at rest [µm]."""
    size = fitted.design.basis.size
    basis, w, added = fitted.design.basis.beyond(fitted.w[:size])
    design = replace(fitted.design, basis=basis)
    w = np.concatenate([w, fitted.w[size:]])
    # Creep would follow what they add, too.
    rest = design.creep.gains * added
    w[design.crept] += rest
    w[design.offset] -= added + float(rest.sum())
    return (design, w), rest
