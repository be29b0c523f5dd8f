"""The compiled inside of `PrandtlIshlinskiiRLS`: one sample, and whole records."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest._jit import RUN_TYPES, STEP_TYPES, UNCOUNTED, compiled, unrolled
from piezoest.equations.mechanics import mechanics_step
from piezoest.equations.turning_points import remember
from piezoest.estimators import believing, swing
from piezoest.estimators.delay_line import delayed
from piezoest.estimators.play_rls_grid import lay_grid, watch_range
from piezoest.estimators.play_rls_law import constrain, update
from piezoest.estimators.play_rls_layout import (
    BELIEF,
    COUNT,
    ELAPSED,
    FIRST_HALF,
    FRACTION,
    FROZEN,
    GAIN,
    GAP,
    GAP_TRAVEL,
    HELD,
    INERT,
    INNOVATION,
    LAST,
    LINE,
    LONGEST_GAP,
    MECHANICS,
    MEMORY,
    MISSED,
    MOTION,
    OFFSET,
    OUTLIERS,
    PHI,
    PRIMED,
    RANGE,
    SAMPLES,
    SUM,
    SWING,
    TERMS,
    THETA,
    TRAVEL,
    TURNS,
    U_LAST,
    UPDATES,
    USED,
    VARIANCE,
    WINDOWS,
    X_LAST,
    X_SUM,
    N,
)
from piezoest.estimators.play_rls_layout import P as COVARIANCE
from piezoest.estimators.play_rls_regressors import add_row, advance, new_window, output, regressor
from piezoest.estimators.record_loops import keep_outcome

AT_REST = 8.0  # a window with less than this part of its travel is a dwell
WAITING, UPDATED, MISSING, HOLDING, REJECTED = range(5)
WARM_UP = 100.0


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
    advance(state, config, u)
    if du != 0.0:
        watch_range(state, config, u)
    state[ELAPSED] += 1.0
    state[GAP] += 1.0
    state[GAP_TRAVEL] += abs(du)
    if not measured:
        return
    size = int(config[N])
    level = int(config[THETA]) + size - 1
    if state[PRIMED] == 0.0:
        state[PRIMED] = 1.0
        state[level] += x - output(state, config)
        state[int(config[USED]) + size - 1] = state[OFFSET] = state[level]
        state[X_LAST] = x
        state[GAP] = state[GAP_TRAVEL] = 0.0
        new_window(state, config)
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
        jump = x - output(state, config)
        state[level] += jump
        state[int(config[USED]) + size - 1] += jump
        state[OFFSET] += jump
        state[BELIEF + believing.SEEN] = 0.0
        new_window(state, config)
    state[X_LAST] = x
    state[GAP] = state[GAP_TRAVEL] = 0.0
    state[LAST] = HOLDING
    state[HELD] += 1.0
    if state[FROZEN] != 0.0:
        new_window(state, config)
        return
    state[X_SUM] += x
    state[COUNT] += 1.0
    total = state[int(config[SUM]) : int(config[SUM]) + size]
    add_row(total, state[int(config[PHI]) : int(config[PHI]) + size], 1.0, size)
    half = swing.half_period(state[SWING : SWING + swing.STATE], config[FIRST_HALF])
    moved = state[TRAVEL] * config[WINDOWS]
    if moved < state[RANGE] and state[ELAPSED] * config[WINDOWS] < 2.0 * half:
        return
    if moved * AT_REST >= state[RANGE]:
        state[HELD] -= 1.0
        state[UPDATES] += 1.0
        state[LAST] = UPDATED
        update(state, config, half, 0)
    else:
        update(state, config, half, size - 1 - int(config[TERMS]))
    level = int(config[USED]) + size - 1
    share = max(min(state[ELAPSED] / (2.0 * half), 1.0), 1.0 / (1.0 + state[UPDATES]))
    state[OFFSET] += share * (state[level] - state[OFFSET])
    new_window(state, config)


@unrolled
def _keep(state: Any, config: Any, row: int, scale: Any, theta: Any, y: Any, S: Any, P: Any) -> None:
    """Write a sample's outcome into the histories that have room."""
    size = int(config[N])
    now = state[int(config[THETA]) : int(config[THETA]) + size]
    kept = theta[row]
    for i in range(size - 1):
        kept[i] = now[i] * scale[i]
    covariance = state[int(config[COVARIANCE]) : int(config[COVARIANCE]) + size * size]
    keep_outcome(row, state[INNOVATION], state[VARIANCE], covariance, size, y, S, P)


@compiled(STEP_TYPES, nogil=True, **UNCOUNTED)
def step(state: Any, config: Any, u: float, x: float) -> None:
    """Take one sample."""
    _sample(state, config, u, x)


@compiled(RUN_TYPES, nogil=True, **UNCOUNTED)
def run(
    state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
    theta: Any, s: Any, y: Any, S: Any, P: Any,
) -> None:  # fmt: skip
    """Take records."""
    row, due = 0, every
    for k in range(u.size):
        _sample(state, config, u[k], x[k])
        due -= 1
        if due == 0:
            _keep(state, config, row, scale, theta, y, S, P)
            row, due = row + 1, every


@compiled("void(f8[::1], f8[::1])")
def start(state: Any, config: Any) -> None:
    """Grid of a state that is all zero but for the grid's middle and half-width."""
    lay_grid(state, config)
    regressor(state, config, 0.0)
    constrain(state, config)
