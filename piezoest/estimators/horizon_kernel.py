"""Where `MovingHorizon` keeps what in its flat state, and the compiled way of samples into it."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST, FloatArray
from piezoest._jit import compiled
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators.saved_state import AMOUNT, COUNT, COVARIANCE, FLAG, NUMBER, Kind, Table, whole
from piezoest.estimators.state_tables import MEASURED, PARAMETER, at, no_more_than

# The state: counters, the held model with its w_h, the last innovation, then the blocks of `Layout`.
SAMPLES, MISSING, SOLVES, FAILURES, UPDATES, LAST, KNOWN, U_LAST = range(8)
W_H, A, B, C, OFFSET, INNOVATION, VARIANCE, NOISE = range(8, 16)
HEAD = 16
WAITING, UPDATED, MISSED, HELD = range(4)

# Stands for a missing sample in the rings, where JSON could not take NaN.
NOTHING = 2.0 * WILDEST


@register_jitable
def _take(state: Any, u: float, x: float, ring_u: Any, ring_x: Any) -> None:
    """One raw sample into the rings; the held model's state and innovation."""
    k = int(state[SAMPLES]) % ring_u.size
    known = np.abs(u) < WILDEST
    if known:
        if state[KNOWN] != 0.0:
            state[W_H] = equations.hysteresis_step(state[W_H], u - state[U_LAST], state[A], state[B])
        state[KNOWN] = 1.0
        state[U_LAST] = u
    measured = known and np.abs(x) < WILDEST
    # An unknown voltage is held: the next known one then is one change, as exact if monotone.
    ring_u[k] = state[U_LAST] if state[KNOWN] != 0.0 else NOTHING
    ring_x[k] = x if measured else NOTHING
    state[SAMPLES] += 1.0
    if measured:
        state[INNOVATION] = x - (state[C] * u + state[W_H] + state[OFFSET])
        state[LAST] = HELD
    else:
        state[MISSING] += 1.0
        state[LAST] = MISSED


@compiled("void(f8[::1], f8, f8, i8, i8)")
def step(state: Any, u: float, x: float, start: int, length: int) -> None:
    """Take one raw sample."""
    _take(state, u, x, state[start : start + length], state[start + length : start + 2 * length])


@compiled()
def chunk(state: Any, u: Any, x: Any, start: int, length: int, y: Any) -> None:
    """Take raw samples; their innovations go into `y`."""
    for k in range(u.size):
        _take(state, u[k], x[k], state[start : start + length], state[start + length : start + 2 * length])
        y[k] = state[INNOVATION]


class Layout(NamedTuple):
    """Where the blocks of the state lie; n coordinates, m parameters."""

    q: slice
    mean: slice
    root: slice
    theta: slice
    P: slice
    gain: slice
    rings: int
    size: int

    @classmethod
    def of(cls, n: int, m: int, window: int) -> Layout:
        """Layout of a problem's sizes; `window` in samples."""
        edges = np.cumsum([HEAD, n, n, n * n, m, m * m, m]).tolist()
        q, mean, root, theta, P, gain = (slice(i, j) for i, j in pairwise(edges))
        return cls(q, mean, root, theta, P, gain, edges[-1], edges[-1] + 2 * window)


def table(layout: Layout, window: int, noise: float, fits: Callable[[FloatArray], bool]) -> Table:
    """Blocks of the state; `noise` is the least that is assumed, `fits` says whether the models agree."""

    def rings_fit(state: FloatArray) -> bool:
        rings = state[layout.rings :]
        return bool(np.all((np.abs(rings) < WILDEST) | (rings == NOTHING)))

    return Table(
        (
            *at(
                0,
                (SAMPLES, "samples", COUNT),
                (MISSING, "samples missing", COUNT),
                (SOLVES, "solves", COUNT),
                (FAILURES, "failed solves", COUNT),
                (UPDATES, "updates", COUNT),
                (LAST, "what became of the last sample", whole(0.0, 3.0)),
                (KNOWN, "whether there was a voltage", FLAG),
                (U_LAST, "the last voltage", MEASURED),
                (W_H, "the model's hysteresis", NUMBER),
                (A, "the model as held", PARAMETER),
                (INNOVATION, "the innovation", NUMBER),
                (VARIANCE, "the innovation's variance", AMOUNT),
                (NOISE, "the noise", Kind(noise)),
                (layout.q.start, "the coordinates", PARAMETER),
                (layout.mean.start, "the arrival's mean", PARAMETER),
                (layout.root.start, "the arrival's information", NUMBER),
                (layout.theta.start, "theta", PARAMETER),
                (layout.P.start, "the covariance P", COVARIANCE),
                (layout.gain.start, "the gain", NUMBER),
                (layout.rings, "the window's voltages", MEASURED),
                (layout.rings + window, "the window's displacements", MEASURED),
            ),
        ),
        (
            no_more_than(SAMPLES, MISSING),
            no_more_than(SOLVES, FAILURES),
            ("the model as held must be admissible and that of theta, the coordinates within bounds", fits),
            ("the window must hold samples, or what stands for missing ones", rings_fit),
        ),
    )
