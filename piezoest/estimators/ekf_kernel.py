"""The compiled inside of `HysteresisEKF`: time update, measurement update, projection."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest._jit import PROPOSE_TYPES, compiled, unrolled
from piezoest.equations import admissible, kalman
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators.delay_line import delayed

# State: bookkeeping, then vectors of n or n*n numbers, the delay line last.
U_LAST, PRIMED, SAMPLES, MISSED, UPDATES, MOVED, LAST, INNOVATION, INNOVATION_VARIANCE = range(9)
U_CENTRE, X_CENTRE, CENTRED, HELD, RESETS, HEAD = range(9, 15)

# Configuration: scalars, the parameters' least values, the start's variances (up to five), and behind them n
# process noises.
N, HYSTERETIC, NOISE, FRACTION, OFFSET, PROJECT, LEAST_A, LEAST_B, MARGIN, START = range(10)
CONFIG = START + 5

WAITING, UPDATED, MISSING, HOLDING = 0.0, 1.0, 2.0, 3.0
# Least a, b or gain of a model handed out, in parts of the start's; least c - 2b, in parts of its c.
LEAST, LEAST_MARGIN = 1e-2, 1e-3


@register_jitable
def state_size(n: int) -> int:
    """Numbers that the state needs for n states of the filter; the delay line follows."""
    return HEAD + 5 * n + 2 * n * n


@unrolled
def _views(state: Any, n: int) -> Any:
    """State vector s, its covariance P, last gain K, workspace."""
    i = HEAD
    m = n * n
    return (
        state[i : i + n],
        state[i + n : i + n + m],
        state[i + n + m : i + 2 * n + m],
        state[i + 2 * n + m : i + 5 * n + 2 * m],
    )


@unrolled
def _time_update(s: Any, P: Any, du: Any, config: Any, n: int, work: Any) -> None:
    """Exact sample map of the state, its Jacobian for the covariance, process noise."""
    row, q = work[:n], work[n : 2 * n]
    for i in range(n):
        row[i] = 0.0
        q[i] = config[CONFIG + i]
    if config[HYSTERETIC] != 0.0:
        w_h, kept, by_a, by_b = equations.hysteresis_linearised(s[0], du, s[1], s[2])
        q[0] += kalman.bilinear_variance(P, du, s[1], n)
        s[0] = w_h
        row[0], row[1], row[2] = kept, by_a, by_b
        kalman.predict_covariance(P, row, 3, q, n, work[2 * n :])
    else:
        row[0] = 1.0
        kalman.predict_covariance(P, row, 1, q, n, work[2 * n :])


@unrolled
def measurement_row(h: Any, u: Any, config: Any, n: int) -> None:
    """dx/ds: x = w_h + c u (+ offset), or x = K u (+ offset)."""
    for i in range(n):
        h[i] = 0.0
    if config[HYSTERETIC] != 0.0:
        h[0] = 1.0
        h[3] = u
    else:
        h[0] = u
    if config[OFFSET] != 0.0:
        h[n - 1] = 1.0


@unrolled
def _onto_admissible(s: Any, P: Any, config: Any, n: int, work: Any) -> Any:
    """Project onto a >= least, b >= least, c - 2b >= margin: flat faces in this form."""
    if s[1] >= config[LEAST_A] and s[2] >= config[LEAST_B] and s[3] - 2.0 * s[2] >= config[MARGIN]:
        return 0.0
    g = work[:n]
    rest = work[n:]
    moved = 0.0
    for face in range(3):
        for i in range(n):
            g[i] = 0.0
        least = config[LEAST_A + face]
        if face < 2:
            g[1 + face] = 1.0
        else:
            g[2], g[3] = -2.0, 1.0
        moved = max(moved, kalman.project(s, P, g, least, n, rest))
    # The faces meet at an angle: whatever is left over is clamped.
    s[1] = max(s[1], config[LEAST_A])
    s[2] = max(s[2], config[LEAST_B])
    s[3] = max(s[3], 2.0 * s[2] + config[MARGIN])
    return moved


@unrolled
def _restart(state: Any, s: Any, P: Any, config: Any, n: int) -> None:
    """Let P start anew, and with it the hysteresis w_h; the parameters stay."""
    for i in range(n):
        for j in range(n):
            P[i * n + j] = 0.0
        P[i * n + i] = config[START + i]
    if config[HYSTERETIC] != 0.0:
        s[0] = 0.0
    state[RESETS] += 1.0


@unrolled
def _take(state: Any, config: Any, line: Any, u: Any, x: Any, n: int) -> None:
    """One sample of a filter of `n` states; `line` is None where nothing is delayed."""
    s, P, gain, work = _views(state, n)
    state[SAMPLES] += 1.0
    if np.abs(u) < WILDEST:
        if line is not None:
            u = delayed(line, config[FRACTION], u)
        if state[PRIMED] == 0.0:
            state[PRIMED] = 1.0
            state[U_CENTRE] = u * config[OFFSET]
            state[U_LAST] = u - state[U_CENTRE]
        u -= state[U_CENTRE]
        _time_update(s, P, u - state[U_LAST], config, n, work)
        state[U_LAST] = u
        if not (np.abs(s[0]) < kalman.LARGEST_TRACE and kalman.is_covariance(P, n)):
            _restart(state, s, P, config, n)
    else:
        x = np.nan
    if not np.abs(x) < WILDEST:
        state[MISSED] += 1.0
        state[LAST] = MISSING
        return
    if state[CENTRED] == 0.0:
        state[CENTRED] = 1.0
        state[X_CENTRE] = x * config[OFFSET]
    measurement_row(work[:n], u, config, n)
    y = x - state[X_CENTRE] - kalman.measure(s, work[:n], n)
    S = kalman.innovation_variance(P, work[:n], config[NOISE], n, work[n:])
    if not kalman.is_safe(y, S):
        _restart(state, s, P, config, n)
        state[HELD] += 1.0
        state[LAST] = HOLDING
        return
    kalman.correct(s, P, work[:n], y, config[NOISE], S, n, gain, work[n:])
    state[MOVED] = 0.0
    if config[PROJECT] != 0.0:
        state[MOVED] = _onto_admissible(s, P, config, n, work)
    state[INNOVATION] = y
    state[INNOVATION_VARIANCE] = S
    state[UPDATES] += 1.0
    state[LAST] = UPDATED


@register_jitable
def _sample(state: Any, config: Any, u: Any, x: Any) -> None:
    """One sample, with whatever was asked for."""
    n = int(config[N])
    _take(state, config, state[state_size(n) :], u, x, n)


@register_jitable
def proposed(state: Any, config: Any, terms: Any, model: Any) -> None:
    """(alpha, beta, gamma, offset) or (gain, -, -, offset) into `model`, admissible; `terms` = start's."""
    s = state[HEAD : HEAD + int(config[N])]
    offset = terms[1]
    if config[HYSTERETIC] == 0.0:
        gain = admissible.kept_gain(s[0], terms[0], LEAST)
        if config[OFFSET] != 0.0:
            offset = s[1] + state[X_CENTRE] - gain * state[U_CENTRE]
        model[0] = gain
        model[3] = offset
        return
    if config[OFFSET] != 0.0:
        offset = s[4] + state[X_CENTRE] - s[3] * state[U_CENTRE]
    a = s[1] if s[1] != 0.0 else config[LEAST_A]
    alpha, beta, gamma = equations.rate_parameters(a, s[2], s[3])
    model[0] = alpha
    model[1] = beta
    model[2] = gamma
    model[3] = offset
    known = True
    if not admissible.has_inverse(alpha, beta, gamma):
        work = np.empty(9)
        known = admissible.nearest_admissible(model, work, admissible.NEAREST_MARGIN)
    if not known or model[0] < config[LEAST_A] or model[2] < _least_slope(config) * model[0]:
        _lift(model, config, known)


@register_jitable
def _least_slope(config: Any) -> Any:
    """Least c of a model handed out."""
    return 2.0 * config[LEAST_B] + config[MARGIN]


@register_jitable
def _lift(model: Any, config: Any, known: Any) -> None:
    """Lift a model's a and c to their least values; where it is not known, take the start's.

    A model that is far smaller than the start's commands far larger voltages.
    """
    a, b, c = config[LEAST_A] / LEAST, config[LEAST_B] / LEAST, config[MARGIN] / LEAST_MARGIN
    if known:
        a = max(model[0], config[LEAST_A])
        c = max(model[2] / model[0], _least_slope(config))
        b = min(max(c - model[1], config[LEAST_B]), 0.5 * (c - config[MARGIN]))
    alpha, beta, gamma = equations.rate_parameters(a, b, c)
    model[0] = alpha
    model[1] = beta
    model[2] = gamma


@compiled(PROPOSE_TYPES)
def propose(state: Any, config: Any, terms: Any, model: Any) -> None:
    """Compiled `proposed`."""
    proposed(state, config, terms, model)
