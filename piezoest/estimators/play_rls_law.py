"""The law of `PrandtlIshlinskiiRLS`: what may have changed, what a window tells, what is admissible."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.estimators.play_rls_layout import (
    BENDS,
    COMMON_WALK,
    COUNT,
    ELAPSED,
    FORCE,
    GAIN,
    INNOVATION,
    LEAST,
    LEVEL_TIME,
    LEVEL_TRAVEL,
    NOISE,
    PRIOR,
    RANGE,
    RESETS,
    SINGLE_WALK,
    SLACK,
    SPREAD,
    SUM,
    THETA,
    TRAVEL,
    USED,
    VARIANCE,
    WAY,
    WORK,
    X_SUM,
    N,
    P,
)
from piezoest.estimators.play_rls_regressors import add_row, slopes_of

SWEEPS = 10
SMALLEST = 1e-18
LARGEST = 1e100  # variance of an innovation that says nothing any more
WILD = 100.0  # standard deviations beyond which an innovation counts no more


@register_jitable
def _walk(state: Any, config: Any, half: Any) -> None:
    """What may have changed since the last update: only what has moved, and the level."""
    size = int(config[N])
    slopes = slopes_of(config)
    P0, theta, way, spread = int(config[P]), int(config[THETA]), int(config[WAY]), int(config[SPREAD])
    prior = int(config[PRIOR])
    travel = state[TRAVEL]
    if travel > 0.0:
        common = np.sqrt(config[COMMON_WALK] ** 2 * travel / state[RANGE])
        single = config[SINGLE_WALK] ** 2 / state[RANGE]
        work = int(config[WORK])
        step = state[work : work + slopes]  # of each slope, if all walk by the same part of themselves
        for i in range(slopes):
            grows = state[P0 + i * size + i] < config[prior + i * size + i]
            step[i] = common * state[way + i] / travel * state[theta + i] if grows else 0.0
        for i in range(slopes):
            if step[i] != 0.0:
                add_row(state[P0 + i * size : P0 + i * size + slopes], step, step[i], slopes)
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
def constrain(state: Any, config: Any) -> None:
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
            add_row(used, state[P0 + i * size : P0 + i * size + size], force[i], size)
    for _ in range(SWEEPS):
        moved = 0.0
        for i in range(size - 1):
            least = config[LEAST] if i < columns else 0.0
            variance = state[P0 + i * size + i]
            if variance <= SMALLEST or (force[i] == 0.0 and used[i] >= least):
                continue
            change = (least - used[i]) / variance
            change = max(change, -force[i])
            if change != 0.0:
                force[i] += change
                moved = max(moved, abs(change) * np.sqrt(variance))
                add_row(used, state[P0 + i * size : P0 + i * size + size], change, size)
        if moved < 1e-3:
            break
    for i in range(size - 1):
        used[i] = max(used[i], config[LEAST] if i < columns else 0.0)


@register_jitable
def update(state: Any, config: Any, half: Any, first: int) -> None:
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
        add_row(work, state[P0 + i * size : P0 + i * size + size], mean[i], size)
    for i in range(size):
        S += mean[i] * work[i]
    if not (R > 0.0 and S >= R and S < LARGEST and abs(y) < WILDEST):
        # Rounding has spoilt the covariance, as voltages of another order of magnitude can. NaN or infinity
        # anywhere ends up in one of these numbers too.
        for i in range(size * size):
            state[P0 + i] = config[int(config[PRIOR]) + i]
        state[RESETS] += 1.0
        return
    state[INNOVATION], state[VARIANCE] = y, S
    y = max(min(y, WILD * np.sqrt(S)), -WILD * np.sqrt(S))
    for i in range(first, size):
        theta[i] += work[i] / S * y
    root = np.sqrt(S)
    for i in range(size):
        work[i] /= root
    for i in range(size):
        start = 0 if i >= first else first
        row = state[P0 + i * size + start : P0 + i * size + size]
        rest = work[start:]
        for j in range(size - start):
            row[j] -= work[i] * rest[j]
    for i in range(size):
        state[P0 + i * size + i] = max(state[P0 + i * size + i], SMALLEST)
    constrain(state, config)
