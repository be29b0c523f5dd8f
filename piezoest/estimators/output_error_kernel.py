"""The compiled inside of `OutputErrorRLS`: a bank of hystereses, and a Kalman filter around one of them.

The filter's vector is s = (b, c, d, centre, disturbance): b, c and d relative to the initial c, the loop's
centre and the disturbance relative to that times a volt.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.compile import inlined, like, local_rows
from piezoest.equations import believing, kalman, least_squares, sensor_noise, swing
from piezoest.equations import output_error as equations
from piezoest.estimators.delay_line import delayed
from piezoest.estimators.derivative_form import is_believable
from piezoest.estimators.model_writing import write_loop
from piezoest.estimators.samples import HELD, MISSING, OUTCOME, REJECTED, UPDATED, WAITING
from piezoest.layout import (
    ABSENT,
    AMOUNT,
    COUNT,
    COVARIANCE,
    FIXED,
    FLAG,
    MEASURED,
    NUMBER,
    PARAMETER,
    SHARE,
    Field,
    Length,
    numbers,
    record,
    whole,
)
from piezoest.layout import Record as Layout
from piezoest.policies.random_walk import OFF_CENTRE, SLOW, SLOWEST

# Numbers of the filter's vector.
SIZE = 5

# Another member of the bank is used from this fraction of the way to it on.
NEXT = 0.6
# Least b and c - 2b of the model handed out, relative to c; least c, relative to the start's.
LEAST_B, MARGIN, LEAST_C = 2e-3, 1e-3, 1e-2
# Slower than this fraction of its usual pace the voltage is at rest: what then moves x is creep.
RESTING = 0.01
# No variance grows beyond so many times what a parameter walks in a swing.
CEILING = 1e4


def layout(members: int, *, rejects: bool, line: Field) -> Layout:
    """What is kept between samples, for a bank of `members` decays."""
    member = whole(0.0, members - 1.0)
    each = Length("members", members)
    law = record(
        innovation=NUMBER, innovation_variance=AMOUNT, updates=COUNT, held=COUNT, resets=COUNT, last=OUTCOME,
        s=numbers(SIZE, kind=PARAMETER), P=numbers(SIZE, SIZE, kind=COVARIANCE), gain=numbers(SIZE),
    )  # fmt: skip
    return record(
        __name__,
        primed=FLAG, u_last=MEASURED, x_last=MEASURED, travel=AMOUNT, gap=COUNT, samples=COUNT, missing=COUNT,
        outliers=COUNT, frozen=FLAG, rested=COUNT, centre=record(u=MEASURED, x=MEASURED),
        # The regressors, those of the last update, and the bank's members of then and now.
        phi=numbers(SIZE), phi_before=numbers(3), member=member, member_before=member,
        swing=swing.SWING, noise=sensor_noise.NOISE, belief=believing.BELIEF if rejects else ABSENT,
        excitation=record(swings=SHARE, mean=numbers(3, 3, kind=COVARIANCE)), law=law,
        # w_h for b = 1 of each decay, and its derivative by the decay's logarithm.
        bank=record(h=numbers(each, kind=MEASURED), slope=numbers(each, kind=MEASURED)), line=line,
    )  # fmt: skip


def settings_layout(members: int, *, rejects: bool) -> Layout:
    """What compiled code is given."""
    policies = record(
        random_walk=record(walk=FIXED, memory=FIXED),
        outlier_rejection=record(warm_up=FIXED) if rejects else ABSENT,
    )
    return record(
        longest_gap=FIXED, first_half_period=FIXED, unit=FIXED, noise_factor=FIXED, slack=FIXED,
        lasting=FIXED, step=FIXED, variance=FIXED, start_b=FIXED, spread=FIXED, start_offset=FIXED,
        policies=policies, decays=numbers(Length("members", members), kind=FIXED),
    )  # fmt: skip


@register_jitable
def _move(state: Any, settings: Any, u: Any) -> None:
    """Follow the voltage: the bank and the swing."""
    du = u - state.u_last
    state.u_last = u
    if du == 0.0:
        return
    state.travel += abs(du)
    h, slope = state.bank.h, state.bank.slope
    for i in range(len(h)):
        h[i], slope[i] = equations.hysteresis_and_slope(h[i], slope[i], du, settings.decays[i])
    swing.follow(state.swing, u)


@register_jitable
def _excite(state: Any, fraction: Any) -> None:
    """Mean over a swing of the changes of the regressors, by each other, in unit of motion."""
    phi, before, excitation = state.phi, state.phi_before, state.excitation
    if state.member == state.member_before:
        excitation.swings = min(excitation.swings + fraction, 1.0)
        for i in range(3):
            for j in range(3):
                product = (phi[i] - before[i]) * (phi[j] - before[j])
                mean = excitation.mean[i, j]
                excitation.mean[i, j] = mean + (product / fraction - fraction * mean) / excitation.swings
    state.member_before = state.member
    for i in range(3):
        before[i] = phi[i]


@register_jitable
def _walk(state: Any, settings: Any, fraction: Any, pace: Any) -> Any:
    """Let P grow, and return the variance of a sample's own noise.

    As in `HysteresisRLS` everything is counted in swings, and the noise of a whole swing follows from the
    memory wanted and the excitation. Here it is how far the disturbance walks.
    """
    s, P, policy = state.law.s, state.law.P, settings.policies.random_walk
    Q = local_rows(3, 3)
    b, c = s[0], max(s[1], LEAST_C)
    equations.walk_covariance(min(max(b, LEAST_B * c), 0.5 * c), c, Q)
    below = P[1, 1] < CEILING * policy.walk * Q[1, 1]
    noise = 0.0
    for i in range(3):
        for j in range(3):
            q = policy.walk * Q[i, j]
            noise += q * state.excitation.mean[i, j]
            P[i, j] += q * fraction * below
    off_centre = OFF_CENTRE * c * state.swing.size
    q = policy.walk * off_centre * off_centre
    P[3, 3] = least_squares.random_walk(P[3, 3], q * fraction, CEILING * q)
    memory_squared = policy.memory * policy.memory + sensor_noise.memory_squared(
        state.noise, state.swing, s[1], settings.unit, settings.noise_factor
    )
    noise *= memory_squared
    stationary = 0.5 * settings.lasting * noise
    equations.relax(s, P, 4, np.exp(-pace / settings.lasting), stationary)
    # At rest creep goes on, unseen.
    P[4, 4] += min(state.rested * pace * noise, stationary)
    unit = settings.unit
    return settings.slack * noise * pace + (settings.variance + state.noise.variance) / (unit * unit)


@register_jitable
def _choose_member(state: Any, settings: Any) -> None:
    """Go on with the next member of the bank where the estimate is nearer to it."""
    s = state.law.s
    b, c, d = s[0], s[1], s[2]
    if b < 10.0 * LEAST_B * max(c, LEAST_C):
        return
    way = d / b
    step = 0.0
    if way > NEXT * settings.step and state.member < len(settings.decays) - 1.0:
        step = 1.0
    elif way < -NEXT * settings.step and state.member > 0.0:
        step = -1.0
    if step != 0.0:
        equations.recentre(s, state.law.P, step * settings.step)
        state.member += step


@register_jitable
def start_covariance(P: Any, start_b: Any, spread: Any) -> None:
    """Covariance P as at the start."""
    Q = local_rows(3, 3)
    equations.walk_covariance(start_b, 1.0, Q)
    for i in range(SIZE):
        for j in range(SIZE):
            P[i, j] = Q[i, j] * spread if i < 3 and j < 3 else 0.0


@register_jitable
def _hold(state: Any, settings: Any) -> None:
    """Count a sample whose update is not safe: the estimate stays, P starts again."""
    law = state.law
    start_covariance(law.P, settings.start_b, settings.spread)
    law.resets += 1.0
    law.held += 1.0
    law.last = HELD


@register_jitable
def _adapt(state: Any, settings: Any, u: Any, x: Any, fraction: Any, jumped: Any) -> None:
    """One update of the filter."""
    law, phi = state.law, state.phi
    s, P = law.s, law.P
    member = int(state.member)
    phi[0], phi[1], phi[2] = state.bank.h[member], u, state.bank.slope[member]
    phi[3] = phi[4] = 1.0
    _excite(state, fraction)
    pace = max(fraction, SLOW / swing.half_period(state.swing, settings.first_half_period))
    R = _walk(state, settings, fraction, pace)
    y = x / settings.unit - least_squares.predicted_output(s, phi)
    if jumped:
        P[3, 3] += y * y
    product = like(s)
    variance = kalman.innovation_variance(P, phi, R, product)
    if not (kalman.is_safe(y, variance) and kalman.is_covariance(P)):
        _hold(state, settings)
        return
    kalman.correct(s, P, phi, y, R, variance, law.gain, product)
    _choose_member(state, settings)
    law.innovation = y
    law.innovation_variance = variance
    law.updates += 1.0
    law.last = UPDATED


@register_jitable
def _at_rest(state: Any, settings: Any, fraction: Any) -> Any:
    """Whether the voltage hardly moves, by its swings of before."""
    usual = state.swing.usual
    usual = usual if usual > 0.0 else settings.first_half_period
    return fraction < max(RESTING * (1.0 + state.gap) / usual, SLOWEST)


@register_jitable
def sample(state: Any, settings: Any, u: Any, x: Any) -> None:
    """One raw sample."""
    law = state.law
    if np.abs(u) < WILDEST:
        u = delayed(state.line, u)
    state.samples += 1.0
    known = np.abs(u) < WILDEST
    measured = known and np.abs(x) < WILDEST
    if not measured:
        state.missing += 1.0
        law.last = MISSING
    if state.primed == 0.0:
        if measured:
            state.primed = 1.0
            state.centre.u = u
            state.centre.x = x
            law.last = WAITING
        return
    if known:
        u -= state.centre.u
        _move(state, settings, u)
    jumped = state.gap > settings.longest_gap
    if measured and not is_believable(state, settings, abs(law.s[1]) * settings.unit, x, jumped):
        state.outliers += 1.0
        law.last = REJECTED
        measured = False
    if not measured:
        state.gap += 1.0
        return
    x -= state.centre.x
    if state.gap == 0.0:
        sensor_noise.measure(state.noise, x - state.x_last)
    state.x_last = x
    fraction = swing.fraction_of_swing(state.swing, state.travel, settings.first_half_period)
    held = _at_rest(state, settings, fraction) or state.frozen != 0.0
    state.travel = state.gap = 0.0
    if held:
        state.rested += 1.0
        law.held += 1.0
        law.last = HELD
        return
    _adapt(state, settings, u, x, fraction, jumped)
    state.rested = 0.0


@register_jitable
def proposed(state: Any, settings: Any, model: Any) -> None:
    """(alpha, beta, gamma, offset) into `model`: as estimated, or the nearest point in the metric of P."""
    P = state.law.P
    s, face = like(state.law.s), like(state.law.s)
    for i in range(SIZE):
        s[i] = state.law.s[i]
        face[i] = 0.0
    face[1] = 1.0
    kalman.project(s, P, face, LEAST_C)
    face[0], face[1] = 1.0, -LEAST_B
    kalman.project(s, P, face, 0.0)
    face[0], face[1] = -2.0, 1.0 - MARGIN
    kalman.project(s, P, face, 0.0)
    # The faces meet at an angle: whatever is left over is clamped.
    c = max(s[1], LEAST_C)
    b = min(max(s[0], LEAST_B * c), 0.5 * (1.0 - MARGIN) * c)
    a = settings.decays[int(state.member)] * np.exp(equations.log_ratio(b, s[2], settings.step))
    unit = settings.unit
    model[0] = a
    model[1] = (c - b) * unit
    model[2] = a * c * unit
    model[3] = (s[3] + s[4] - c * state.centre.u) * unit + state.centre.x
    if state.primed == 0.0:
        model[3] = settings.start_offset


@register_jitable
def write_model(state: Any, settings: Any, model: Any) -> float:
    """Write the model as known now into settings of its inverse; what became of them, see `model_writing`."""
    return write_loop(state, settings, True, model)


@inlined
def write_row(state: Any, settings: Any, row: Any) -> None:
    """The filter's vector and the member in use into a row of six."""
    for i in range(SIZE):
        row[i] = state.law.s[i]
    row[SIZE] = state.member


@inlined
def outcome(state: Any) -> Any:
    """Innovation, its variance and P."""
    return state.law.innovation, state.law.innovation_variance, state.law.P
