"""Learns a Duhem model by recursive least squares.

The displacement is regressed on what the terms of its slope add up to along the way of the voltage. Both
sides forget along that way. So where the stage has begun does not count, and the noise of a reading is not
differentiated. The means over a short way make one equation. The functions are those of an estimator's
kernel, see `piezoest.estimators.compiled.CompiledEstimator`.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.compile import like
from piezoest.controller.duhem import LINE, TERMS, moved
from piezoest.equations import least_squares, swing
from piezoest.estimators.model_writing import NO_MODEL, TO_BE_PLACED
from piezoest.layout import AMOUNT, COUNT, COVARIANCE, FLAG, MEASURED, NUMBER, PARAMETER, numbers, record

SIZE = 2 * TERMS
# Whether there was a reading at all, and one at the last voltage; both of these; where the stage is by model
# and readings. Regressors and displacement, as sums along the way; their sums over the samples of a short
# way, its samples and its length; whether anything is learnt. Parameters and their covariance.
STATE = record(
    __name__, primed=FLAG, seen=FLAG, u=MEASURED, x=MEASURED, level=MEASURED, swing=swing.SWING,
    phi=numbers(SIZE), z=NUMBER, sums=numbers(SIZE), sum=NUMBER, count=COUNT, length=AMOUNT, learnt=FLAG,
    p=numbers(SIZE, kind=PARAMETER), P=numbers(SIZE, SIZE, kind=COVARIANCE),
)  # fmt: skip
LAYOUTS = STATE, record()

# In swings: how long a piece of the way counts in the sums, how long an equation counts, a short way, and the
# way in which readings correct where the stage is.
WAY, MEMORY, SHORT, CORRECTED = 0.5, 3.0, 1.0 / 256.0, 1.0 / 16.0
# Variance of an equation; standard deviations of the parameters, at the beginning and at most.
R, SPREADS = 4e-6, (0.5, 1.0, 1.0, 3.0)
# Single variances are limited, and not their sum.
NO_BOUND = 1e100


def values() -> dict[str, Any]:
    """State at the beginning: a line of slope one."""
    return {"p": LINE, "P": np.diag(np.square(SPREADS * 2))}


@register_jitable
def _begin_covariance(P: Any) -> None:
    """All parameters are as uncertain as at the beginning."""
    for i in range(SIZE):
        for j in range(SIZE):
            P[i, j] = SPREADS[i % TERMS] ** 2 if i == j else 0.0


@register_jitable
def _limit(P: Any) -> None:
    """No parameter is more uncertain than at the beginning."""
    for i in range(SIZE):
        most = SPREADS[i % TERMS]
        if P[i, i] > most * most:
            share = most / np.sqrt(P[i, i])
            for j in range(SIZE):
                P[i, j] *= share
                P[j, i] = P[i, j]
            P[i, i] = most * most


@register_jitable
def _keep_stable(p: Any, P: Any, place: Any, sign: Any) -> None:
    """Where the displacement would run away from itself, the slope does not depend on it."""
    if p[place] * sign > 0.0 and P[place, place] > 0.0:
        share = p[place] / P[place, place]
        for i in range(SIZE):
            p[i] -= share * P[place, i]
        p[place] = 0.0


@register_jitable
def _update(state: Any) -> None:
    """Learn from the means over a short way."""
    p, P, sums = state.p, state.P, state.sums
    product = like(sums)
    for i in range(SIZE):
        sums[i] /= state.count
    y, quadratic = least_squares.innovation(p, P, sums, state.sum / state.count, product)
    forgetting = np.exp(-state.length / MEMORY)
    if not least_squares.is_covariance(P):
        _begin_covariance(P)
    elif least_squares.is_safe(P, y, quadratic + forgetting * R, product):
        least_squares.discrete_correction(p, P, y, quadratic, forgetting, R, NO_BOUND, product)
        _limit(P)
        _keep_stable(p, P, TERMS - 1, 1.0)
        _keep_stable(p, P, SIZE - 1, -1.0)
        state.learnt = 1.0
    for i in range(SIZE):
        sums[i] = 0.0
    state.sum = state.count = state.length = 0.0


@register_jitable
def _learn(state: Any, du: Any, x: Any, gone: Any) -> None:
    """Take the way to a reading; it is so many swings long."""
    phi, left = state.phi, np.exp(-gone / WAY)
    first, u, middle = 0 if du > 0.0 else TERMS, state.u + 0.5 * du, 0.5 * (state.x + x)
    for i in range(SIZE):
        phi[i] *= left
    phi[first] += du
    phi[first + 1] += du * u
    phi[first + 2] += du * u * u
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
            state.primed, state.seen, state.u, state.x, state.level = 1.0, 1.0, u, x, x
            state.swing.furthest = state.swing.turned = u
        return
    du = u - state.u
    if du == 0.0:
        # At rest the stage creeps, which would look like hysteresis.
        return
    swing.follow(state.swing, u)
    gone = min(np.abs(du) / max(state.swing.size, swing.SMALLEST), 1.0)
    state.level = moved(state.p, state.level, state.u, u)
    # The ways to and from a missing reading are left out, on both sides of the equations.
    if known and state.seen != 0.0:
        _learn(state, du, x, gone)
    if known:
        state.level += min(gone / CORRECTED, 1.0) * (x - state.level)
        state.x = x
    state.seen = 1.0 if known else 0.0
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
