"""The grid of `PrandtlIshlinskiiRLS`: thresholds and bends, which follow the voltage's range."""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from piezoest.equations.bent_plays import between
from piezoest.equations.turning_points import recall
from piezoest.estimators.play_rls_law import constrain
from piezoest.estimators.play_rls_layout import (
    BENDS,
    CENTRE,
    EDGES,
    FIXED,
    FORCE,
    GAIN,
    HIGH,
    LOW,
    LOWER,
    MEMORY,
    OLD,
    PLAYS,
    PRIOR,
    RANGE,
    REACH,
    RELATIVE,
    RELATIVE_BENDS,
    RESETS,
    THETA,
    THRESHOLDS,
    TURNS,
    U_LAST,
    UPPER,
    ZERO,
    N,
    P,
    Y,
)
from piezoest.estimators.play_rls_regressors import new_window, output, regressor

LEVEL_START = 0.03  # deviation of the level where nothing is known of it, in parts of the stroke
FAR = 1e30
LEAST_RANGE = 1e-9  # half-width that a grid shrinks to, in parts of the one before


@register_jitable
def lay_grid(state: Any, config: Any) -> None:
    """Thresholds and edges of the segments for the grid's middle and half-width, for each slope too."""
    n, k = int(config[PLAYS]), int(config[BENDS])
    thresholds, edges = int(config[THRESHOLDS]), int(config[EDGES])
    for i in range(n):
        state[thresholds + i] = state[RANGE] * config[int(config[RELATIVE]) + i]
    state[edges] = -FAR
    for j in range(k):
        state[edges + 1 + j] = state[CENTRE] + state[RANGE] * config[int(config[RELATIVE_BENDS]) + j]
    state[edges + 1 + k] = FAR
    reach, lower = int(config[REACH]), int(config[LOWER])
    upper, zero = int(config[UPPER]), int(config[ZERO])
    for place in range((n + 1) * (k + 1)):
        i, s = place // (k + 1), place % (k + 1)
        low, high = state[edges + s], state[edges + s + 1]
        state[reach + place] = state[thresholds + i - 1] if i > 0 else 0.0
        state[lower + place], state[upper + place], state[zero + place] = low, high, between(0.0, low, high)


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
    expected = output(state, config)
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
    for i in range(n + 1):
        play = recall(state, MEMORY, state[thresholds + i - 1]) if i > 0 else state[U_LAST]
        for s in range(columns):
            state[int(config[Y]) + i * columns + s] = play
    size = int(config[N])
    for i in range(size * size):
        state[int(config[P]) + i] = config[int(config[PRIOR]) + i]
    place = int(config[P]) + size * size - 1
    state[place] = (LEVEL_START * config[GAIN] * half) ** 2
    regressor(state, config, 0.0)
    state[theta + size - 1] += expected - output(state, config)
    new_window(state, config)
    for i in range(size):
        state[int(config[FORCE]) + i] = 0.0
    constrain(state, config)
    state[RESETS] += 1.0


@register_jitable
def watch_range(state: Any, config: Any, u: Any) -> None:
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
            regrid(state, config, middle, max(1.05 * half, LEAST_RANGE * state[RANGE]))
