"""How far to trust a fit: standard errors for residuals that are not white, and an interval for readings."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import late
from piezoest.fitting.design import SLOWER
from piezoest.fitting.loops import newness, running_mean, seen_loops
from piezoest.fitting.outcome import BLOCKS, sandwich
from piezoest.fitting.program import RIDGE
from piezoest.fitting.regression import EARLIER, Fitted, Log
from piezoest.fitting.rows import onto, times
from piezoest.fitting.runs import BoolArray, IntArray

# Of what blocks left out miss, so much lies within the interval; by this factor the fit of all of them is
# better. Chosen on 500 simulated logs (seeds 7000 to 7499 of benchmarks/logs.py): in the median of these, 96
# of 100 later readings lie inside.
WITHIN, NARROWER = 0.97, 0.85
# The level wanders as creep and drift go on: by so much of what the last two blocks are off at most in the
# mean under the fit of the first ones, times ln(1 + time behind the record / its length). As the last is half
# of their length behind them, 2.5 would go on at that pace; but a block may be near by chance.
LEVEL = 4.5
# A voltage beyond a range by less than this fraction of it is as good as in it; a block counts whose voltage
# is, for this part of it.
NEARLY, ENOUGH = 0.02, 0.2
# A loop is as good as seen whose turns are from those of a seen one by less than this part of the range.
SEEN = 0.1
# Beyond the range, slopes are known to this fraction of the line's gain; to the second one if the model says
# itself how a stage goes on.
BEYOND, FORETOLD = 0.3, 0.1
# A delay stands for a lag of any kind: where the voltage moves further within it than in the record, another
# delay would be right, that differs by this fraction.
OTHERWISE_LATE = 0.75
# A swing that was too fast is flattened at its end, too: a lag remembers for so many delays.
REMEMBERED = 20.0
# In loops that a record did not show a model is off by this part of what a straight line misses, for each
# half of the range by which their turns are from those of loops that it did show: one that has fitted bends
# or creep to them, and one of equal plays. That of Coleman and Hodgdon is no worse there. Chosen on 112
# simulated logs of full amplitude and then of smaller ones; of others the blocks show the usual part.
NEW, NEW_TO_PLAYS, USUAL = 1.0, 0.1, 0.5
# Where the voltage stays for longer at one side than in the record, creep shows that nobody could see: this
# part of the line's gain. The voltage is averaged over this part of the record.
CREEPS, STAYED = 0.05, 0.1
# A coefficient is at its bound if it is nearer than this, relative to the largest.
AT_BOUND = 1e-9


class Missed(NamedTuple):
    """What is missed (N,), NaN where a sample does not count [µm].

    By the fit without the sample's block, and in the last blocks by the one of those before; whether these
    had a voltage near it, and how new its loop is to theirs [V].
    """

    left_out: FloatArray
    ahead: FloatArray
    near: BoolArray
    new: FloatArray


def residuals(fitted: Fitted, log: Log) -> Missed:
    """What the fits without each block miss in it."""
    without, ahead = np.full((2, log.u.size), np.nan)
    first = int(log.folds[EARLIER])
    later, before = np.arange(log.u.size) >= first, _range(log.u[:first])
    for place, rows in fitted.design.blocks(log.u, fitted.w):
        fold, counts = log.fold(place), log.counts[place]
        for k in np.unique(fold[fold > 0]):
            here = (fold == k) & counts
            missed = log.x[place][here] - times(rows[here], fitted.without[k - 1])
            without[place.start + np.flatnonzero(here)] = missed
        missed = log.x[place] - times(rows, fitted.earlier)
        ahead[place] = np.where(counts & later[place], missed, np.nan)
    near = later.copy()
    near[first:] = _nearly_in(log.u[first:], before)
    return Missed(without, ahead, near, newness(log.u, before, seen_loops(log.u[:first], before)))


class Spread(NamedTuple):
    """How far a reading may be from a prediction: half of the interval that holds 95 of 100 [µm]."""

    within: float  # in the record
    behind: float  # more behind it, times ln(1 + time since its end / its length): the level wanders
    # More for each volt by which the voltage has gone beyond its range: the slope there is known roughly
    # only, and the stage remembers it [µm/V].
    by_volt: float
    visited: tuple[float, float]  # that range [V]
    by_move: float = 0.0  # more for each volt moved further within the delay than in the record [µm/V]
    delay: float = 0.0  # samples by which the displacement lags the voltage
    moved: float = 0.0  # how far the voltage moves in the record within the delay [V]
    by_new: float = 0.0  # more for each volt by which the loops of the voltage are new [µm/V]
    seen: FloatArray | None = None  # the loops of the record, by their last two turns [V], (M, 2)
    usual: float = 0.0  # how new the loops of its last blocks are to those before them [V]
    by_stay: float = 0.0  # more for each volt by which the voltage's running mean leaves the record's [µm/V]
    memory: float = 1.0  # samples that this mean remembers
    stayed: tuple[float, float] = (0.0, 0.0)  # range of the mean in the record [V]
    # What drifts in the record [µm]. Behind it a prediction drifts ever more slowly; the stage may not.
    drift: float = 0.0

    def along(self, u: FloatArray, later: FloatArray) -> FloatArray:
        """For each voltage, so many lengths of the record after its end, shape (N,)."""
        beyond = _beyond(u, self.visited)
        faster = _remembered((_moves(u, self.delay) - self.moved).clip(0.0), self.delay)
        new = 0.0 if self.seen is None else newness(u, self.visited, self.seen)
        return np.sqrt(
            self.within**2
            + (self.behind * np.log1p(later)) ** 2
            + (self.drift * (later - SLOWER * np.log1p(later))) ** 2
            + (self.by_volt * beyond) ** 2
            + (self.by_move * faster) ** 2
            + (self.by_stay * _outside(running_mean(u, self.memory), self.stayed)) ** 2
            + self.by_new**2 * np.maximum(new**2 - self.usual**2, 0.0)
        )


def _moves(u: FloatArray, delay: float) -> FloatArray:
    """How far the voltage has moved within a delay, shape (N,) [V]."""
    return np.abs(u - late(u, delay))


def _remembered(values: FloatArray, delay: float) -> FloatArray:
    """The largest so far that a lag has not forgotten, shape (N,)."""
    from scipy.ndimage import maximum_filter1d

    size = min(int(np.ceil(REMEMBERED * delay)) + 1, 2 * values.size - 1)
    if not values.any():
        return values
    # The filter's window ends at its sample.
    return np.asarray(maximum_filter1d(values, size, origin=(size - 1) // 2, mode="nearest"))


def _beyond(u: FloatArray, visited: tuple[float, float]) -> FloatArray:
    """How far the voltage has gone beyond a range so far, shape (N,) [V]."""
    return np.asarray(np.maximum.accumulate(_outside(u, visited)))


def _outside(u: FloatArray, visited: tuple[float, float]) -> FloatArray:
    """How far the voltage is outside a range, shape (N,) [V]."""
    low, high = visited
    return np.asarray(np.maximum(low - u, u - high).clip(0.0))


def _range(u: FloatArray) -> tuple[float, float]:
    return float(u.min()), float(u.max())


def error_ahead(fitted: Fitted, log: Log, missed: Missed) -> float:
    """Root mean square of what is missed in the last blocks by the fit of those before [µm].

    Under voltages and loops that those have seen, if they are enough: how a model goes on beyond them says
    nothing of it within.
    """
    seen = missed.new <= SEEN * float(np.ptp(log.u[: log.folds[EARLIER]]))
    told = _where(missed.ahead, missed.near & seen)
    return float(np.sqrt(np.mean(told**2))) if told.any() else fitted.ahead


def spread_of(fitted: Fitted, log: Log, missed: Missed, given: FloatArray, delay: float) -> Spread:
    """How far readings are from predictions, as the blocks left out show it.

    What comes after the record is like the blocks between others and like those behind all others: the
    geometric mean of both counts, of voltages that the fit without the block has seen. `given` is the
    voltage as it was written; the log has the one that is `delay` samples later.
    """
    ends = log.folds
    blocks = [slice(*each) for each in pairwise(ends[1:])]
    near = np.zeros(log.u.size, bool)
    for block in blocks:
        others = np.delete(log.u, block)
        near[block] = _nearly_in(log.u[block], _range(others))
    between = _typical(_where(missed.left_out, near))
    if between is None:
        between = float(np.nanquantile(np.abs(missed.left_out), WITHIN))
    ahead = _typical(_where(missed.ahead, missed.near))
    off = max(abs(float(np.nanmean(missed.ahead[block]))) for block in blocks[EARLIER - 1 :])
    basis, visited = fitted.design.basis, _range(log.u)
    memory = STAYED * log.u.size
    by_line = 0.0 if basis.foretells else NEW if basis.bent or fitted.design.terms else NEW_TO_PLAYS
    by_gain = FORETOLD if basis.foretells else BEYOND
    return Spread(
        within=NARROWER * float(np.sqrt(between * (between if ahead is None else ahead))),
        behind=LEVEL * off,
        by_volt=by_gain * fitted.regression.line_gain,
        visited=visited,
        by_move=OTHERWISE_LATE * fitted.regression.line_gain,
        delay=delay,
        moved=float(np.max(_moves(given, delay))),
        by_new=by_line * fitted.regression.line_missed / log.half,
        seen=seen_loops(given, visited),
        usual=float(np.quantile(missed.new[ends[EARLIER] :], USUAL)),
        by_stay=CREEPS * fitted.regression.line_gain,
        memory=memory,
        stayed=_range(running_mean(given, memory)),
        drift=float(fitted.w[fitted.design.offset + 1]),
    )


def _nearly_in(u: FloatArray, visited: tuple[float, float]) -> BoolArray:
    return np.asarray(_beyond(u, visited) <= NEARLY * (visited[1] - visited[0]))


def _where(missed: FloatArray, near: BoolArray) -> FloatArray:
    """What is missed at voltages near those that were seen [µm]; nothing if they are not enough."""
    known = np.isfinite(missed)
    counts = known & near
    return missed[counts & (np.count_nonzero(counts) > ENOUGH * np.count_nonzero(known))]


def _typical(missed: FloatArray) -> float | None:
    """The size below which nearly all is [µm], None if there is nothing."""
    return float(np.quantile(np.abs(missed), WITHIN)) if missed.size else None


def covariance(fitted: Fitted, log: Log) -> FloatArray:
    """Covariance (columns, columns) of the coefficients; zero for those at a bound.

    The sandwich H^-1 (sum over blocks of g g') H^-1 with g the gradient of one of `BLOCKS` blocks in time:
    what neighbouring residuals have in common widens it. No variance is below that of a white residual.
    """
    free = free_columns(fitted)
    gradients = np.zeros((BLOCKS, free.size))
    square = 0.0
    block = np.minimum(np.arange(log.u.size) * BLOCKS // log.u.size, BLOCKS - 1)
    for place, rows in fitted.design.blocks(log.u, fitted.w):
        e = np.where(log.counts[place], log.x[place] - times(rows, fitted.w), 0.0)
        square += float(e @ e)
        for k in np.unique(block[place]):
            here = block[place] == k
            gradients[k] += onto(rows[np.ix_(here, free)], e[here])
    H = fitted.regression.curvature(fitted.smoothness)[np.ix_(free, free)]
    scale = np.sqrt(np.diag(H))
    H = H / np.outer(scale, scale)
    H[np.diag_indices_from(H)] += RIDGE
    bread = np.linalg.inv(H) / np.outer(scale, scale)
    dof = max(fitted.regression.all.rows - free.size, 1.0)
    white = np.diag(bread) * square / dof
    P = np.zeros((fitted.w.size, fitted.w.size))
    P[np.ix_(free, free)] = sandwich(gradients @ bread, white, lost=1)
    return P


def free_columns(fitted: Fitted) -> IntArray:
    """Columns that were fitted and did not end at a bound."""
    away = fitted.w - fitted.regression.lower > AT_BOUND * float(np.max(np.abs(fitted.w), initial=0.0))
    return fitted.used[away[fitted.used]]


def standard_errors(fitted: Fitted, log: Log) -> dict[str, float]:
    """Standard errors of the model's parameters, of creep gains and of the offset, by name."""
    design, size = fitted.design, fitted.design.basis.size
    P = covariance(fitted, log)
    rows = design.basis.names(fitted.w[:size])
    errors = {
        name: float(np.sqrt(max(float(row @ P[:size, :size] @ row), 0.0))) for name, row in rows.items()
    }
    gains = np.sqrt(np.diag(P)[design.gains])
    errors |= {f"creep.gains[{j}]": float(gain) for j, gain in enumerate(gains)}
    return errors | {"offset": float(np.sqrt(P[design.offset, design.offset]))}
