"""Regressors of `PrandtlIshlinskiiRLS`: plays, bends and creep, and the window they are summed over."""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from piezoest.equations.bent_plays import segment
from piezoest.equations.play import play
from piezoest.estimators.play_rls_layout import (
    BENDS,
    COUNT,
    DECAYS,
    EDGES,
    ELAPSED,
    GAIN,
    PHI,
    PLAYS,
    SEGMENTS,
    SUM,
    TERMS,
    THETA,
    THRESHOLDS,
    TRAVEL,
    U_LAST,
    USED,
    WAY,
    X_SUM,
    N,
    Y,
    Z,
)


@register_jitable
def output(state: Any, config: Any) -> Any:
    """theta . phi for the last regressor."""
    total = 0.0
    for i in range(int(config[N])):
        total += state[int(config[THETA]) + i] * state[int(config[PHI]) + i]
    return total


@register_jitable
def regressor(state: Any, config: Any, counted: Any) -> None:
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
def advance(state: Any, config: Any, u: Any) -> None:
    """Plays, creep and regressor after the next voltage."""
    n = int(config[PLAYS])
    used = int(config[USED])
    plays = state[int(config[Y]) : int(config[Y]) + n]
    thresholds = state[int(config[THRESHOLDS]) : int(config[THRESHOLDS]) + n]
    for i in range(n):
        plays[i] = play(plays[i], u, thresholds[i])
    state[TRAVEL] += abs(u - state[U_LAST])
    state[U_LAST] = u
    regressor(state, config, 1.0)
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
def new_window(state: Any, config: Any) -> None:
    """Begin the sums and the travel anew."""
    state[ELAPSED] = state[COUNT] = state[TRAVEL] = state[X_SUM] = 0.0
    for i in range(int(config[N])):
        state[int(config[SUM]) + i] = 0.0
    for i in range((int(config[PLAYS]) + 1) * (int(config[BENDS]) + 1)):
        state[int(config[WAY]) + i] = 0.0


@register_jitable
def add_row(total: Any, row: Any, factor: Any, size: int) -> None:
    """Add a row times a factor to another, in place."""
    for j in range(size):
        total[j] += row[j] * factor
