"""The compiled inside of `PrandtlIshlinskiiRLS`: plays, windows of travel, and the law."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.compile import inlined
from piezoest.equations.believing import BELIEF, believable, believe, stands_still
from piezoest.equations.least_squares import predicted_output, restore_covariance
from piezoest.equations.mechanics import mechanics_step
from piezoest.equations.swing import SWING, follow, half_period
from piezoest.equations.turning_points import remember
from piezoest.estimators import play_grid
from piezoest.estimators.delay_line import delayed
from piezoest.estimators.model_writing import write_plays
from piezoest.estimators.play_grid import ENOUGH_TURNS, LEVEL_START, begin_window, regressor
from piezoest.estimators.samples import HELD, MISSING, OUTCOME, REJECTED, UPDATED, WAITING
from piezoest.layout import (
    AMOUNT,
    COUNT,
    FIXED,
    FLAG,
    MEASURED,
    NUMBER,
    PARAMETER,
    SYMMETRIC,
    WORK,
    Field,
    Length,
    numbers,
    record,
)
from piezoest.layout import Record as Layout

# Relative to the stroke, to the start, or to the range travelled.
SLACK = 5e-3  # misfit of one window that is no parameter's
LEVEL_TRAVEL = 1e-3  # walk of the level per root of the range travelled
LEVEL_TIME = 1e-3  # ... and of half a period
COMMON_WALK = 0.02  # walk of all slopes together per root of the range travelled
SINGLE_WALK = 0.15  # ... and of each apart from the others, relative to its prior deviation
WINDOWS = 32.0  # updates while the voltage travels half its range
LEAST_GAIN = 0.05  # least slope just after a turn, relative to the start's
AT_REST = 8.0  # a window with less than this fraction of its travel is a dwell

WARM_UP = 100.0  # readings from which a usual step is learnt
SWEEPS = 10  # over the constraints
SMALLEST = 1e-18  # variance of a parameter
LARGEST = 1e100  # variance of an innovation that says nothing any more
WILD = 100.0  # standard deviations beyond which an innovation counts no more

# Displacement and velocity behind the mechanics, which are given a voltage, and the step of one sample.
RESONANCE = record(motion=numbers(2), coefficients=numbers(6, kind=FIXED))


def layout(plan: play_grid.Plan, line: Field, resonance: Field) -> Layout:
    """Layout of the state for a start; a delay's storage and a resonance, where there are any."""
    size = Length("size", plan.slopes.size + plan.times.size + 1)
    # Estimate and covariance, parameters in use, forces of the constraints.
    law = record(
        theta=numbers(size, kind=PARAMETER), P=numbers(size, size, kind=SYMMETRIC),
        used=numbers(size, kind=PARAMETER), force=numbers(size, kind=AMOUNT), work=numbers(size, kind=WORK),
    )  # fmt: skip
    return record(
        __name__,
        samples=COUNT, missing=COUNT, outliers=COUNT, updates=COUNT, held=COUNT, resets=COUNT,
        last=OUTCOME, frozen=FLAG, primed=FLAG, y=NUMBER, S=AMOUNT,
        x_last=MEASURED, gap=COUNT, gap_travel=AMOUNT, offset=PARAMETER,
        belief=BELIEF, swing=SWING, resonance=resonance,
        plays=play_grid.layout(plan), window=play_grid.window_layout(plan), law=law, line=line,
    )  # fmt: skip


def settings_layout(plan: play_grid.Plan) -> Layout:
    """Layout of what no sample changes."""
    size = Length("size", plan.slopes.size + plan.times.size + 1)
    return record(
        unit=FIXED, noise=FIXED, first_half_period=FIXED, longest_gap=FIXED, grid_is_fixed=FIXED,
        relative_thresholds=numbers(Length("plays", plan.relative.size)),
        relative_bends=numbers(Length("bends", plan.bends.size)),
        decays=numbers(Length("terms", plan.times.size)),
        prior=numbers(size, size), spread=numbers(size),
    )  # fmt: skip


@register_jitable
def _add_row(total: Any, P: Any, i: int, factor: Any) -> None:
    """Add row i of P times a factor to `total`."""
    for j in range(len(total)):
        total[j] += P[i, j] * factor


@register_jitable
def _walk(law: Any, plays: Any, window: Any, settings: Any, half_period: Any) -> None:
    """What may have changed since the last update: only what has moved, and the level."""
    P, theta, step, way = law.P, law.theta, law.work, plays.way
    prior, spread = settings.prior, settings.spread
    slopes, level, travel, half_width = len(way), len(theta) - 1, plays.travel, plays.half_width
    if travel > 0.0:
        common = np.sqrt(COMMON_WALK**2 * travel / half_width)
        single = SINGLE_WALK**2 / half_width
        for i in range(slopes):  # as all slopes walk by the same fraction of themselves
            step[i] = common * way[i] / travel * theta[i] if P[i, i] < prior[i, i] else 0.0
        for i in range(slopes):
            factor = step[i]
            if factor != 0.0:
                for j in range(slopes):
                    P[i, j] += step[j] * factor
        for i in range(level):
            if P[i, i] < prior[i, i]:
                P[i, i] += single * (way[i] if i < slopes else travel) * spread[i] ** 2
    stroke = settings.unit * half_width
    grown = LEVEL_TRAVEL**2 * travel / half_width + LEVEL_TIME**2 * window.elapsed / half_period
    P[level, level] = min(P[level, level] + grown * stroke**2, stroke**2)


@register_jitable
def _constrain(law: Any, columns: int) -> None:
    """Parameters to use: the estimate's nearest in the metric of P with nothing below its least.

    The estimate and its covariance are left alone: what is said against a constraint stays known. C.
    Hildreth, Naval Research Logistics Quarterly 4 (1957) 79-85: each force lifts one parameter to its bound,
    and they are kept from update to update.
    """
    theta, P, used, force = law.theta, law.P, law.used, law.force
    level = len(theta) - 1
    for i in range(len(theta)):
        used[i] = theta[i]
    for i in range(level):
        if force[i] > 0.0:
            _add_row(used, P, i, force[i])
    for _ in range(SWEEPS):
        moved = 0.0
        for i in range(level):
            least = LEAST_GAIN if i < columns else 0.0
            variance = P[i, i]
            if variance <= SMALLEST or (force[i] == 0.0 and used[i] >= least):
                continue
            change = max((least - used[i]) / variance, -force[i])
            if change != 0.0:
                force[i] += change
                moved = max(moved, abs(change) * np.sqrt(variance))
                _add_row(used, P, i, change)
        if moved < 1e-3:
            break
    for i in range(level):
        used[i] = max(used[i], LEAST_GAIN if i < columns else 0.0)


@register_jitable
def _update(law: Any, plays: Any, window: Any, settings: Any, half_period: Any, first: int) -> Any:
    """One step of the law, on the means over the window that ends here: the innovation and its variance.

    Parameters before `first` are left alone, but what is unknown of them counts (S. F. Schmidt's consider
    filter): at a dwell the slopes say nothing. A variance of zero says that there was no step: the covariance
    was spoilt, and is the start's.
    """
    theta, P, mean, work = law.theta, law.P, window.phi, law.work
    size, count = len(theta), window.count
    _walk(law, plays, window, settings, half_period)
    y = window.x / count
    for i in range(size):
        mean[i] /= count
        y -= theta[i] * mean[i]
        work[i] = 0.0
    R = (SLACK * settings.unit * plays.half_width) ** 2 + settings.noise**2 / count
    S = R
    for i in range(size):  # P is symmetric: row by row, no sum has to wait for its last product
        _add_row(work, P, i, mean[i])
    for i in range(size):
        S += mean[i] * work[i]
    if not (R > 0.0 and S >= R and S < LARGEST and abs(y) < WILDEST):
        # By rounding, as voltages of another order of magnitude can. NaN or infinity anywhere ends up in
        # one of these numbers too.
        restore_covariance(P, settings.prior)
        return 0.0, 0.0
    root = np.sqrt(S)
    believed = max(min(y, WILD * root), -WILD * root)
    for i in range(first, size):
        theta[i] += work[i] / S * believed
    for i in range(size):
        work[i] /= root
    for i in range(size):
        factor = work[i]
        for j in range(0 if i >= first else first, size):
            P[i, j] -= factor * work[j]
    for i in range(size):
        P[i, i] = max(P[i, i], SMALLEST)
    _constrain(law, len(settings.relative_bends) + 1)
    return y, S


@register_jitable
def _regrid(law: Any, plays: Any, window: Any, settings: Any, half_width: Any) -> None:
    """Move to a grid about the middle of the range seen; what is new is unknown: P is the start's."""
    level = len(law.theta) - 1
    expected = predicted_output(law.theta, plays.phi)
    play_grid.move(plays, settings, law.theta, half_width)
    restore_covariance(law.P, settings.prior)
    law.P[level, level] = (LEVEL_START * settings.unit * half_width) ** 2
    regressor(plays, settings.unit, 0.0)
    law.theta[level] += expected - predicted_output(law.theta, plays.phi)
    begin_window(window, plays)
    for i in range(len(law.force)):
        law.force[i] = 0.0
    _constrain(law, len(settings.relative_bends) + 1)


@register_jitable
def start(state: Any, settings: Any) -> None:
    """Grid and parameters in use of a state that is new."""
    play_grid.lay(state.plays, settings)
    regressor(state.plays, settings.unit, 0.0)
    _constrain(state.law, len(settings.relative_bends) + 1)


@register_jitable
def _move(state: Any, settings: Any, u: Any) -> None:
    """Follow the voltage to its next value."""
    plays, law = state.plays, state.law
    du = u - plays.u
    if du != 0.0:
        remember(plays.memory, u)
        direction = state.swing.direction
        follow(state.swing, u)
        if state.swing.direction != direction and plays.turns < ENOUGH_TURNS:
            plays.turns += 1.0
    play_grid.advance(plays, settings, law.used, u)
    if du != 0.0 and settings.grid_is_fixed == 0.0:
        half_width = play_grid.wanted_half_width(plays)
        if half_width > 0.0:
            _regrid(law, plays, state.window, settings, half_width)
            state.resets += 1.0
    state.window.elapsed += 1.0
    state.gap += 1.0
    state.gap_travel += abs(du)


@register_jitable
def _shift(state: Any, x: Any) -> None:
    """Let the level be where x says."""
    law = state.law
    level = len(law.theta) - 1
    jump = x - predicted_output(law.theta, state.plays.phi)
    law.theta[level] += jump
    law.used[level] += jump
    state.offset += jump
    begin_window(state.window, state.plays)


@register_jitable
def _is_outlier(state: Any, settings: Any, x: Any) -> Any:
    """Whether x is no reading that the stage can have made; one that stays there is a new level."""
    dx, travel = x - state.x_last, state.gap_travel
    if stands_still(state.belief, dx, travel, state.swing.size):
        return True
    if believable(state.belief, dx, settings.unit, travel, WARM_UP):
        return False
    if state.gap <= settings.longest_gap:
        return True
    _shift(state, x)
    # What is usual stays known: the way back from a wrong level must not pass for a reading like any other.
    believe(state.belief, dx, travel, WARM_UP)
    return False


@register_jitable
def _learn(state: Any, settings: Any, x: Any) -> None:
    """Add a reading to the window, and update where the voltage has travelled far enough."""
    plays, window, law = state.plays, state.window, state.law
    level, half_width = len(law.theta) - 1, plays.half_width
    window.x += x
    window.count += 1.0
    total, phi = window.phi, plays.phi
    for i in range(len(phi)):
        total[i] += phi[i]
    pace = half_period(state.swing, settings.first_half_period)
    travelled = plays.travel * WINDOWS
    if travelled < half_width and window.elapsed * WINDOWS < 2.0 * pace:
        return
    first = level - len(plays.creep)
    if travelled * AT_REST >= half_width:
        state.held -= 1.0
        state.updates += 1.0
        state.last = UPDATED
        first = 0
    y, S = _update(law, plays, window, settings, pace, first)
    if S > 0.0:
        state.y = y
        state.S = S
    else:
        state.resets += 1.0
    share = max(min(window.elapsed / (2.0 * pace), 1.0), 1.0 / (1.0 + state.updates))
    state.offset += share * (law.used[level] - state.offset)
    begin_window(window, plays)


@register_jitable
def sample(state: Any, settings: Any, u: Any, x: Any) -> None:
    """What becomes of one sample."""
    state.samples += 1.0
    known = np.abs(u) < WILDEST
    if known:
        u = delayed(state.line, u)
        known = np.abs(u) < WILDEST
    if known and state.resonance is not None:
        u = mechanics_step(state.resonance.motion, u, state.resonance.coefficients)
    measured = known and np.abs(x) < WILDEST
    if not measured:
        state.missing += 1.0
        state.last = MISSING
        if state.samples - state.missing == 0.0 and not known:
            return
    _move(state, settings, u if known else state.plays.u)
    if not measured:
        return
    if state.primed != 0.0 and _is_outlier(state, settings, x):
        state.outliers += 1.0
        state.last = REJECTED
        return
    state.x_last = x
    state.gap = state.gap_travel = 0.0
    if state.primed == 0.0:
        state.primed = 1.0
        _shift(state, x)
        state.offset = state.law.used[len(state.law.used) - 1]
        state.last = WAITING
        return
    state.last = HELD
    state.held += 1.0
    if state.frozen != 0.0:
        begin_window(state.window, state.plays)
    else:
        _learn(state, settings, x)


# For a controller.
write_model = write_plays


@inlined
def write_row(state: Any, settings: Any, row: Any) -> None:
    """Parameters in their own units."""
    law, slopes = state.law, len(state.plays.y)
    for i in range(len(row)):
        row[i] = law.theta[i] * settings.unit if i < slopes else law.theta[i]


@inlined
def outcome(state: Any) -> Any:
    """Innovation, its variance and P."""
    return state.y, state.S, state.law.P
