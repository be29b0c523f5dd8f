"""How far to trust a fit: standard errors for residuals that are not white, and an interval for readings."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.program import RIDGE
from piezoest.fitting.regression import EARLIER, Fitted, Log, Regression
from piezoest.fitting.rows import onto, times
from piezoest.fitting.runs import IntArray

# Blocks in time over which the gradients of a coloured residual are summed.
BLOCKS = 25
# Of readings lie within the interval.
WITHIN = 0.95
# Wider by this factor, for a fit is to hold for longer than the blocks tell; slopes beyond the range are
# known to this fraction of the line's gain.
MARGIN, BEYOND_GAIN = 1.1, 0.5
# Creep becomes slower: it goes on with this fraction of its rate so far, but over another record by at least
# this fraction of the stroke, which is what piezo stages do in a third of a decade of time.
SLOWER, CREEPS_ON = 0.5, 0.002
# A coefficient is at its bound if it is nearer than this, relative to the largest.
AT_BOUND = 1e-9


class Missed(NamedTuple):
    """What is missed (N,), NaN where a sample does not count [µm].

    By the fit, by the one without the sample's block, and in the last blocks by the one of those before.
    """

    residual: FloatArray
    left_out: FloatArray
    ahead: FloatArray


def residuals(fitted: Fitted, log: Log) -> Missed:
    """What a fit misses, and what the fits without each block miss in it."""
    own, without, ahead = np.full((3, log.u.size), np.nan)
    later = np.arange(log.u.size) >= log.folds[EARLIER]
    for place, rows in fitted.design.blocks(log.u, fitted.w):
        fold, counts = log.fold(place), log.counts[place]
        own[place] = np.where(counts, log.x[place] - times(rows, fitted.w), np.nan)
        for k in np.unique(fold[fold > 0]):
            here = (fold == k) & counts
            missed = log.x[place][here] - times(rows[here], fitted.without[k - 1])
            without[place.start + np.flatnonzero(here)] = missed
        missed = log.x[place] - times(rows, fitted.earlier)
        ahead[place] = np.where(counts & later[place], missed, np.nan)
    return Missed(own, without, ahead)


class Spread(NamedTuple):
    """How far a reading may be from a prediction: half of the interval that holds 95 of 100 [µm].

    Parameters
    ----------
    within : float
        In the record.
    by_sample : float
        More for each sample behind the record: creep and drift go on.
    by_volt : float
        More for each volt beyond its range: the slope there is known roughly only [µm/V].
    visited : tuple of float
        That range [V].
    """

    within: float
    by_sample: float
    by_volt: float
    visited: tuple[float, float]

    def along(self, u: FloatArray, behind: FloatArray) -> FloatArray:
        """For each voltage, so many samples behind the record, shape (N,)."""
        low, high = self.visited
        beyond = np.maximum(low - u, u - high).clip(0.0)
        return self.within + self.by_sample * behind + self.by_volt * beyond


def spread_of(missed: Missed, log: Log, gain: float) -> Spread:
    """How far readings are from predictions, as the blocks left out show it.

    What comes after the record is predicted from what came before, as the last blocks are: the wider counts.
    """
    quantiles = [float(np.nanquantile(np.abs(each), WITHIN)) for each in (missed.left_out, missed.ahead)]
    rates = [0.0]
    for first, end in pairwise(log.folds[EARLIER:].astype(int)):
        level = missed.ahead[first:end]
        if np.any(np.isfinite(level)):
            rates.append(abs(float(np.nanmean(level))) / (0.5 * (first + end) - log.folds[EARLIER]))
    visited = float(log.u.min()), float(log.u.max())
    least = CREEPS_ON * 2.0 * log.half * gain / log.u.size
    by_sample = max(SLOWER * max(rates), least)
    return Spread(MARGIN * max(quantiles), by_sample, BEYOND_GAIN * gain, visited)


def covariance(regression: Regression, fitted: Fitted, log: Log) -> FloatArray:
    """Covariance (columns, columns) of the coefficients; zero for those at a bound.

    The sandwich H^-1 (sum over blocks of g g') H^-1 with g the gradient of one of `BLOCKS` blocks in time:
    what neighbouring residuals have in common widens it. No variance is below that of a white residual.
    """
    free = free_columns(regression, fitted)
    gradients = np.zeros((BLOCKS, free.size))
    square = 0.0
    block = np.minimum(np.arange(log.u.size) * BLOCKS // log.u.size, BLOCKS - 1)
    for place, rows in fitted.design.blocks(log.u, fitted.w):
        e = np.where(log.counts[place], log.x[place] - times(rows, fitted.w), 0.0)
        square += float(e @ e)
        for k in np.unique(block[place]):
            here = block[place] == k
            gradients[k] += onto(rows[np.ix_(here, free)], e[here])
    H = regression.curvature(fitted.smoothness)[np.ix_(free, free)]
    scale = np.sqrt(np.diag(H))
    H = H / np.outer(scale, scale)
    H[np.diag_indices_from(H)] += RIDGE
    bread = np.linalg.inv(H) / np.outer(scale, scale)
    dof = max(regression.all.rows - free.size, 1.0)
    white = np.diag(bread) * square / dof
    wide = bread @ (gradients.T @ gradients) @ bread * BLOCKS / (BLOCKS - 1.0)
    widening = np.sqrt(np.maximum(white / np.maximum(np.diag(wide), 1e-300), 1.0))
    P = np.zeros((fitted.w.size, fitted.w.size))
    P[np.ix_(free, free)] = wide * np.outer(widening, widening)
    return P


def free_columns(regression: Regression, fitted: Fitted) -> IntArray:
    """Columns that were fitted and did not end at a bound."""
    away = fitted.w - regression.lower > AT_BOUND * float(np.max(np.abs(fitted.w), initial=0.0))
    return fitted.used[away[fitted.used]]


def standard_errors(regression: Regression, fitted: Fitted, log: Log) -> dict[str, float]:
    """Standard errors of the model's parameters, of creep gains and of the offset, by name."""
    design, size = fitted.design, fitted.design.basis.size
    P = covariance(regression, fitted, log)
    rows = design.basis.names(fitted.w[:size])
    errors = {
        name: float(np.sqrt(max(float(row @ P[:size, :size] @ row), 0.0))) for name, row in rows.items()
    }
    gains = np.sqrt(np.diag(P)[design.gains])
    errors |= {f"creep.gains[{j}]": float(gain) for j, gain in enumerate(gains)}
    return errors | {"offset": float(np.sqrt(P[design.offset, design.offset]))}
