"""Regressors of `PrandtlIshlinskiiRLS`: plays, bends and creep, and the window they are summed over."""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from piezoest.equations.bent_plays import between
from piezoest.equations.play import play, weighted_sum
from piezoest.estimators.play_rls_layout import (
    BENDS,
    COUNT,
    DECAYS,
    ELAPSED,
    GAIN,
    LOWER,
    PHI,
    PLAYS,
    REACH,
    SEGMENTS,
    SUM,
    TERMS,
    THETA,
    TRAVEL,
    U_LAST,
    UPPER,
    USED,
    WAY,
    X_SUM,
    ZERO,
    N,
    Y,
    Z,
)


@register_jitable
def slopes_of(config: Any) -> int:
    """Number of slopes: of the voltage and of each play, in each segment."""
    return (int(config[PLAYS]) + 1) * (int(config[BENDS]) + 1)


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
    slopes, size = slopes_of(config), int(config[N])
    plays = state[int(config[Y]) : int(config[Y]) + slopes]
    segments = state[int(config[SEGMENTS]) : int(config[SEGMENTS]) + slopes]
    way = state[int(config[WAY]) : int(config[WAY]) + slopes]
    lower = state[int(config[LOWER]) : int(config[LOWER]) + slopes]
    upper = state[int(config[UPPER]) : int(config[UPPER]) + slopes]
    zero = state[int(config[ZERO]) : int(config[ZERO]) + slopes]
    phi = state[int(config[PHI]) : int(config[PHI]) + size]
    creep = state[int(config[Z]) : int(config[Z]) + int(config[TERMS])]
    # Short loops over few arrays: the compiler makes vector instructions of them.
    for i in range(slopes):
        phi[i] = between(plays[i], lower[i], upper[i]) - zero[i]
    for i in range(slopes):
        way[i] += counted * abs(phi[i] - segments[i])
    for i in range(slopes):
        segments[i] = phi[i]
    gain = config[GAIN]
    for i in range(slopes):
        phi[i] *= gain
    for i in range(int(config[TERMS])):
        phi[slopes + i] = creep[i]
    phi[size - 1] = 1.0


@register_jitable
def advance(state: Any, config: Any, u: Any) -> None:
    """Plays, creep and regressor after the next voltage."""
    slopes = slopes_of(config)
    plays = state[int(config[Y]) : int(config[Y]) + slopes]
    reach = state[int(config[REACH]) : int(config[REACH]) + slopes]
    for i in range(slopes):
        plays[i] = play(plays[i], u, reach[i])
    state[TRAVEL] += abs(u - state[U_LAST])
    state[U_LAST] = u
    regressor(state, config, 1.0)
    terms = int(config[TERMS])
    if terms == 0:
        return
    phi, used = int(config[PHI]), int(config[USED])
    w = weighted_sum(state[used : used + slopes], state[phi : phi + slopes])
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
    for i in range(slopes_of(config)):
        state[int(config[WAY]) + i] = 0.0


@register_jitable
def add_row(total: Any, row: Any, factor: Any, size: int) -> None:
    """Add a row times a factor to another, in place."""
    for j in range(size):
        total[j] += row[j] * factor
