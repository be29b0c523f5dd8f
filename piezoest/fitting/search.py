"""What a fit is not linear in: creep gains, alpha, the delay, and where the stage was before the record.

Creep gains go by Gauss-Newton steps, each of which solves the linear program with their columns in it; the
others are tried, with everything linear solved anew (variable projection: G. H. Golub, V. Pereyra, SIAM J.
Numer. Anal. 10 (1973) 413-432).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from piezoest._checks import FloatArray, finite, fraction
from piezoest.fitting.coordinates import late
from piezoest.fitting.design import NO_CREEP, Basis, Design
from piezoest.fitting.loop_columns import LoopColumns
from piezoest.fitting.play_columns import PlayColumns, Start, moving_of, starts
from piezoest.fitting.regression import Fitted, Log, Regression, sums_of
from piezoest.models import Creep

# Plays, and voltages at which their slopes may change.
THRESHOLDS, BENDS = 20, 2
# The widest play moves by this fraction of the voltage's range.
MOVES = 0.1
# Those that move only on the first way from rest are so many times as far apart. So much of them is tried;
# all of them must make the squares so many times smaller.
ONCE, PARTS, PRICE = 2.0, (1.0 / 6.0, 1.0 / 3.0, 2.0 / 3.0, 1.0), 8.0
# Rows by which delays, starts and alphas are compared, and with which smoothness.
FEW, SMOOTH = 4000, 1e-4
# A drift is clear if only this part of the squares is left with it.
CLEAR_DRIFT = 0.25
# Largest delay that is looked for [samples], at first, and where that is too short, if then only this part of
# the squares is left; how closely it is found.
USUAL_DELAY, LONGEST_DELAY, LONGER, CLOSE = 10.0, 30.0, 0.8, 0.02
# Most Gauss-Newton steps of a delay.
REFINED = 3
# Gauss-Newton steps of the creep gains, the relative change at which they have settled, the least of them.
STEPS, SETTLED, LEAST_CREEP = 10, 1e-3, 1e-3
# A step is too long if it leaves so many times the squares before it.
WORSE = 1.02
# Creep terms are a decade apart, from so many samples to so many times the record. None is shorter than this
# part of the time across the range at about the highest speed: it could not be told from a delay.
SHORTEST_CREEP, LONGEST_CREEP, MOST_TERMS = 20.0, 1.0, 4
PART_OF_WAY, HIGHEST_SPEED = 0.05, 0.99  # the speed as a quantile
# Range of alpha times the range of the voltage, and how closely its logarithm is found: what ends in the
# optimum of all parameters begins there.
ALPHAS, CLOSE_ALPHA = (0.03, 300.0), 0.03


def plays(log: Log, start: Start, thresholds: int = THRESHOLDS, bends: int = 0) -> PlayColumns:
    """Plays laid over the range of the voltage, up to those that hardly move."""
    inner = log.u.min() + 2.0 * log.half * np.arange(1, bends + 1) / (bends + 1)
    visited = (float(log.u.min()), float(log.u.max()))
    laid = (1.0 - MOVES) * log.half * np.arange(thresholds) / max(thresholds - 1, 1)
    if start.once > 0.0 and thresholds > 1:
        widest = laid[-1] + start.once * (_widest(log, start) - laid[-1])
        laid = np.append(laid, np.arange(laid[-1] + ONCE * laid[1], widest, ONCE * laid[1]))
    return PlayColumns(laid, inner, start, visited, moving_of(log.u, laid, inner, start))


def design_of(log: Log, basis: Basis, creep: Creep = NO_CREEP) -> Design:
    """All columns for a record."""
    return Design(basis, log.sample_rate, log.u.size, creep, log.jumps)


def regression(log: Log, basis: Basis) -> Regression:
    """Sums of a basis without creep."""
    design = design_of(log, basis)
    return Regression(design, sums_of(design, log))


def line_gain(log: Log) -> float:
    """Slope of the straight line [µm/V]."""
    first = float(log.u[0])
    return regression(log, plays(log, Start(first, first), 1)).line_gain


def missed(log: Log, basis: Basis) -> float:
    """Mean square that a basis leaves, by some thousand rows."""
    return _left(regression(log.thinned(FEW), basis), log.drifts)


def _left(found: Regression, drift: bool, *, gains: bool = True) -> float:
    w = found.solved(SMOOTH, found.columns(drift=drift, gains=gains))
    return found.all.missed(w) / max(found.all.rows, 1.0)


def best_start(log: Log, *, once: bool) -> Start:
    """The start under which plays miss least; with wider ones that move on the first way alone, if allowed.

    What is missed with bends and without counts alike: without, a bent stage drowns what another start does;
    with them, hardly any start is wrong. Of what the wide ones do later on the record tells little: there are
    only as many as are worth it.
    """
    log = log.thinned(FEW)

    def cost(start: Start) -> float:
        basis = plays(log, start, bends=BENDS)
        bent = regression(log, basis)
        left = _left(bent, log.drifts) * _left(bent.combined(*basis.merged()), log.drifts)
        return float(np.sqrt(left)) * PRICE**start.once

    costs = {start: cost(start) for start in starts(log.u)}
    rested = [start for start in costs if _widest(log, start) > log.half] if once else []
    if rested:
        first = min(rested, key=lambda start: costs[start])
        wider = [Start(first.left, first.centre, part) for part in PARTS]
        costs |= {start: cost(start) for start in wider}
    return min(costs, key=lambda start: costs[start])


def _widest(log: Log, start: Start) -> float:
    """Threshold of the widest play that moves at all [V]."""
    return start.widest(float(log.u.min()), float(log.u.max()), 2.0 * MOVES * log.half)


def drifts(log: Log, basis: Basis) -> bool:
    """Whether a drift is clear beside a basis."""
    few = regression(log.thinned(FEW), basis)
    return _left(few, True) < CLEAR_DRIFT * _left(few, False)


def checked_delay(delay: Any) -> float | Literal["auto"]:
    """Delay as it may be asked for: ``"auto"``, or samples within what is looked for."""
    if not isinstance(delay, str):
        return fraction("delay", finite("delay", delay), 0.0, LONGEST_DELAY)
    if delay != "auto":
        raise ValueError(f"delay must be 'auto' or a number of samples, got {delay!r}")
    return "auto"


def best_delay(log: Log, start: Start) -> float:
    """Delay [samples] under which plays miss least; no sample has a voltage later than it.

    Only whole numbers are compared by what they miss: a voltage between two samples has less noise.
    """

    def delayed(delay: float) -> tuple[Log, PlayColumns]:
        moved = replace(log, u=late(log.u, delay))
        return moved, plays(moved, start, bends=BENDS)

    def least(first: float, last: float) -> tuple[float, float]:
        """What is missed with the best delay, and that delay."""
        return min((missed(*delayed(float(each))), float(each)) for each in np.arange(first, last + 1.0))

    left, whole = least(0.0, USUAL_DELAY)
    if whole == USUAL_DELAY:
        further, longer = least(USUAL_DELAY + 1.0, LONGEST_DELAY)
        whole = longer if further < LONGER * left else whole
    delay = whole
    for _ in range(REFINED):
        moved, basis = delayed(delay)
        step = delay_step(moved, log.u, regression(moved, basis).best(SMOOTH), delay)
        before, delay = delay, float(np.clip(delay + step, max(whole - 1.0, 0.0), whole + 1.0))
        if abs(delay - before) < CLOSE:
            break
    return whole if abs(delay - whole) < CLOSE else min(delay, LONGEST_DELAY)


def delay_step(log: Log, given: FloatArray, fitted: Fitted, delay: float) -> float:
    """Gauss-Newton step of the delay [samples]: all that is linear goes along.

    `given` is the voltage without delay, whose delay by so many samples is the log's. The derivative is that
    between the samples before and after: it has the voltage's noise of these, not that of the residual.
    """
    before, after = (fitted.design.output(late(given, delay + each), fitted.w) for each in (-1.0, 1.0))
    return fitted.regression.beside(fitted, log, 0.5 * (after - before))


def best_alpha(log: Log) -> float:
    """alpha [1/V] of the Coleman-Hodgdon model that misses least."""
    log = log.thinned(FEW)

    def cost(logarithm: float) -> float:
        return _left(regression(log, LoopColumns(float(np.exp(logarithm)))), log.drifts)

    low, high = np.log(np.array(ALPHAS) / (2.0 * log.half))
    return float(np.exp(_least(cost, np.linspace(low, high, 10))))


def _least(cost: Callable[[float], float], grid: FloatArray) -> float:
    """Where a cost is least: about the best point of a grid, then between its neighbours."""
    from scipy.optimize import minimize_scalar

    costs = [cost(float(each)) for each in grid]
    best = int(np.argmin(costs))
    between = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, grid.size - 1)]))
    found = minimize_scalar(cost, bounds=between, method="bounded", options={"xatol": CLOSE_ALPHA})
    return float(found.x) if found.fun < costs[best] else float(grid[best])


def creep_times(log: Log) -> FloatArray:
    """Time constants a decade apart that a record can tell [s]."""
    fastest = float(np.quantile(np.abs(np.diff(log.u)), HIGHEST_SPEED))
    across = 2.0 * log.half / max(fastest, 1e-300)
    shortest = max(SHORTEST_CREEP, PART_OF_WAY * across) / log.sample_rate
    longest = LONGEST_CREEP * log.u.size / log.sample_rate
    terms = min(MOST_TERMS, int(np.log10(max(longest / shortest, 1.0))) + 1)
    return np.asarray(longest / 10.0 ** np.arange(terms)[::-1])


def with_creep(log: Log, plain: Fitted, times: FloatArray) -> Fitted:
    """Fit with creep terms of these time constants, from a fit without; terms that come out as none go."""
    gains, fitted, taken = np.zeros(times.size), plain, 0
    last = np.inf, gains, fitted
    for k in range(STEPS):
        # The smoothness that suits plays without creep is no longer the best once there is some.
        smoothness = None if taken == 1 else fitted.smoothness
        crept = _crept(log, fitted, Creep(gains, times))
        left = _left(crept, crept.design.offset + 1 in fitted.used, gains=False)
        if left > WORSE * last[0]:
            # Too long a step: half of it.
            gains, fitted = 0.5 * (gains + last[1]), last[2]
            continue
        last, taken = (left, gains, fitted), taken + 1
        fitted = crept.best(smoothness)
        step = fitted.w[fitted.design.gains]
        gains = np.maximum(gains + step, 0.0)
        settled = taken > 2 and np.max(np.abs(step)) <= SETTLED * max(float(gains.sum()), SETTLED)
        kept = gains > LEAST_CREEP
        if not np.any(kept) or (settled and np.all(kept)):
            break
        if settled or k == STEPS // 2:
            gains, times = gains[kept], times[kept]
            last = np.inf, gains, fitted
    kept = gains > LEAST_CREEP
    if not np.any(kept):
        return plain
    crept = _crept(log, fitted, Creep(gains[kept], times[kept]))
    return crept.best(fitted.smoothness, gains=False)


def _crept(log: Log, last: Fitted, creep: Creep) -> Regression:
    """Regression on columns that have crept with these gains; their change follows the last slopes."""
    design = design_of(log, last.design.basis, creep)
    return Regression(design, sums_of(design, log, last.w))
