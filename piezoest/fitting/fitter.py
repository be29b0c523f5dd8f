"""One fit for every model: a record in, the model that misses it least out, and how far to trust it."""

from dataclasses import replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from piezoest._checks import FloatArray, array_1d, fraction, instance, positive
from piezoest.fitting import search, trust
from piezoest.fitting.coordinates import bridged, late
from piezoest.fitting.design import Design
from piezoest.fitting.flaws import Flaws, flawed
from piezoest.fitting.forms import FORMS, Form
from piezoest.fitting.gaps import remembered
from piezoest.fitting.jumps import jumps_left
from piezoest.fitting.loop_columns import LoopColumns
from piezoest.fitting.outliers import beside_steps, lonely, unsettled
from piezoest.fitting.play_columns import PlayColumns, Start
from piezoest.fitting.polish import Polished, polished
from piezoest.fitting.regression import Fitted, Log, Regression
from piezoest.fitting.result import Fit
from piezoest.models import Model
from piezoest.symbolic import quadratic_solver

FEWEST_SAMPLES = 50
# A displacement that rises by no more than this fraction of its size over the record stands still.
ROUNDING = 1e-9
# Part of the displacement's scatter that a straight line does not leave, if both belong together.
UNRELATED = 0.5
FALLS, OTHER_RUN = "change the sign of one, or undo a delay", "check that both are of one run and one axis"
# Times that a start which has not settled is looked for, each without what was found before.
PASSES = 3
# A jump beside the motion is one if only this part of the squares is left with it.
CLEAR_JUMP = 0.7
# Another delay must leave less than this part of what is missed.
CLEARLY_LESS = 0.95
SOLVER = "{} through CasADi; SciPy's bounded least squares agrees to {:.0e}"


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
    """Fit one kind of model to a record, by the error of the simulated displacement.

    All in which a model is linear (slopes of plays, their bends, gain, offset, drift, jumps) is one convex
    program, solved by CasADi and checked by SciPy. The record is cut into five blocks. How smooth
    neighbouring slopes must be is chosen by how well each block but the first is predicted from the others.
    Creep gains, alpha, the delay and the stage's state before the record are found outside it. Spikes,
    dropouts and clipped readings are left out, and so is a start that has not settled; jumps of the
    displacement are fitted beside the model.

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
        Spikes, dropouts, clipped readings and jumps; by default they are looked for.
    settle : float, optional
        Time to leave out at the start [s]. Default: twice the time for which the error exceeds four robust
        standard deviations, at most a tenth of the record.

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
    fitter = Fitter(
        u, x, sample_rate=sample_rate, delay=delay, flaws=flaws, settle=settle, plays=FORMS[model].plays
    )
    return fitter.form(model)


def _known(model: str) -> None:
    if model not in FORMS:
        raise ValueError(f"model must be one of {', '.join(FORMS)}, got {model!r}")


class Fitter:
    """A record made ready for fits of all kinds, with one delay, one start and the same samples left out.

    The parameters are those of `fit`; without `plays` it is only for kinds that have none, and faster. A
    record that does not tell a lag from a wider loop has none where plays find none.
    `start` says where plays were before the record, `delay` is the one used, and `delay_estimated`,
    `left_out`, `spikes` and `jumps` are as in `Fit`.
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
        plays: bool = True,
        tells_lag: bool = True,
    ) -> None:
        self._rate = positive("sample_rate", sample_rate)
        rate = self._rate
        u, x = (array_1d(*each, allow_nan=True, sample_rate=rate) for each in (("u", u), ("x", x)))
        if u.size != x.size:
            raise ValueError(f"u and x must have one length, got {u.size} and {x.size}")
        counts = np.isfinite(u) & np.isfinite(x)
        if np.count_nonzero(counts) < FEWEST_SAMPLES:
            raise ValueError(
                f"u and x have {np.count_nonzero(counts)} samples in common, at least {FEWEST_SAMPLES} are "
                "needed"
            )
        delay = search.checked_delay(delay)
        flaws = flawed(u, x) if flaws is None else instance("flaws", flaws, Flaws, "what flawed() gave")
        if flaws.unusable.size != u.size:
            raise ValueError(f"flaws must be those of u and x: {u.size} samples, got {flaws.unusable.size}")
        u = flaws.without(u)
        self._given = bridged(u)
        if np.ptp(self._given) == 0.0:
            raise ValueError(f"u must move, it stays at {self._given[0]:g} V")
        self._near_steps = beside_steps(self._given)
        counts &= ~flaws.unusable
        counts = remembered(u, self._given, counts)
        self.delay_estimated = delay == "auto"
        self._log = Log(
            self._given, np.where(counts, x, 0.0), counts, self._rate, flaws.jumps.astype(np.float64)
        )
        gain = search.line_gain(self._log)
        if np.ptp(x[counts]) == 0.0:
            raise ValueError(f"x must move with u, it stays at {x[counts][0]:g} µm")
        if gain * np.ptp(self._given) <= ROUNDING * np.max(np.abs(self._log.x)):
            left = _unexplained(self._given[counts], x[counts])
            raise ValueError(
                f"x must rise with u, a straight line has {gain:.4g} µm/V and leaves {100 * left:.0f} % of "
                f"x: {FALLS if left <= UNRELATED else OTHER_RUN}"
            )
        self._plays, self._tells_lag = plays, tells_lag
        # A loop says by itself where it began; only its delay is first that of plays.
        by_plays = plays or self.delay_estimated
        # Plays that move on the first way alone look like a drift.
        self._begin(by_plays, once=False)
        self._find_jumps(by_plays)
        drifts = search.drifts(self._log, search.plays(self._log, self.start) if by_plays else self._loop)
        self._log = replace(self._log, drifts=drifts)
        if plays or drifts:
            self._begin(by_plays, once=plays)
        self.delay = search.best_delay(self._log, self.start) if isinstance(delay, str) else delay
        if self.delay > 0.0:
            self._move_delay(self.delay, plays)
        self._leave_out(settle)
        if plays and self.delay_estimated:
            self._refine_delay()
            if self.delay > search.CLOSE:
                self._try_less_delay()

    def _begin(self, plays: bool, *, once: bool = True) -> None:
        """Find where plays were before the record; anywhere will do where there are none.

        Fits of another delay or start are of no more use.
        """
        first = float(self._log.u[0])
        self.start = search.best_start(self._log, once=once) if plays else Start(first, first)
        for name in ("_first", "_loop", "_plain", "_richest"):
            self.__dict__.pop(name, None)

    def _find_jumps(self, plays: bool) -> None:
        """Find jumps that are not seen beside the motion of the stage, by what a fit leaves without them."""
        log, basis = self._log, self._bent_plays if plays else self._loop
        residual = _residual(log, search.regression(log, basis).best(search.SMOOTH))
        places = jumps_left(residual, float(np.ptp(log.x[log.counts])))
        places = places[~self._near_steps[places]]
        self.jumps = np.empty(0, np.int64)
        if not places.size:
            return
        # A drift beside it would be halved by any jump.
        left = search.missed(replace(log, drifts=True), basis)
        for place in places:
            tried = replace(log, jumps=np.union1d(log.jumps, [place]))
            now = search.missed(replace(tried, drifts=True), basis)
            if now < CLEAR_JUMP * left:
                log, left = tried, now
        self.jumps = np.setdiff1d(log.jumps, self._log.jumps).astype(np.int64)
        if self.jumps.size:
            self._log = log
            self._begin(plays, once=False)

    def _leave_out(self, settle: float | None) -> None:
        """Do without what a first fit shows to be spikes, and a start that has not settled."""
        given, self.left_out = self._log, 0
        if settle is not None:
            self.left_out = int(fraction("settle", settle, 0.0, 0.5 * given.u.size / self._rate) * self._rate)
        for _ in range(PASSES):
            residual = _residual(given, self._first.best(search.SMOOTH))
            further = self.left_out if settle is not None else max(unsettled(residual), self.left_out)
            spikes = lonely(residual) & ~self._near_steps
            spikes[:further] = False
            counts = given.counts & ~spikes
            counts[:further] = False
            settled, self.left_out = further == self.left_out, further
            if not np.array_equal(counts, self._log.counts):
                self._log = replace(given, counts=counts)
                del self._first
            if settled:
                break
            # What had not settled had looked like another start, and moved the fit.
            self._begin(self._plays)
        self.spikes = int(np.count_nonzero(spikes))

    def _refine_delay(self) -> None:
        """Find the delay again with the richest model: creep and another start look like one, too.

        What misses the blocks ahead by more is no better, though it may miss the record by less.
        """
        for _ in range(search.REFINED):
            ahead = self._richest.ahead
            step = search.delay_step(self._log, self._given, self._richest, self.delay)
            delay = float(np.clip(self.delay + step, 0.0, search.LONGEST_DELAY))
            if abs(delay - self.delay) < search.CLOSE:
                break
            # With all that was fitted with it: returning there costs nothing.
            before = vars(self).copy()
            self._move_delay(delay)
            if self._richest.ahead > ahead:
                self.__dict__ = before
                break

    def _try_less_delay(self) -> None:
        """Find the delay from zero on, too: to plays without creep it may stand for all of the creep.

        It is another one only if the record is missed by clearly less, and the blocks ahead are as well.
        """
        ahead, missed, before = self._richest.ahead, self._missed, vars(self).copy()
        self._move_delay(0.0)
        self._refine_delay()
        if self._missed > CLEARLY_LESS * missed or self._richest.ahead > ahead:
            self.__dict__ = before

    @property
    def _missed(self) -> float:
        """What the richest model misses [µm rms]."""
        return float(np.sqrt(np.mean(_residual(self._log, self._richest)[self._log.counts] ** 2)))

    def _move_delay(self, delay: float, plays: bool = True) -> None:
        self.delay, self._log = delay, replace(self._log, u=late(self._given, delay))
        self._begin(plays)

    @property
    def _bent_plays(self) -> PlayColumns:
        return search.plays(self._log, self.start, bends=search.BENDS)

    @cached_property
    def _first(self) -> Regression:
        """Sums of plays with bends, from which those without follow; or of a loop."""
        return search.regression(self._log, self._bent_plays if self._plays else self._loop)

    @cached_property
    def _loop(self) -> LoopColumns:
        return LoopColumns(search.best_alpha(self._log))

    @cached_property
    def _plain(self) -> dict[bool, Fitted]:
        """Plays without creep, with and without bends."""
        bent = self._first
        return {True: bent.best(), False: bent.combined(*self._bent_plays.merged()).best()}

    @cached_property
    def _richest(self) -> Fitted:
        """Plays with bends and creep."""
        return self._with_creep(bends=True)

    def _with_creep(self, *, bends: bool) -> Fitted:
        return search.with_creep(self._log, self._plain[bends], search.creep_times(self._log))

    def form(self, name: str) -> Fit:
        """Fit a model of one kind.

        Parameters
        ----------
        name : str
            One of `FORMS`.
        """
        _known(name)
        return self._outcome(name, self._fitted(FORMS[name]))

    def _fitted(self, form: Form) -> Fitted:
        if form.loop:
            loop = search.regression(self._log, self._loop) if self._plays else self._first
            return loop.best()
        if not form.plays:
            return search.regression(self._log, search.plays(self._log, self.start, 1)).best()
        if not form.creep:
            return self._plain[form.bends]
        return self._richest if form.bends else self._with_creep(bends=False)

    def _polished(self, fitted: Fitted) -> Polished:
        """The best loop near this one, or near one without delay: to plays, another loop may look late."""
        given = replace(self._log, u=self._given)
        free = self.delay_estimated and (self._tells_lag or self.delay > 0.0)
        begun = [(fitted, self.delay)]
        if free and self.delay > 0.0:
            begun.append((search.regression(given, LoopColumns(search.best_alpha(given))).best(), 0.0))
        found = (polished(given, *each, fit_delay=free, near=self.delay) for each in begun)
        return min(found, key=lambda each: each.cost)

    def _outcome(self, name: str, fitted: Fitted) -> Fit:
        """Model and figures of a fit, made final by the nonlinear program where there is one."""
        form, log = FORMS[name], self._log
        delay = self.delay
        if form.loop:
            found = self._polished(fitted)
            delay, errors, gap = found.delay, found.standard_errors, found.gap
            log = replace(log, u=late(self._given, delay))
            fitted = replace(search.regression(log, found.basis).best(), w=found.w)
            parameters = found.parameters
        else:
            gap = fitted.regression.gap(fitted)
            # Creep gains are no columns of the last linear program, but they were fitted as well.
            with_gains = replace(fitted, used=np.union1d(fitted.used, np.r_[fitted.design.gains]))
            errors = trust.standard_errors(with_gains, log)
            parameters = int(trust.free_columns(with_gains).size)
        design, w, rest = _beyond(fitted)
        model = design.model(w)
        missed = trust.residuals(fitted, log)
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
            ahead=trust.error_ahead(fitted, log, missed),
            spread=trust.spread_of(fitted, log, missed, self._given, delay),
            counts=log.counts,
            left_out=self.left_out,
            spikes=self.spikes,
            jumps=self.jumps,
            drift=float(w[design.offset + 1]),
            solver=SOLVER.format(quadratic_solver(), gap),
            _design=design,
            _w=w,
            _rest=rest,
            _u=self._given,
        )


def _residual(log: Log, fitted: Fitted) -> FloatArray:
    """What a fit has left of a log [µm]; NaN where a sample does not count."""
    return np.where(log.counts, log.x - fitted.design.output(log.u, fitted.w), np.nan)


def _unexplained(u: FloatArray, x: FloatArray) -> float:
    """What a straight line leaves of the scatter of x, relative to that."""
    return float(np.sqrt(max(1.0 - np.corrcoef(u, x)[0, 1] ** 2, 0.0)))


def _initial_state(design: Design, w: FloatArray, model: Model) -> Any:
    """What the model's `simulate` is to begin with: of creep, its terms relative to their gains."""
    state = design.basis.initial_state(w[: design.basis.size], model)
    return np.concatenate([state, w[design.crept] / design.creep.gains]) if design.terms else state


def _beyond(fitted: Fitted) -> tuple[Design, FloatArray, FloatArray]:
    """Design and coefficients that go on beyond the record, and what creep has of that at rest [µm]."""
    size = fitted.design.basis.size
    basis, w, added = fitted.design.basis.beyond(fitted.w[:size])
    design = replace(fitted.design, basis=basis)
    w = np.concatenate([w, fitted.w[size:]])
    # Creep would follow what they add, too.
    rest = design.creep.gains * added
    w[design.crept] += rest
    w[design.offset] -= added + float(rest.sum())
    return design, w, rest
