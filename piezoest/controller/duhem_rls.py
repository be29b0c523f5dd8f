"""Learns a Duhem model by recursive least squares.

The displacement is regressed on the terms of its slope, summed up along the way of the voltage. These sums
and the displacement forget old pieces of the way at the same rate. So where the stage began does not count,
and the noise of a reading is not differentiated. The means over a short way make one equation. The functions
are those of an estimator's kernel, see `piezoest.estimators.compiled.CompiledEstimator`.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.compile import like
from piezoest.controller.duhem import LINE, TERMS, moved
from piezoest.equations import least_squares, swing
from piezoest.estimators.model_writing import NO_MODEL, TO_BE_PLACED
from piezoest.layout import (
    AMOUNT,
    COUNT,
    COVARIANCE,
    DISTANCE,
    FLAG,
    MEASURED,
    NUMBER,
    PARAMETER,
    numbers,
    record,
)

SIZE = 2 * TERMS
# Whether there was a reading at all; the last voltage; the last reading, its voltage, and the path of the
# voltage since then; samples of this rest; where the stage is by model and readings. Regressors and
# displacement, as sums along the way; their sums over the samples of a short way, its samples and its length;
# whether anything is learnt. Parameters and their covariance.
STATE = record(
    __name__, primed=FLAG, u=MEASURED, x=MEASURED, at=MEASURED, path=DISTANCE, rested=COUNT, level=MEASURED,
    swing=swing.SWING, phi=numbers(SIZE), z=NUMBER, sums=numbers(SIZE), sum=NUMBER, count=COUNT,
    length=AMOUNT, learnt=FLAG, p=numbers(SIZE, kind=PARAMETER), P=numbers(SIZE, SIZE, kind=COVARIANCE),
)  # fmt: skip
LAYOUTS = STATE, record()

# In swings: how far the sums look back, and how far the equations; a short way; the way in which readings
# correct where the stage is; the longest way between two readings that is learnt from.
WAY, MEMORY, SHORT, CORRECTED, LONGEST = 0.5, 3.0, 1.0 / 256.0, 1.0 / 16.0, 1.0 / 8.0
# Variance of an equation; standard deviations of the parameters, at the beginning and at most; share of their
# squares that each equation adds to the variances, so that rounding does not spoil them.
R, SPREADS, SHARE = 4e-6, (0.5, 1.0, 1.0, 3.0), 1e-12
# Rounding that is no turn.
STRAIGHT = 1e-6
# Single variances are limited, and not their sum.
NO_BOUND = 1e18


@register_jitable
def _begin(p: Any, P: Any) -> None:
    """Begin, or begin again, with a line of slope one."""
    for i in range(SIZE):
        p[i] = LINE[i]
        for j in range(SIZE):
            P[i, j] = SPREADS[i % TERMS] ** 2 if i == j else 0.0


@register_jitable
def _limit(P: Any) -> None:
    """All parameters become a little more uncertain, and none more than at the beginning."""
    for i in range(SIZE):
        most = SPREADS[i % TERMS]
        P[i, i] += SHARE * most * most
        if P[i, i] > most * most:
            share = most / np.sqrt(P[i, i])
            for j in range(SIZE):
                P[i, j] *= share
                P[j, i] = P[i, j]
            P[i, i] = most * most


@register_jitable
def _without(p: Any, P: Any, up: Any, down: Any) -> None:
    """Let the slope up, down or both not depend on the displacement; the other parameters adapt to that."""
    i, j = TERMS - 1, SIZE - 1
    # Measured by their uncertainty, the parameters change least along columns of P.
    first, second = p[i] * up, p[j] * down
    both = up * down * P[i, j]
    determinant = P[i, i] * P[j, j] - both * both
    if not determinant > 0.0:
        return
    along_i = (P[j, j] * first - both * second) / determinant
    along_j = (P[i, i] * second - both * first) / determinant
    for k in range(SIZE):
        p[k] -= along_i * P[i, k] + along_j * P[j, k]
    p[i] *= 1.0 - up
    p[j] *= 1.0 - down


@register_jitable
def _keep_stable(p: Any, P: Any) -> None:
    """Where the displacement would run away from itself, the slope does not depend on it."""
    up, down = 1.0 * (p[TERMS - 1] > 0.0), 1.0 * (p[SIZE - 1] < 0.0)
    if up + down > 0.0:
        _without(p, P, up, down)
    if p[TERMS - 1] > 0.0 or p[SIZE - 1] < 0.0:
        _without(p, P, 1.0, 1.0)


@register_jitable
def _update(state: Any) -> None:
    """Learn from the means over a short way."""
    p, P, sums = state.p, state.P, state.sums
    product = like(sums)
    for i in range(SIZE):
        sums[i] /= state.count
    y, quadratic = least_squares.innovation(p, P, sums, state.sum / state.count, product)
    forgetting = np.exp(-state.length / MEMORY)
    if quadratic >= 0.0 and least_squares.is_safe(P, y, quadratic + forgetting * R, product):
        least_squares.discrete_correction(p, P, y, quadratic, forgetting, R, NO_BOUND, product)
        _limit(P)
        _keep_stable(p, P)
        state.learnt = 1.0
    else:
        # Rounding has spoilt the covariance.
        _begin(p, P)
    for i in range(SIZE):
        sums[i] = 0.0
    state.sum = state.count = state.length = 0.0


@register_jitable
def _learn(state: Any, u: Any, x: Any, gone: Any) -> None:
    """Take the way from the last reading to this one; it is so many swings long."""
    phi, left, du = state.phi, np.exp(-gone / WAY), u - state.at
    first, u, middle = 0 if du > 0.0 else TERMS, state.at + 0.5 * du, 0.5 * (state.x + x)
    for i in range(SIZE):
        phi[i] *= left
    phi[first] += du
    phi[first + 1] += du * u
    phi[first + 2] += du * (u * u + du * du / 12.0)
    phi[first + 3] += du * middle
    state.z = left * state.z + x - state.x
    for i in range(SIZE):
        state.sums[i] += phi[i]
    state.sum += state.z
    state.count += 1.0
    state.length += gone
    if state.length >= SHORT:
        _update(state)


@register_jitable
def sample(state: Any, settings: Any, u: Any, x: Any) -> None:
    """What becomes of one sample; x is NaN where there is no reading."""
    known = np.abs(x) < WILDEST
    if state.primed == 0.0:
        if known:
            state.primed, state.u, state.x, state.at, state.level = 1.0, u, x, u, x
            state.swing.furthest = state.swing.turned = u
            _begin(state.p, state.P)
        return
    du = u - state.u
    swing.follow(state.swing, u)
    if du == 0.0:
        state.rested += 1.0
        return
    size = max(state.swing.size, swing.SMALLEST)
    state.path += np.abs(du)
    state.level = moved(state.p, state.level, state.u, u)
    if known:
        # Creep in a long rest would look like hysteresis, and a turn between two readings like none.
        creeps = state.rested > state.swing.usual > 0.0
        straight = state.path <= (1.0 + STRAIGHT) * np.abs(u - state.at)
        if straight and state.path <= LONGEST * size and not creeps:
            _learn(state, u, x, min(state.path / size, 1.0))
        state.level += min(state.path / size / CORRECTED, 1.0) * (x - state.level)
        state.x, state.at, state.path, state.rested = x, u, 0.0, 0.0
    state.u = u


@register_jitable
def write_model(state: Any, settings: Any, model: Any) -> float:
    """Hand over the model of now, which goes on from where the stage is."""
    if state.learnt == 0.0:
        return NO_MODEL
    for i in range(SIZE):
        model.p[i] = state.p[i]
    model.x = state.level
    return TO_BE_PLACED
