"""The fit of one design, by sums over blocks of a record of which each is predicted from the others."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.design import Basis, Design
from piezoest.fitting.program import Sums, checked, solve, total
from piezoest.fitting.runs import IntArray

# Blocks of a record of which each is predicted from the others.
FOLDS = 5
# What differences of neighbouring slopes cost; how much, is seen on the blocks left out.
SMOOTHNESS = tuple(10.0**k for k in range(-8, 1))
# The smoothest fit is taken that misses them by so much more than the least, in squares.
AS_GOOD = 1.01
# So many blocks predict those behind them; a drift is fitted where it makes the squares there as small as
# this.
EARLIER, DRIFTS = 3, 0.95
# What creep had at the start costs this times its square, for slow creep and offset look alike.
CREPT = 1e-3
# ... and so does a drift, which is what amplitudes that change along the record look like, too.
DRIFT = 1e-2


@dataclass(frozen=True)
class Log:
    """What is fitted."""

    u: FloatArray  # voltage without gaps [V], (N,)
    x: FloatArray  # displacement [µm], (N,)
    counts: Any  # which samples count, (N,)
    sample_rate: float  # [Hz]
    jumps: FloatArray  # first samples behind jumps of the displacement
    drifts: bool = False  # so much that starts, delays and alphas are compared beside a drift

    @property
    def half(self) -> float:
        """Half of the voltage's range [V]."""
        return 0.5 * float(np.ptp(self.u))

    @cached_property
    def folds(self) -> FloatArray:
        """Ends of the blocks, with as many samples that count in each."""
        known = np.flatnonzero(self.counts)
        inner = known[np.linspace(0, known.size, FOLDS + 1).astype(int)[1:-1]]
        return np.concatenate(([0], inner, [self.u.size]))

    def thinned(self, most: int) -> Log:
        """Every k-th sample that counts, about `most`, and all turns of the voltage.

        Without creep, hysteresis is the same between them.
        """
        known = np.flatnonzero(self.counts)[:: max(1, int(np.count_nonzero(self.counts)) // most)]
        before, after = np.diff(self.u)[:-1], np.diff(self.u)[1:]
        turns = 1 + np.flatnonzero((before != 0.0) & (before * after <= 0.0))
        place = np.union1d(known, np.r_[0, turns, self.u.size - 1])
        counts = np.isin(place, known)
        jumps = np.searchsorted(place, self.jumps).astype(np.float64)
        return replace(self, u=self.u[place], x=self.x[place], counts=counts, jumps=jumps)

    def fold(self, place: slice) -> IntArray:
        """Block of each sample of a part."""
        return np.searchsorted(self.folds, np.arange(place.start, place.stop), side="right") - 1


def sums_of(design: Design, log: Log, w: FloatArray | None = None) -> list[Sums]:
    """Sums over each block, of the samples that count; `w` drives the creep."""
    found = [Sums.none(design.columns) for _ in range(FOLDS)]
    for place, rows in design.blocks(log.u, w):
        add(found, rows, log.x[place], log.counts[place], log.fold(place))
    return found


def add(sums: list[Sums], rows: FloatArray, x: FloatArray, counts: Any, fold: IntArray) -> None:
    """Add to the sums of its block every row that counts, if the block has sums."""
    for k in range(fold[0], min(fold[-1] + 1, len(sums))):
        own = slice(*np.searchsorted(fold, (k, k + 1)))
        each, wanted, taken = rows[own], x[own], counts[own]
        if not np.all(taken):
            each, wanted = each[taken], wanted[taken]
        sums[k] = sums[k].plus(Sums.of(each, wanted))


@dataclass(frozen=True)
class Fitted:
    """A regression's best coefficients."""

    regression: Regression  # what they belong to
    w: FloatArray  # all of them, (columns,)
    smoothness: float  # how much unevenness cost
    used: IntArray  # columns that were fitted
    held_out: float  # rms of what all blocks but the first miss under the fit of the others [µm]
    without: list[FloatArray]  # coefficients of the fit without each of them
    ahead: float  # the same of the blocks behind the first `EARLIER`, under the fit of those [µm]
    earlier: FloatArray  # coefficients of the fit of the first `EARLIER` blocks

    @property
    def design(self) -> Design:
        """The columns."""
        return self.regression.design


class Regression:
    """Sums of a design, to be fitted with any smoothness and with or without a drift.

    `lower` are the least coefficients that are allowed.
    """

    def __init__(self, design: Design, sums: list[Sums]) -> None:
        self.design, self.sums, self.all = design, sums, total(sums)
        self.line_gain, self.line_missed = self._line()
        size = design.basis.size
        self.lower = np.full(design.columns, -np.inf)
        self.lower[:size] = design.basis.lower(max(self.line_gain, 0.0))
        self.lower[design.gains] = -design.creep.gains
        self._penalty = np.zeros((design.columns, design.columns))
        self._penalty[:size, :size] = design.basis.unevenness()
        self._always = np.diag(np.where(np.isin(np.arange(design.columns), np.r_[design.crept]), CREPT, 0.0))
        self._always[:size, :size] = design.basis.prior()
        self._always[design.offset + 1, design.offset + 1] = DRIFT

    def _line(self) -> tuple[float, float]:
        """Slope of the straight line beside the jumps [µm/V], and what that line misses [µm rms]."""
        beside = np.r_[self.design.offset, self.design.offset + 2 : self.design.columns]
        T = np.zeros((self.design.columns, 1 + beside.size))
        T[: self.design.basis.size, 0] = self.design.basis.line()
        T[beside, 1 + np.arange(beside.size)] = 1.0
        line = self.all.through(T)
        found = np.asarray(np.linalg.lstsq(line.gram, line.moment, rcond=None)[0], dtype=np.float64)
        return float(found[0]), float(np.sqrt(line.missed(found) / max(line.rows, 1.0)))

    def columns(self, *, drift: bool, gains: bool = True) -> IntArray:
        """Columns that are fitted, of those that the record shows or that follow their neighbours."""
        shown = np.diag(self.all.gram + self._always) > 0.0
        shown[self.design.offset + 1] &= drift
        shown[self.design.gains] &= gains
        return np.flatnonzero(shown)

    def solved(self, smoothness: float, used: IntArray, sums: Sums | None = None) -> FloatArray:
        """All coefficients, zero where a column is not used."""
        few = (self.all if sums is None else sums).only(used)
        w = np.zeros(self.design.columns)
        w[used] = solve(few, self.lower[used], self._cost(smoothness)[np.ix_(used, used)])
        return w

    def _foreseeing(self, smoothness: float, used: IntArray, sums: Sums) -> FloatArray:
        """The same of some blocks; jumps behind them, which no model foresees, are those of all blocks."""
        w = self.solved(smoothness, used, sums)
        jumps = np.arange(self.design.offset + 2, self.design.columns)
        behind = jumps[sums.gram[jumps, jumps] == 0.0]
        if behind.size:
            w[behind] = self.solved(smoothness, used)[behind]
        return w

    def beside(self, fitted: Fitted, log: Log, column: FloatArray) -> float:
        """Coefficient of one more column (N,), fitted together with those of a fit and with creep gains."""
        used = np.union1d(fitted.used, np.r_[self.design.gains])
        sums = Sums.none(used.size + 1)
        for place, rows in self.design.blocks(log.u, fitted.w):
            counts = log.counts[place]
            wider = np.column_stack([rows[:, used], column[place]])[counts]
            sums = sums.plus(Sums.of(wider, log.x[place][counts]))
        cost = np.pad(self._cost(fitted.smoothness)[np.ix_(used, used)], (0, 1))
        return float(solve(sums, np.append(self.lower[used], -np.inf), cost)[-1])

    def gap(self, fitted: Fitted) -> float:
        """How far another solver's optimum is, relative to the displacement's mean square."""
        used = fitted.used
        penalty = self._cost(fitted.smoothness)[np.ix_(used, used)]
        return checked(self.all.only(used), self.lower[used], penalty, fitted.w[used])

    def curvature(self, smoothness: float) -> FloatArray:
        """Second derivative of half of what is minimised."""
        return self.all.gram + self.all.rows * self._cost(smoothness)

    def _cost(self, smoothness: float) -> FloatArray:
        return smoothness * self._penalty + self._always

    def left_out(self, smoothness: float, used: IntArray) -> tuple[float, list[FloatArray]]:
        """Mean square of what each block but the first misses under the fit of the others, and those fits.

        Only the first block says where the stage was at the start.
        """
        fits = [self._foreseeing(smoothness, used, self.all.plus(each, -1.0)) for each in self.sums[1:]]
        missed = sum(each.missed(w) for each, w in zip(self.sums[1:], fits, strict=True))
        return missed / max(sum(each.rows for each in self.sums[1:]), 1.0), fits

    def combined(self, basis: Basis, transform: FloatArray) -> Regression:
        """Regression on a basis whose columns are combinations (size, m) of this one's; the same sums."""
        sums = [each.combined(self.design.basis.size, transform) for each in self.sums]
        return Regression(replace(self.design, basis=basis), sums)

    def best(self, smoothness: float | None = None, *, gains: bool = True) -> Fitted:
        """Fit with the smoothness that predicts best, and a drift if the last blocks bear it out.

        With `gains` what is to be added to creep's gains is fitted, too.
        """
        used = self.columns(drift=False, gains=gains)
        if smoothness is None:
            tried = SMOOTHNESS if np.any(self._penalty) else SMOOTHNESS[:1]
            scores = {each: self.left_out(each, used)[0] for each in tried}
            least = AS_GOOD * min(scores.values())
            smoothness = max(each for each, score in scores.items() if score <= least)
        before, later = total(self.sums[:EARLIER]), total(self.sums[EARLIER:])
        earlier = self._foreseeing(smoothness, used, before)
        drifting = self.columns(drift=True, gains=gains)
        moved = self._foreseeing(smoothness, drifting, before)
        if later.missed(moved) < DRIFTS * later.missed(earlier):
            used, earlier = drifting, moved
        score, without = self.left_out(smoothness, used)
        ahead = later.missed(earlier) / max(later.rows, 1.0)
        w = self.solved(smoothness, used)
        return Fitted(
            self, w, smoothness, used, float(np.sqrt(score)), without, float(np.sqrt(ahead)), earlier
        )
