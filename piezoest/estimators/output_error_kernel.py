"""The compiled inside of `OutputErrorRLS`: a bank of hystereses, and a Kalman filter around one of them.

What comes before the regression (outliers, the sensor's noise, the voltage's clock) is that of
`HysteresisRLS`, in the same places of the state.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest._jit import PROPOSE_TYPES, RUN_TYPES, STEP_TYPES, UNCOUNTED, compiled
from piezoest.equations import kalman, least_squares
from piezoest.equations import output_error as equations
from piezoest.estimators import believing, swing
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as front
from piezoest.estimators.delay_line import delayed
from piezoest.estimators.record_loops import keep_outcome

# The filter's state: b, c and d in parts of the initial c, the loop's centre and the disturbance in
# that times a volt.
B, C, D, CENTRE, DISTURBANCE, SIZE = range(6)

# State, in places that the front end leaves free: regressors at the last update, the bank's member in
# use and the one of the last update, samples at rest since.
BEFORE = front.LOW
MEMBER, MEMBER_BEFORE, RESTED = range(front.HIGH, front.HIGH + 3)
# Then the filter's vectors, the bank and the delay line.
S = front.FRONT + law.HEAD
P = S + SIZE
GAIN = P + SIZE * SIZE
WORK = GAIN + SIZE
BANK = WORK + SIZE * SIZE + SIZE

# Configuration behind the front end's: the sample's slack in samples, squared; memory of the
# disturbance in swings; ratio of the bank's neighbours, in logarithm; least variance of the noise
# [µm²]; members; the start's b, and its relative variance.
SLACK, LASTING, STEP, VARIANCE, MEMBERS, START_B, SPREAD, DECAYS = range(front.CONFIG, front.CONFIG + 8)

# Another member of the bank is taken from this part of the way to it on.
NEXT = 0.6
# Least b and c - 2b of the model handed out, in parts of c; least c in parts of the start's.
LEAST_B, MARGIN, LEAST_C = 2e-3, 1e-3, 1e-2
# Slower than this part of its usual pace the voltage is at rest: what then moves x is creep.
RESTING = 0.01
# No variance grows beyond so many times what a parameter walks in a swing.
CEILING = 1e4


@register_jitable
def bank_end(config: Any) -> Any:
    """Where the delay line begins."""
    return BANK + 2 * int(config[MEMBERS])


@register_jitable
def _move(state: Any, config: Any, u: Any) -> None:
    """Take the next voltage into the bank and the clock."""
    du = u - state[front.U_LAST]
    state[front.U_LAST] = u
    if du == 0.0:
        return
    state[front.TRAVEL] += abs(du)
    members = int(config[MEMBERS])
    for i in range(members):
        k = BANK + 2 * i
        state[k], state[k + 1] = equations.hysteresis_and_slope(
            state[k], state[k + 1], du, config[DECAYS + i]
        )
    swing.follow(state[front.SWING : front.SWING + swing.STATE], u)


@register_jitable
def _excite(state: Any, phi: Any, part: Any) -> None:
    """Mean over a swing of the changes of the regressors, by each other, in unit of motion."""
    before = state[BEFORE : BEFORE + SIZE]
    if state[MEMBER] == state[MEMBER_BEFORE]:
        state[front.WAY] = min(state[front.WAY] + part, 1.0)
        for i in range(3):
            for j in range(3):
                k = front.EXCITATION + i * 3 + j
                product = (phi[i] - before[i]) * (phi[j] - before[j])
                state[k] += (product / part - part * state[k]) / state[front.WAY]
    state[MEMBER_BEFORE] = state[MEMBER]
    for i in range(3):
        before[i] = phi[i]


@register_jitable
def _walk(state: Any, config: Any, part: Any, pace: Any) -> Any:
    """Let P grow, and return the variance of a sample's own noise.

    As in `HysteresisRLS` everything is counted in swings, and the noise of a whole swing
    follows from the memory wanted and the excitation. Here it is how far the disturbance walks.
    """
    s, cov = state[S : S + SIZE], state[P : P + SIZE * SIZE]
    Q = state[WORK : WORK + 9]
    c = max(s[C], LEAST_C)
    equations.walk_covariance(min(max(s[B], LEAST_B * c), 0.5 * c), c, Q)
    below = cov[C * SIZE + C] < CEILING * config[front.WALK] * Q[4]
    noise = 0.0
    for i in range(3):
        for j in range(3):
            q = config[front.WALK] * Q[i * 3 + j]
            noise += q * state[front.EXCITATION + i * 3 + j]
            cov[i * SIZE + j] += q * part * below
    off_centre = front.OFF_CENTRE * c * state[front.SWING + swing.SIZE]
    q = config[front.WALK] * off_centre * off_centre
    k = CENTRE * SIZE + CENTRE
    cov[k] = least_squares.random_walk(cov[k], q * part, CEILING * q)
    memory_squared = config[front.WALK_MEMORY] * config[front.WALK_MEMORY] + front._noise_memory(
        state, config
    )
    noise *= memory_squared
    stationary = 0.5 * config[LASTING] * noise
    equations.relax(s, cov, SIZE, DISTURBANCE, np.exp(-pace / config[LASTING]), stationary)
    # At rest creep goes on, unseen.
    cov[SIZE * SIZE - 1] += min(state[RESTED] * pace * noise, stationary)
    unit = config[front.SCALE + 1]
    return config[SLACK] * noise * pace + (config[VARIANCE] + state[front.NOISE]) / (unit * unit)


@register_jitable
def _choose_member(state: Any, config: Any) -> None:
    """Go on with the next member of the bank where the estimate is nearer to it."""
    s = state[S : S + SIZE]
    if s[B] < 10.0 * LEAST_B * max(s[C], LEAST_C):
        return
    way = s[D] / s[B]
    step = 0.0
    if way > NEXT * config[STEP] and state[MEMBER] < config[MEMBERS] - 1.0:
        step = 1.0
    elif way < -NEXT * config[STEP] and state[MEMBER] > 0.0:
        step = -1.0
    if step != 0.0:
        equations.recentre(s, state[P : P + SIZE * SIZE], SIZE, step * config[STEP])
        state[MEMBER] += step


@register_jitable
def start_covariance(state: Any, config: Any) -> None:
    """Covariance as at the start."""
    cov, Q = state[P : P + SIZE * SIZE], state[WORK : WORK + 9]
    equations.walk_covariance(config[START_B], 1.0, Q)
    for i in range(SIZE):
        for j in range(SIZE):
            cov[i * SIZE + j] = 0.0
    for i in range(3):
        for j in range(3):
            cov[i * SIZE + j] = Q[i * 3 + j] * config[SPREAD]


@register_jitable
def _hold(state: Any, config: Any) -> None:
    """Count a sample whose update is not safe: the estimate stays, P starts anew."""
    start_covariance(state, config)
    law_state = state[front.FRONT :]
    law_state[law.RESETS] += 1.0
    law_state[law.HELD] += 1.0
    law_state[law.LAST] = law.HOLDING


@register_jitable
def _adapt(state: Any, config: Any, u: Any, x: Any, part: Any, jumped: Any) -> None:
    """One update of the filter."""
    s, cov = state[S : S + SIZE], state[P : P + SIZE * SIZE]
    phi = state[front.PHI : front.PHI + SIZE]
    k = BANK + 2 * int(state[MEMBER])
    phi[B], phi[C], phi[D] = state[k], u, state[k + 1]
    phi[CENTRE] = phi[DISTURBANCE] = 1.0
    _excite(state, phi, part)
    clock = state[front.SWING : front.SWING + swing.STATE]
    pace = max(part, front.SLOW / swing.half_period(clock, config[front.FIRST_HALF]))
    R = _walk(state, config, part, pace)
    y = x / config[front.SCALE + 1] - kalman.measure(s, phi, SIZE)
    if jumped:
        cov[CENTRE * SIZE + CENTRE] += y * y
    work = state[WORK : WORK + SIZE * SIZE]
    variance = kalman.innovation_variance(cov, phi, R, SIZE, work)
    if not (kalman.is_safe(y, variance) and kalman.is_covariance(cov, SIZE)):
        _hold(state, config)
        return
    kalman.correct(s, cov, phi, y, R, variance, SIZE, state[GAIN : GAIN + SIZE], work)
    _choose_member(state, config)
    law_state = state[front.FRONT :]
    law_state[law.INNOVATION] = y
    law_state[law.INNOVATION_VARIANCE] = variance
    law_state[law.UPDATES] += 1.0
    law_state[law.LAST] = law.UPDATED


@register_jitable
def _at_rest(state: Any, config: Any, part: Any) -> Any:
    """Whether the voltage hardly moves, by its clock of before."""
    usual = state[front.SWING + swing.USUAL]
    usual = usual if usual > 0.0 else config[front.FIRST_HALF]
    return part < max(RESTING * (1.0 + state[front.GAP]) / usual, front.SLOWEST)


@register_jitable
def _sample(state: Any, config: Any, u: Any, x: Any) -> None:
    """One raw sample."""
    law_state = state[front.FRONT :]
    if np.abs(u) < WILDEST:
        u = delayed(state[bank_end(config) :], config[front.FRACTION], u)
    state[front.SAMPLES] += 1.0
    known = np.abs(u) < WILDEST
    measured = known and np.abs(x) < WILDEST
    if not measured:
        state[front.MISSED] += 1.0
        law_state[law.LAST] = law.MISSING
    if state[front.PRIMED] == 0.0:
        if measured:
            state[front.PRIMED] = 1.0
            state[front.U_CENTRE] = u
            state[front.X_CENTRE] = x
            law_state[law.LAST] = law.WAITING
        return
    if known:
        u -= state[front.U_CENTRE]
        _move(state, config, u)
    jumped = state[front.GAP] > config[front.LONGEST_GAP]
    if jumped:
        state[front.BELIEF + believing.SEEN] = 0.0
    if measured and not front._believable(state, config, x):
        state[front.OUTLIERS] += 1.0
        law_state[law.LAST] = law.REJECTED
        measured = False
    if not measured:
        state[front.GAP] += 1.0
        return
    x -= state[front.X_CENTRE]
    if state[front.GAP] == 0.0:
        front._measure_noise(state, x - state[front.X_LAST])
    state[front.X_LAST] = x
    clock = state[front.SWING : front.SWING + swing.STATE]
    part = swing.part_of_swing(clock, state[front.TRAVEL], config[front.FIRST_HALF])
    held = _at_rest(state, config, part) or state[front.FROZEN] != 0.0
    state[front.TRAVEL] = state[front.GAP] = 0.0
    if held:
        state[RESTED] += 1.0
        law_state[law.HELD] += 1.0
        law_state[law.LAST] = law.HOLDING
        return
    _adapt(state, config, u, x, part, jumped)
    state[RESTED] = 0.0


@register_jitable
def decay(config: Any, member: Any, b: Any, d: Any) -> Any:
    """Decay a [1/V]: the member's own, corrected by d."""
    return config[DECAYS + int(member)] * np.exp(equations.log_ratio(b, d, config[STEP]))


@register_jitable
def proposed(state: Any, config: Any, terms: Any, model: Any) -> None:
    """(alpha, beta, gamma, offset) into `model`: as estimated, or the nearest point in the metric of P."""
    s = np.empty(SIZE)
    face = np.empty(SIZE)
    work = np.empty(SIZE)
    for i in range(SIZE):
        s[i] = state[S + i]
        face[i] = 0.0
    cov = state[P : P + SIZE * SIZE]
    face[C] = 1.0
    kalman.project(s, cov, face, LEAST_C, SIZE, work)
    face[B], face[C] = 1.0, -LEAST_B
    kalman.project(s, cov, face, 0.0, SIZE, work)
    face[B], face[C] = -2.0, 1.0 - MARGIN
    kalman.project(s, cov, face, 0.0, SIZE, work)
    # The faces meet at an angle: whatever is left over is clamped.
    c = max(s[C], LEAST_C)
    b = min(max(s[B], LEAST_B * c), 0.5 * (1.0 - MARGIN) * c)
    unit = config[front.SCALE + 1]
    a = decay(config, state[MEMBER], b, s[D])
    model[0] = a
    model[1] = (c - b) * unit
    model[2] = a * c * unit
    model[3] = (s[CENTRE] + s[DISTURBANCE] - c * state[front.U_CENTRE]) * unit + state[front.X_CENTRE]
    if state[front.PRIMED] == 0.0:
        model[3] = terms[0]


@compiled(PROPOSE_TYPES)
def propose(state: Any, config: Any, terms: Any, model: Any) -> None:
    """Compiled `proposed`."""
    proposed(state, config, terms, model)


@compiled(STEP_TYPES, nogil=True, **UNCOUNTED)
def step(state: Any, config: Any, u: float, x: float) -> None:
    """Take one sample."""
    _sample(state, config, u, x)


@register_jitable
def _keep(state: Any, row: int, s: Any, y: Any, variance: Any, covariance: Any) -> None:
    """Write a sample's outcome into the histories that have room; `s`: the filter's state, the member."""
    if s.size > 0:
        for i in range(SIZE):
            s[row, i] = state[S + i]
        s[row, SIZE] = state[MEMBER]
    now = state[front.FRONT :]
    innovation, S_now = now[law.INNOVATION], now[law.INNOVATION_VARIANCE]
    keep_outcome(row, innovation, S_now, state[P : P + SIZE * SIZE], SIZE, y, variance, covariance)


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
            _keep(state, row, s, y, S, P)
            row, due = row + 1, every
