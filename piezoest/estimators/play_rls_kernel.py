"""The compiled inside of `PrandtlIshlinskiiRLS`: regressors, law, constraints, grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest._jit import UNCOUNTED
from piezoest.equations.bent_plays import segment
from piezoest.equations.mechanics import mechanics_step
from piezoest.equations.play import play
from piezoest.equations.turning_points import SIZE as MEMORY_SIZE
from piezoest.equations.turning_points import recall, remember
from piezoest.estimators import believing, swing
from piezoest.estimators.delay_line import delayed

# State: counters, what the last sample was, the window at hand.
SAMPLES, MISSED, OUTLIERS, UPDATES, HELD, RESETS, LAST, FROZEN, PRIMED = range(9)
INNOVATION, VARIANCE, U_LAST, ELAPSED, COUNT, TRAVEL, X_SUM, OFFSET = range(9, 17)
X_LAST, GAP, GAP_TRAVEL = range(17, 20)
# The grid: its middle and half-width [V], the range seen, turns of the voltage.
CENTRE, RANGE, LOW, HIGH, TURNS, BELIEF = range(20, 26)
SWING = BELIEF + believing.STATE
MEMORY = SWING + swing.STATE
ARRAYS = MEMORY + MEMORY_SIZE  # where the arrays begin, see `layout`

# Configuration: sizes, scales, tuning; then where the arrays of the state begin.
N, PLAYS, BENDS, TERMS, GAIN, NOISE, FRACTION, FIRST_HALF, FIXED, LONGEST_GAP = range(10)
SLACK, LEVEL_TRAVEL, LEVEL_TIME, COMMON_WALK, SINGLE_WALK, WINDOWS, LEAST, INERT = range(10, 18)
AT = 18  # first of each array of the state
Y, Z, PHI, SUM, WAY, SEGMENTS, THETA, P, WORK, OLD, THRESHOLDS, EDGES = range(AT, AT + 12)
USED, FORCE, MOTION, LINE = range(AT + 12, AT + 16)
# The first of each array of the configuration: relative thresholds and bends, creep decays, prior,
# and the mechanics' coefficients.
RELATIVE, RELATIVE_BENDS, DECAYS, PRIOR, SPREAD, MECHANICS = range(AT + 16, AT + 22)
CONFIG = AT + 22

SWEEPS = 10
SMALLEST = 1e-18
WILD = 100.0  # standard deviations beyond which an innovation counts no more
AT_REST = 8.0  # a window with less than this part of its travel is a dwell
LEVEL_START = 0.03  # deviation of the level where nothing is known of it, in parts of the stroke
WAITING, UPDATED, MISSING, HOLDING, REJECTED = range(5)
WARM_UP = 100.0
FAR = 1e30


def layout(config: Any, n: int, k: int, m: int, line: int) -> int:
    """Write sizes and places into the configuration; return the length of the state."""
    slopes = (n + 1) * (k + 1)
    total = slopes + m + 1
    config[N], config[PLAYS], config[BENDS], config[TERMS] = total, n, k, m
    sizes = (
        n,
        m,
        total,
        total,
        slopes,
        slopes,
        total,
        total * total,
        total,
        slopes,
        n,
        k + 2,
        total,
        total,
        2,
        line,
    )
    place = ARRAYS
    for name, size in zip(range(Y, LINE + 1), sizes, strict=True):
        config[name] = place
        place += size
    place_in_config = CONFIG
    for name, size in zip(range(RELATIVE, MECHANICS + 1), (n, k, m, total * total, total, 6), strict=True):
        config[name] = place_in_config
        place_in_config += size
    return place


@register_jitable
def lay_grid(state: Any, config: Any) -> None:
    """Thresholds and edges of the segments for the grid's middle and half-width."""
    n, k = int(config[PLAYS]), int(config[BENDS])
    thresholds, edges = int(config[THRESHOLDS]), int(config[EDGES])
    for i in range(n):
        state[thresholds + i] = state[RANGE] * config[int(config[RELATIVE]) + i]
    state[edges] = -FAR
    for j in range(k):
        state[edges + 1 + j] = state[CENTRE] + state[RANGE] * config[int(config[RELATIVE_BENDS]) + j]
    state[edges + 1 + k] = FAR


@register_jitable
def _cell_edge(relative: Any, config: Any, n: int, i: int) -> Any:
    """Upper edge of the thresholds' cell i in parts of the range; cell 0 is the voltage's own."""
    if i == 0:
        return 0.5 * config[relative]
    if i < n:
        return 0.5 * (config[relative + i - 1] + config[relative + i])
    return config[relative + n - 1] + 0.5 * (
        config[relative + n - 1] - (config[relative + n - 2] if n > 1 else 0.0)
    )


@register_jitable
def regrid(state: Any, config: Any, centre: Any, half: Any) -> None:
    """Move to a grid of another middle and half-width.

    Slopes are taken for densities: over the thresholds, continued evenly beyond the old grid,
    and over the voltage. The covariance returns to its start: what is new is unknown.
    """
    n, k = int(config[PLAYS]), int(config[BENDS])
    theta, old, relative = int(config[THETA]), int(config[OLD]), int(config[RELATIVE])
    thresholds = int(config[THRESHOLDS])
    columns = k + 1
    before, ratio = state[RANGE], state[RANGE] / half
    old_centre = state[CENTRE]
    expected = _output(state, config)
    # Over the thresholds, from theta into `old`.
    top = _cell_edge(relative, config, n, n) * ratio
    for s in range(columns):
        tail, length = 0.0, 0.0
        for i in range(n - max(1, n // 3), n):
            tail += state[theta + (i + 1) * columns + s]
            length += (_cell_edge(relative, config, n, i + 1) - _cell_edge(relative, config, n, i)) * ratio
        for c in range(n + 1):
            low = 0.0 if c == 0 else _cell_edge(relative, config, n, c - 1)
            high = _cell_edge(relative, config, n, c)
            total = state[theta + s] if c == 0 else 0.0
            for i in range(1, n + 1):
                a = _cell_edge(relative, config, n, i - 1) * ratio
                b = _cell_edge(relative, config, n, i) * ratio
                overlap = max(0.0, min(high, b) - max(low, a))
                total += state[theta + i * columns + s] * overlap / (b - a)
            total += tail / length * max(0.0, high - max(low, top))
            state[old + c * columns + s] = total
    # Over the voltage, from `old` back into theta.
    state[RANGE], state[CENTRE] = half, centre
    for c in range(n + 1):
        for s in range(columns):
            low = centre - half if s == 0 else centre + half * config[int(config[RELATIVE_BENDS]) + s - 1]
            high = centre + half if s == k else centre + half * config[int(config[RELATIVE_BENDS]) + s]
            total = 0.0
            for o in range(columns):
                a = -FAR if o == 0 else old_centre + before * config[int(config[RELATIVE_BENDS]) + o - 1]
                b = FAR if o == k else old_centre + before * config[int(config[RELATIVE_BENDS]) + o]
                total += state[old + c * columns + o] * max(0.0, min(high, b) - max(low, a))
            state[theta + c * columns + s] = total / (high - low)
    lay_grid(state, config)
    for i in range(n):
        state[int(config[Y]) + i] = recall(state, MEMORY, state[thresholds + i])
    size = int(config[N])
    for i in range(size * size):
        state[int(config[P]) + i] = config[int(config[PRIOR]) + i]
    place = int(config[P]) + size * size - 1
    state[place] = (LEVEL_START * config[GAIN] * half) ** 2
    _regressor(state, config, 0.0)
    state[theta + size - 1] += expected - _output(state, config)
    _new_window(state, config)
    for i in range(size):
        state[int(config[FORCE]) + i] = 0.0
    _constrain(state, config)
    state[RESETS] += 1.0


@register_jitable
def _output(state: Any, config: Any) -> Any:
    """theta . phi for the last regressor."""
    total = 0.0
    for i in range(int(config[N])):
        total += state[int(config[THETA]) + i] * state[int(config[PHI]) + i]
    return total


@register_jitable
def _regressor(state: Any, config: Any, counted: Any) -> None:
    """Regressor of the present plays and creep; its travel is added where `counted` is 1.0."""
    n, columns, size = int(config[PLAYS]), int(config[BENDS]) + 1, int(config[N])
    slopes = (n + 1) * columns
    # Parts of the state by names of their own: each entry by its place in the whole takes twice as long.
    plays = state[int(config[Y]) : int(config[Y]) + n]
    phi = state[int(config[PHI]) : int(config[PHI]) + size]
    way = state[int(config[WAY]) : int(config[WAY]) + slopes]
    segments = state[int(config[SEGMENTS]) : int(config[SEGMENTS]) + slopes]
    edges = state[int(config[EDGES]) : int(config[EDGES]) + columns + 1]
    creep = state[int(config[Z]) : int(config[Z]) + int(config[TERMS])]
    gain, p = config[GAIN], state[U_LAST]
    for i in range(n + 1):
        if i > 0:
            p = plays[i - 1]
        for s in range(columns):
            part = segment(p, edges[s], edges[s + 1])
            place = i * columns + s
            way[place] += counted * abs(part - segments[place])
            segments[place] = part
            phi[place] = gain * part
    for i in range(int(config[TERMS])):
        phi[slopes + i] = creep[i]
    phi[size - 1] = 1.0


@register_jitable
def _advance(state: Any, config: Any, u: Any) -> None:
    """Plays, creep and regressor after the next voltage."""
    n = int(config[PLAYS])
    used = int(config[USED])
    plays = state[int(config[Y]) : int(config[Y]) + n]
    thresholds = state[int(config[THRESHOLDS]) : int(config[THRESHOLDS]) + n]
    for i in range(n):
        plays[i] = play(plays[i], u, thresholds[i])
    state[TRAVEL] += abs(u - state[U_LAST])
    state[U_LAST] = u
    _regressor(state, config, 1.0)
    terms = int(config[TERMS])
    if terms == 0:
        return
    slopes = (n + 1) * (int(config[BENDS]) + 1)
    phi = int(config[PHI])
    w = 0.0
    for i in range(slopes):
        w += state[used + i] * state[phi + i]
    for i in range(terms):
        place = int(config[Z]) + i
        state[place] += (1.0 - config[int(config[DECAYS]) + i]) * (w - state[place])
        state[phi + slopes + i] = state[place]


@register_jitable
def _new_window(state: Any, config: Any) -> None:
    state[ELAPSED] = state[COUNT] = state[TRAVEL] = state[X_SUM] = 0.0
    for i in range(int(config[N])):
        state[int(config[SUM]) + i] = 0.0
    for i in range((int(config[PLAYS]) + 1) * (int(config[BENDS]) + 1)):
        state[int(config[WAY]) + i] = 0.0


@register_jitable
def _walk(state: Any, config: Any, half: Any) -> None:
    """What may have changed since the last update: only what has moved, and the level."""
    size = int(config[N])
    slopes = (int(config[PLAYS]) + 1) * (int(config[BENDS]) + 1)
    P0, theta, way, spread = int(config[P]), int(config[THETA]), int(config[WAY]), int(config[SPREAD])
    prior = int(config[PRIOR])
    travel = state[TRAVEL]
    if travel > 0.0:
        common = config[COMMON_WALK] ** 2 * travel / state[RANGE]
        single = config[SINGLE_WALK] ** 2 / state[RANGE]
        for i in range(slopes):
            if state[P0 + i * size + i] < config[prior + i * size + i]:
                moved = state[way + i] / travel
                for j in range(slopes):
                    if state[P0 + j * size + j] < config[prior + j * size + j]:
                        both = moved * state[way + j] / travel
                        state[P0 + i * size + j] += common * both * state[theta + i] * state[theta + j]
        for i in range(slopes):
            if state[P0 + i * size + i] < config[prior + i * size + i]:
                state[P0 + i * size + i] += single * state[way + i] * config[spread + i] ** 2
        for i in range(slopes, size - 1):
            if state[P0 + i * size + i] < config[prior + i * size + i]:
                state[P0 + i * size + i] += single * travel * config[spread + i] ** 2
    stroke = config[GAIN] * state[RANGE]
    level = (
        config[LEVEL_TRAVEL] ** 2 * travel / state[RANGE] + config[LEVEL_TIME] ** 2 * state[ELAPSED] / half
    )
    state[P0 + size * size - 1] = min(state[P0 + size * size - 1] + level * stroke**2, stroke**2)


@register_jitable
def _add_row(total: Any, row: Any, factor: Any, size: int) -> None:
    for j in range(size):
        total[j] += row[j] * factor


@register_jitable
def _constrain(state: Any, config: Any) -> None:
    """Parameters to use: the estimate's nearest in the metric of P with nothing below its least.

    The estimate and its covariance are left alone: what is told against a constraint stays
    known. C. Hildreth, Naval Research Logistics Quarterly 4 (1957) 79-85: each force lifts one
    parameter to its bound, and they are kept from update to update.
    """
    size = int(config[N])
    columns = int(config[BENDS]) + 1
    theta = state[int(config[THETA]) : int(config[THETA]) + size]
    used = state[int(config[USED]) : int(config[USED]) + size]
    force = state[int(config[FORCE]) : int(config[FORCE]) + size]
    P0 = int(config[P])
    for i in range(size):
        used[i] = theta[i]
    for i in range(size - 1):
        if force[i] > 0.0:
            _add_row(used, state[P0 + i * size : P0 + i * size + size], force[i], size)
    for _ in range(SWEEPS):
        moved = 0.0
        for i in range(size - 1):
            least = config[LEAST] if i < columns else 0.0
            variance = state[P0 + i * size + i]
            if variance <= SMALLEST:
                continue
            change = (least - used[i]) / variance
            change = max(change, -force[i])
            if change != 0.0:
                force[i] += change
                moved = max(moved, abs(change) * np.sqrt(variance))
                _add_row(used, state[P0 + i * size : P0 + i * size + size], change, size)
        if moved < 1e-3:
            break
    for i in range(size - 1):
        used[i] = max(used[i], config[LEAST] if i < columns else 0.0)


@register_jitable
def _update(state: Any, config: Any, half: Any, first: int) -> None:
    """One step of the law, on the means over the window that ends here.

    Parameters before `first` are left alone, but what is unknown of them counts (S. F. Schmidt's
    consider filter): at a dwell the slopes say nothing.
    """
    size = int(config[N])
    P0 = int(config[P])
    theta = state[int(config[THETA]) : int(config[THETA]) + size]
    mean = state[int(config[SUM]) : int(config[SUM]) + size]
    work = state[int(config[WORK]) : int(config[WORK]) + size]
    _walk(state, config, half)
    y = state[X_SUM] / state[COUNT]
    for i in range(size):
        mean[i] /= state[COUNT]
        y -= theta[i] * mean[i]
        work[i] = 0.0
    R = (config[SLACK] * config[GAIN] * state[RANGE]) ** 2 + config[NOISE] ** 2 / state[COUNT]
    S = R
    for i in range(size):  # P is symmetric: row by row, no sum has to wait for its last product
        _add_row(work, state[P0 + i * size : P0 + i * size + size], mean[i], size)
    for i in range(size):
        S += mean[i] * work[i]
    if not (S >= R and abs(y) < WILDEST):
        # Rounding has spoilt the covariance, as voltages of another order of magnitude can.
        for i in range(size * size):
            state[P0 + i] = config[int(config[PRIOR]) + i]
        state[RESETS] += 1.0
        return
    state[INNOVATION], state[VARIANCE] = y, S
    y = max(min(y, WILD * np.sqrt(S)), -WILD * np.sqrt(S))
    for i in range(first, size):
        gain = work[i] / S
        theta[i] += gain * y
        # Rows and columns before `first` lose their share once, the rest once for both.
        _add_row(state[P0 + i * size : P0 + i * size + i + 1], work, -gain, i + 1)
        for j in range(i):
            state[P0 + j * size + i] = state[P0 + i * size + j]
    for i in range(size):
        state[P0 + i * size + i] = max(state[P0 + i * size + i], SMALLEST)
    _constrain(state, config)


@register_jitable
def _watch_range(state: Any, config: Any, u: Any) -> None:
    """Lay a new grid where the voltage leaves it, or once where it was laid far too wide."""
    state[LOW], state[HIGH] = min(state[LOW], u), max(state[HIGH], u)
    if config[FIXED] != 0.0 or int(config[PLAYS]) == 0:
        return
    middle, half = 0.5 * (state[HIGH] + state[LOW]), 0.5 * (state[HIGH] - state[LOW])
    if abs(u - state[CENTRE]) > 1.02 * state[RANGE]:
        regrid(state, config, middle, max(1.1 * half, 0.9 * state[RANGE]))
    elif state[TURNS] == 4.0:
        state[TURNS] = 5.0
        if 1.3 * half < state[RANGE] and half > 0.0:
            regrid(state, config, middle, 1.05 * half)


@register_jitable
def _sample(state: Any, config: Any, u: Any, x: Any) -> None:
    """Take one sample."""
    state[SAMPLES] += 1.0
    known = np.abs(u) < WILDEST
    if known:
        u = delayed(state[int(config[LINE]) :], config[FRACTION], u)
        known = np.abs(u) < WILDEST
    if known and config[INERT] != 0.0:
        place, numbers = int(config[MOTION]), int(config[MECHANICS])
        u = mechanics_step(state[place : place + 2], u, config[numbers : numbers + 6])
    measured = known and np.abs(x) < WILDEST
    if not measured:
        state[MISSED] += 1.0
        state[LAST] = MISSING
        if state[SAMPLES] - state[MISSED] == 0.0 and not known:
            return
    if not known:
        u = state[U_LAST]
    du = u - state[U_LAST]
    if du != 0.0:
        remember(state, MEMORY, u)
        way = state[SWING + swing.DIRECTION]
        swing.follow(state[SWING : SWING + swing.STATE], u)
        if state[SWING + swing.DIRECTION] != way and state[TURNS] < 4.0:
            state[TURNS] += 1.0
    _advance(state, config, u)
    if du != 0.0:
        _watch_range(state, config, u)
    state[ELAPSED] += 1.0
    state[GAP] += 1.0
    state[GAP_TRAVEL] += abs(du)
    if not measured:
        return
    size = int(config[N])
    level = int(config[THETA]) + size - 1
    if state[PRIMED] == 0.0:
        state[PRIMED] = 1.0
        state[level] += x - _output(state, config)
        state[int(config[USED]) + size - 1] = state[OFFSET] = state[level]
        state[X_LAST] = x
        state[GAP] = state[GAP_TRAVEL] = 0.0
        _new_window(state, config)
        state[LAST] = WAITING
        return
    memory = state[BELIEF:SWING]
    dx, travel = x - state[X_LAST], state[GAP_TRAVEL]
    stuck = believing.stands_still(memory, dx, travel, state[SWING + swing.SIZE])
    if stuck or not believing.believable(memory, dx, config[GAIN], travel, WARM_UP):
        if stuck or state[GAP] <= config[LONGEST_GAP]:
            state[OUTLIERS] += 1.0
            state[LAST] = REJECTED
            return
        # It stays there: a new level, or a voltage that was away for long.
        jump = x - _output(state, config)
        state[level] += jump
        state[int(config[USED]) + size - 1] += jump
        state[OFFSET] += jump
        state[BELIEF + believing.SEEN] = 0.0
        _new_window(state, config)
    state[X_LAST] = x
    state[GAP] = state[GAP_TRAVEL] = 0.0
    state[LAST] = HOLDING
    state[HELD] += 1.0
    if state[FROZEN] != 0.0:
        _new_window(state, config)
        return
    state[X_SUM] += x
    state[COUNT] += 1.0
    total = state[int(config[SUM]) : int(config[SUM]) + size]
    _add_row(total, state[int(config[PHI]) : int(config[PHI]) + size], 1.0, size)
    half = swing.half_period(state[SWING : SWING + swing.STATE], config[FIRST_HALF])
    moved = state[TRAVEL] * config[WINDOWS]
    if moved < state[RANGE] and state[ELAPSED] * config[WINDOWS] < 2.0 * half:
        return
    if moved * AT_REST >= state[RANGE]:
        state[HELD] -= 1.0
        state[UPDATES] += 1.0
        state[LAST] = UPDATED
        _update(state, config, half, 0)
    else:
        _update(state, config, half, size - 1 - int(config[TERMS]))
    level = int(config[USED]) + size - 1
    share = max(min(state[ELAPSED] / (2.0 * half), 1.0), 1.0 / (1.0 + state[UPDATES]))
    state[OFFSET] += share * (state[level] - state[OFFSET])
    _new_window(state, config)


@njit("void(f8[::1], f8[::1], f8, f8)", cache=True, **UNCOUNTED)
def step(state: Any, config: Any, u: float, x: float) -> None:
    """Take one sample."""
    _sample(state, config, u, x)


@njit(
    "void(f8[::1], f8[::1], f8[::1], f8[::1], i8, f8[::1], f8[:, ::1], f8[::1], f8[::1], f8[:, ::1])",
    cache=True,
    **UNCOUNTED,
)
def run(
    state: Any,
    config: Any,
    u: Any,
    x: Any,
    every: int,
    scale: Any,
    theta: Any,
    y: Any,
    S: Any,
    covariance: Any,
) -> None:
    """Take whole records; every `every`-th sample into the histories that have room, slopes times `scale`."""
    size = int(config[N])
    now = state[int(config[THETA]) : int(config[THETA]) + size]
    row, due = 0, every
    for k in range(u.size):
        step(state, config, u[k], x[k])
        due -= 1
        if due == 0:
            for i in range(size - 1):
                theta[row, i] = now[i] * scale[i]
            if y.size > 0:
                y[row] = state[INNOVATION]
            if S.size > 0:
                S[row] = state[VARIANCE]
            if covariance.size > 0:
                for i in range(size * size):
                    covariance[row, i] = state[int(config[P]) + i]
            row, due = row + 1, every


@njit("void(f8[::1], f8[::1])", cache=True)
def start(state: Any, config: Any) -> None:
    """Grid of a state that is all zero but for the grid's middle and half-width."""
    lay_grid(state, config)
    _regressor(state, config, 0.0)
    _constrain(state, config)
