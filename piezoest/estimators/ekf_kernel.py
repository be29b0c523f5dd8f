"""The compiled inside of `HysteresisEKF`: time update, measurement update, projection.

The settings of a hysteresis have `least`, those of a linear gain have `gain` instead; the other is absent.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.compile import inlined, like
from piezoest.equations import admissible, believing, kalman, least_squares, swing
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators.delay_line import delayed
from piezoest.estimators.model_writing import write_loop
from piezoest.estimators.samples import HELD, MISSING, OUTCOME, REJECTED, UPDATED
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
    Field,
    numbers,
    record,
)
from piezoest.layout import Record as Layout

# With an offset the filter counts from the first voltage and displacement; whether there was a displacement.
CENTRE = record(u=MEASURED, x=MEASURED, known=FLAG)
# Whether the last update was projected.
PROJECTION = record(moved=FLAG)
# Least a and b, and least c - 2b.
BOUNDS = record(a=NUMBER, b=NUMBER, margin=NUMBER)

# Least a, b or gain of a model handed out, relative to the start's; least c - 2b, relative to its c.
LEAST, LEAST_MARGIN = 1e-2, 1e-3
# Greatest a, times a swing of the voltage: the loop of a larger one is a step at each turn, of which the
# filter would not find back. The start's own is always allowed.
GREATEST = 40.0
# Readings from which a usual change is learnt; standard deviations that an innovation may have, whatever the
# change: no filter that fits its stage gets there.
WARM_UP, EXPECTED = 100.0, 10.0
# The filter takes so many times the travel on a constant reading that least squares takes: it starts from a
# model, and coarse converters are to leave it as it is.
STILL = 20.0


def state_layout(n: int, line: Field, *, offset: bool, project: bool) -> Layout:
    """Layout of the state of a filter of n states; `line` is the storage of the delay."""
    return record(
        __name__,
        samples=COUNT, missing=COUNT, outliers=COUNT, updates=COUNT, held=COUNT, resets=COUNT, last=OUTCOME,
        primed=FLAG, u_last=MEASURED, x_last=MEASURED, travel=AMOUNT, gap=COUNT, y=NUMBER, S=AMOUNT,
        belief=believing.BELIEF, swing=swing.SWING,
        centre=CENTRE if offset else ABSENT, projection=PROJECTION if project else ABSENT,
        filter=record(s=numbers(n, kind=PARAMETER), P=numbers(n, n, kind=COVARIANCE), K=numbers(n)),
        line=line,
    )  # fmt: skip


def settings_layout(n: int, *, hysteretic: bool) -> Layout:
    """Layout of the settings: noise and random walk (variances), and of the start offset and variances."""
    return record(
        longest_gap=FIXED, noise=AMOUNT, offset=NUMBER, gain=ABSENT if hysteretic else NUMBER,
        least=BOUNDS if hysteretic else ABSENT, walk=numbers(n), variances=numbers(n),
    )  # fmt: skip


@inlined
def from_first_voltage(state: Any, u: Any) -> Any:
    """Voltage less the first one, where there is an offset."""
    if state.centre is None:
        return u
    if state.primed == 0.0:
        state.centre.u = u
    return u - state.centre.u


@inlined
def from_first_displacement(state: Any, x: Any) -> Any:
    """Displacement less the first one, where there is an offset."""
    centre = state.centre
    if centre is None:
        return x
    if centre.known == 0.0:
        centre.known = 1.0
        centre.x = x
    return x - centre.x


@inlined
def _time_update(state: Any, settings: Any, du: Any) -> None:
    """Exact sample map of the state, its Jacobian for the covariance, process noise."""
    s, P = state.filter.s, state.filter.P
    row, q = like(s), like(s)
    for i in range(len(s)):
        row[i] = 0.0
        q[i] = settings.walk[i]
    if settings.least is None:
        row[0] = 1.0
        kalman.predict_covariance(P, row, 1, q)
    else:
        w_h, kept, by_a, by_b = equations.hysteresis_linearised(s[0], du, s[1], s[2])
        q[0] += kalman.bilinear_variance(P, du, s[1])
        s[0] = w_h
        row[0], row[1], row[2] = kept, by_a, by_b
        kalman.predict_covariance(P, row, 3, q)


@inlined
def measurement_row(state: Any, settings: Any, u: Any, h: Any) -> None:
    """dx/ds into `h`: x = w_h + c u (+ offset), or x = K u (+ offset)."""
    for i in range(len(h)):
        h[i] = 0.0
    if settings.least is None:
        h[0] = u
    else:
        h[0] = 1.0
        h[3] = u
    if state.centre is not None:
        h[len(h) - 1] = 1.0


@register_jitable
def _restart(state: Any, settings: Any) -> None:
    """Let P start again, and with it the hysteresis w_h; the parameters stay."""
    P = state.filter.P
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] = 0.0
        P[i, i] = settings.variances[i]
    if settings.least is not None:
        state.filter.s[0] = 0.0
    state.resets += 1.0


@register_jitable
def _onto_face(s: Any, P: Any, by_a: float, by_b: float, by_c: float, least: Any) -> Any:
    """Project onto by_a a + by_b b + by_c c >= least."""
    g = like(s)
    for i in range(len(s)):
        g[i] = 0.0
    g[1], g[2], g[3] = by_a, by_b, by_c
    return kalman.project(s, P, g, least)


@register_jitable
def _onto_admissible(s: Any, P: Any, least: Any, greatest: Any) -> Any:
    """Project onto a, b and c - 2b within their bounds: flat faces in this form. 1.0 if that moves s."""
    moved = max((s[1] > greatest) * 1.0, _onto_face(s, P, 1.0, 0.0, 0.0, least.a))
    moved = max(moved, _onto_face(s, P, 0.0, 1.0, 0.0, least.b))
    moved = max(moved, _onto_face(s, P, 0.0, -2.0, 1.0, least.margin))
    # The faces meet at an angle: whatever is left over is clamped.
    s[1] = min(max(s[1], least.a), greatest)
    s[2] = max(s[2], least.b)
    s[3] = max(s[3], 2.0 * s[2] + least.margin)
    return moved


@inlined
def _project(state: Any, settings: Any) -> None:
    """Keep the estimate in the admissible set."""
    s, least = state.filter.s, settings.least
    state.projection.moved = 0.0
    greatest = max(GREATEST / max(state.swing.size, swing.SMALLEST), least.a / LEAST)
    within = s[1] >= least.a and s[1] <= greatest
    if not (within and s[2] >= least.b and s[3] - 2.0 * s[2] >= least.margin):
        state.projection.moved = _onto_admissible(s, state.filter.P, least, greatest)


@inlined
def _is_surprising(state: Any, settings: Any, dx: Any, y: Any, S: Any) -> Any:
    """Whether neither its size nor the filter, with innovation y of variance S, explains a change by dx."""
    s = state.filter.s
    slope = abs(s[0] if settings.least is None else s[3])
    if believing.believable(state.belief, dx, slope, state.travel, WARM_UP):
        return False
    return y * y > EXPECTED * EXPECTED * S


@inlined
def sample(state: Any, settings: Any, u: Any, x: Any) -> None:
    """Take one sample."""
    s, P = state.filter.s, state.filter.P
    state.samples += 1.0
    if np.abs(u) < WILDEST:
        u = from_first_voltage(state, delayed(state.line, u))
        if state.primed == 0.0:
            state.primed = 1.0
            state.u_last = u
        _time_update(state, settings, u - state.u_last)
        state.travel += abs(u - state.u_last)
        swing.follow(state.swing, u)
        state.u_last = u
        if not (np.abs(s[0]) < kalman.LARGEST_TRACE and kalman.is_covariance(P)):
            _restart(state, settings)
    else:
        x = np.nan
    if not np.abs(x) < WILDEST:
        state.missing += 1.0
        state.gap += 1.0
        state.last = MISSING
        return
    x = from_first_displacement(state, x)
    h, product = like(s), like(s)
    measurement_row(state, settings, u, h)
    y = x - least_squares.predicted_output(s, h)
    S = kalman.innovation_variance(P, h, settings.noise, product)
    belief, travel = state.belief, state.travel
    if belief.seen == 0.0:
        state.x_last = x
        travel = 0.0
    dx = x - state.x_last
    still = state.swing.usual > 0.0 and believing.stands_still(belief, dx, travel, STILL * state.swing.size)
    surprising = not still and _is_surprising(state, settings, dx, y, S)
    if still or (surprising and state.gap < settings.longest_gap):
        state.outliers += 1.0
        state.gap += 1.0
        state.last = REJECTED
        return
    if surprising:  # a reading that stays there is a new level
        believing.believe(belief, dx, travel, WARM_UP)
        if state.centre is not None:  # what can follow a jump follows it
            P[len(P) - 1, len(P) - 1] += y * y
        elif settings.least is not None:
            P[0, 0] += y * y
        S = kalman.innovation_variance(P, h, settings.noise, product)
    state.x_last = x
    state.travel = state.gap = 0.0
    if not kalman.is_safe(y, S):
        _restart(state, settings)
        state.held += 1.0
        state.last = HELD
        return
    kalman.correct(s, P, h, y, settings.noise, S, state.filter.K, product)
    if state.projection is not None:
        _project(state, settings)
    state.y = y
    state.S = S
    state.updates += 1.0
    state.last = UPDATED


@inlined
def _offset(state: Any, settings: Any, slope: Any) -> Any:
    """Offset of the loop of this slope [µm]; the start's where it is not estimated."""
    s, centre = state.filter.s, state.centre
    return settings.offset if centre is None else s[len(s) - 1] + centre.x - slope * centre.u


@register_jitable
def _propose_loop(state: Any, settings: Any, model: Any) -> None:
    """(alpha, beta, gamma, offset) into `model`."""
    s, least = state.filter.s, settings.least
    a = s[1] if s[1] != 0.0 else least.a
    alpha, beta, gamma = equations.rate_parameters(a, s[2], s[3])
    model[0] = alpha
    model[1] = beta
    model[2] = gamma
    model[3] = _offset(state, settings, s[3])
    known = True
    if not admissible.has_inverse(alpha, beta, gamma):
        known = admissible.nearest_admissible(model, admissible.NEAREST_MARGIN)
    if not known or model[0] < least.a or model[2] < _least_slope(least) * model[0]:
        _lift(model, least, known)


@register_jitable
def _least_slope(least: Any) -> Any:
    """Least c of a model handed out."""
    return 2.0 * least.b + least.margin


@register_jitable
def _lift(model: Any, least: Any, known: Any) -> None:
    """Lift a model's a and c to their least values; where it is not known, give the start's.

    A model that is far smaller than the start's commands far larger voltages.
    """
    a, b, c = least.a / LEAST, least.b / LEAST, least.margin / LEAST_MARGIN
    if known:
        a = max(model[0], least.a)
        c = max(model[2] / model[0], _least_slope(least))
        b = min(max(c - model[1], least.b), 0.5 * (c - least.margin))
    alpha, beta, gamma = equations.rate_parameters(a, b, c)
    model[0] = alpha
    model[1] = beta
    model[2] = gamma


@register_jitable
def proposed(state: Any, settings: Any, model: Any) -> None:
    """(alpha, beta, gamma, offset) or (gain, -, -, offset) into `model`, admissible."""
    if settings.least is not None:
        _propose_loop(state, settings, model)
    else:
        model[0] = admissible.kept_gain(state.filter.s[0], settings.gain, LEAST)
        model[3] = _offset(state, settings, model[0])


@register_jitable
def write_model(state: Any, settings: Any, model: Any) -> float:
    """Write the model as known now into settings of its inverse; what became of them, see `model_writing`."""
    return write_loop(state, settings, settings.least is not None, model)


@inlined
def write_row(state: Any, settings: Any, row: Any) -> None:
    """The filter's state."""
    for i in range(len(row)):
        row[i] = state.filter.s[i]


@inlined
def outcome(state: Any) -> Any:
    """Innovation, its variance and the state's covariance."""
    return state.y, state.S, state.filter.P
