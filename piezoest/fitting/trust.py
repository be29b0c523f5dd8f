"""How far to trust a fit: standard errors for residuals that are not white, and an interval for readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.program import RIDGE
from piezoest.fitting.regression import EARLIER, Fitted, Log
from piezoest.fitting.rows import onto, times
from piezoest.fitting.runs import IntArray

# Blocks in time over which the gradients of a coloured residual are summed.
BLOCKS = 25
# Of readings lie within the interval; wider by this factor, for a fit is to hold for longer than the blocks
# tell.
WITHIN, MARGIN = 0.95, 1.15
# Less and less is known of the level, as creep and drift go on: times ln(1 + time / length of the record),
# and what is missed within it, or what drifts. Of 150 simulated logs (seeds 7200 to 7349 of
# benchmarks/logs.py) as many readings lie inside in the first as in the second half behind what was fitted.
LEVEL, DRIFTING = 1.2, 0.3
# Beyond the range slopes are known to this fraction of the line's gain; if the model says itself how a stage
# goes on, what it misses grows by this factor where the voltage goes as far again.
BEYOND_GAIN, BEYOND_MISSED = 0.5, 3.0
# A coefficient is at its bound if it is nearer than this, relative to the largest.
AT_BOUND = 1e-9


class Missed(NamedTuple):
    """What is missed (N,), NaN where a sample does not count [µm].

    By the fit without the sample's block, and in the last blocks by the one of those before.
    """

    left_out: FloatArray
    ahead: FloatArray


def residuals(fitted: Fitted, log: Log) -> Missed:
    """What the fits without each block miss in it."""
    without, ahead = np.full((2, log.u.size), np.nan)
    later = np.arange(log.u.size) >= log.folds[EARLIER]
    for place, rows in fitted.design.blocks(log.u, fitted.w):
        fold, counts = log.fold(place), log.counts[place]
        for k in np.unique(fold[fold > 0]):
            here = (fold == k) & counts
            missed = log.x[place][here] - times(rows[here], fitted.without[k - 1])
            without[place.start + np.flatnonzero(here)] = missed
        missed = log.x[place] - times(rows, fitted.earlier)
        ahead[place] = np.where(counts & later[place], missed, np.nan)
    return Missed(without, ahead)


class Spread(NamedTuple):
    """How far a reading may be from a prediction: half of the interval that holds 95 of 100 [µm].

    Parameters
    ----------
    within : float
        In the record.
    behind : float
        More behind the record, times ln(1 + time since its end / its length): creep and drift go on.
    by_volt : float
        More for each volt beyond its range: the slope there is known roughly only [µm/V].
    visited : tuple of float
        That range [V].
    """

    within: float
    behind: float
    by_volt: float
    visited: tuple[float, float]

    def along(self, u: FloatArray, later: FloatArray) -> FloatArray:
        """For each voltage, so many lengths of the record after its end, shape (N,)."""
        low, high = self.visited
        beyond = np.maximum(low - u, u - high).clip(0.0)
        return np.sqrt(self.within**2 + (self.behind * np.log1p(later)) ** 2 + (self.by_volt * beyond) ** 2)


def spread_of(fitted: Fitted, log: Log) -> Spread:
    """How far readings are from predictions, as the blocks left out show it.

    What comes after the record is like the blocks between others and like those behind all others: the
    geometric mean of both counts.
    """
    between, ahead = (float(np.nanquantile(np.abs(each), WITHIN)) for each in residuals(fitted, log))
    within = MARGIN * float(np.sqrt(between * ahead))
    drift = float(fitted.w[fitted.design.offset + 1])
    own = BEYOND_MISSED * within / (2.0 * log.half)
    by_volt = own if fitted.design.basis.foretells else BEYOND_GAIN * fitted.regression.line_gain
    visited = float(log.u.min()), float(log.u.max())
    return Spread(within, float(np.hypot(LEVEL * within, DRIFTING * drift)), by_volt, visited)


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
    wide = bread @ (gradients.T @ gradients) @ bread * BLOCKS / (BLOCKS - 1.0)
    widening = np.sqrt(np.maximum(white / np.maximum(np.diag(wide), 1e-300), 1.0))
    P = np.zeros((fitted.w.size, fitted.w.size))
    P[np.ix_(free, free)] = wide * np.outer(widening, widening)
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
