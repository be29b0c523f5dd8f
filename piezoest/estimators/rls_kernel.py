"""The compiled inside of `HysteresisRLS`: from raw (u, x) to a regression, and into the law."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.compile import inlined, like
from piezoest.equations import admissible, believing, least_squares, sensor_noise, swing
from piezoest.equations import coleman_hodgdon as equations
from piezoest.equations.innovation_energy import ENERGY
from piezoest.estimators import derivative_form as form
from piezoest.estimators import level
from piezoest.estimators import recursive_least_squares_kernel as law
from piezoest.estimators.delay_line import delayed
from piezoest.estimators.model_writing import write_loop
from piezoest.estimators.samples import HELD, MISSING, REJECTED, UPDATED, WAITING
from piezoest.layout import (
    ABSENT,
    AMOUNT,
    COUNT,
    COVARIANCE,
    FIXED,
    FLAG,
    MEASURED,
    NUMBER,
    SHARE,
    SYMMETRIC,
    WORK,
    Field,
    numbers,
    record,
)
from piezoest.layout import Record as Layout
from piezoest.policies.random_walk import SLOWEST, noise_memory

# Least alpha and beta of the model handed out, relative to their initial values; its distance from the faces
# of the admissible set, relative to gamma.
LEAST, MARGIN = 1e-2, 1e-3
# By how much the slopes up and down differ where nothing is off centre, relative to them; and the levels,
# relative to half a swing.
SLOPES_DIFFER, LEVELS_DIFFER = 3e-3, 2e-2
# Beyond this trace the covariance of the estimate's error says nothing, and starts again.
LARGEST_ERROR = 1e60


def layout(n: int, follows: set[str], law_layout: Field, policies: Field, line: Field) -> Layout:
    """What is kept between samples."""

    def where(name: str, field: Field) -> Field:
        return field if name in follows else ABSENT

    filters_of = record(phi=numbers(n), z=NUMBER)
    excitation = record(
        motion=SHARE, swings=SHARE, squares=numbers(n, kind=AMOUNT),
        products=where("products", numbers(n, n, kind=COVARIANCE)),
    )  # fmt: skip
    return record(
        __name__,
        # The last good sample, and the voltage's path since: integrals of |du|, u |du| and du.
        primed=FLAG, u_last=MEASURED, x_last=MEASURED, travel=AMOUNT, moment=NUMBER, rise=NUMBER, gap=COUNT,
        samples=COUNT, missing=COUNT, outliers=COUNT, frozen=FLAG,
        centre=where("centre", record(u=MEASURED, x=MEASURED)),
        low_pass=filters_of, high_pass=where("high_pass", filters_of), phi=numbers(n),
        swing=where("swings", swing.SWING), fraction=where("swings", WORK), level=where("level", level.LEVEL),
        excitation=where("swings", excitation), noise=where("noise", sensor_noise.NOISE),
        belief=where("belief", believing.BELIEF), energy=where("energy", ENERGY),
        # The estimate's error: its covariance, and the gain behind W_p.
        error_covariance=where("errors", numbers(n, n, kind=SYMMETRIC)),
        error_gain=where("errors", numbers(n)),
        law=law_layout, policies=policies, line=line,
    )  # fmt: skip


def settings_layout(n: int, *, has_loop: bool, high_pass: bool, policies: Field) -> Layout:
    """What compiled code is given."""
    start = record(gain=FIXED, offset=FIXED)
    return record(
        low_pole=FIXED, high_pole=FIXED if high_pass else ABSENT, longest_gap=FIXED, first_half_period=FIXED,
        noise_ratio=FIXED, noise_factor=FIXED, differenced=FIXED, slope=FIXED, output_scale=FIXED,
        scale=numbers(n, kind=FIXED), parameter_scale=numbers(n, kind=FIXED), start=start,
        loop=record(decay_scale=FIXED) if has_loop else ABSENT,
        law=law.law_settings_layout(n), policies=policies,
    )  # fmt: skip


@inlined
def _decay(state: Any, settings: Any) -> Any:
    """alpha [1/V] as estimated, kept to what its model may have."""
    return max(state.law.theta[0], LEAST) * abs(settings.loop.decay_scale)


@inlined
def _move(state: Any, settings: Any, u: Any) -> None:
    """Follow the voltage: the regressor's integrals, and its swings where anybody asks for them."""
    du = u - state.u_last
    rise, moment, travel = equations.sample_regressor(state.u_last, u)
    state.rise += rise
    state.moment += moment
    state.travel += travel
    state.u_last = u
    if rise != 0.0 and state.swing is not None:
        swing.follow(state.swing, u)
        if state.level is not None:
            level.move(state.level, du, _decay(state, settings))
            if state.swing.since == 0.0:
                level.turn(state.level)


@inlined
def propagate_error(state: Any, settings: Any, restart: bool) -> None:
    """Covariance of the estimate's error under the sensor's noise, coloured by W_p and difference."""
    if state.error_covariance is None:
        return
    C, P_0, phi, product = state.error_covariance, settings.law.P_0, state.phi, state.law.product
    if restart:
        least_squares.restore_covariance(C, P_0)
    gain = like(phi)
    scale = 1.0 / state.law.spread
    for i in range(len(phi)):
        gain[i] = product[i] * scale
    least_squares.propagate_error(
        C, phi, gain, state.error_gain, settings.low_pole, settings.noise_ratio, settings.differenced
    )
    if not (least_squares.is_covariance(C) and least_squares.trace(C) < LARGEST_ERROR):
        least_squares.restore_covariance(C, P_0)


@inlined
def _adapt(state: Any, settings: Any, z: Any) -> None:
    """One regression into the law, and the covariance of the estimate's error after it."""
    own = state.law
    law.begin(state, settings, z)
    resets, first = own.resets, own.updates == 0.0
    law.adapt(state, settings)
    if own.last == UPDATED:
        propagate_error(state, settings, first or own.resets != resets)


@register_jitable
def sample(state: Any, settings: Any, u: Any, x: Any) -> None:
    """One raw sample: a regression for the law, or a note of why there is none."""
    outcome = state.law
    if np.abs(u) < WILDEST:
        u = delayed(state.line, u)
    state.samples += 1.0
    # Asked once and early: the compiler would ask twice.
    waiting = state.primed == 0.0 or state.gap > settings.longest_gap
    known = np.abs(u) < WILDEST
    measured = known and np.abs(x) < WILDEST
    if not measured:
        state.missing += 1.0
        outcome.last = MISSING
    if waiting:
        if measured:
            form.prime(state, settings, u, x)
            outcome.last = WAITING
        return
    if known:
        # A short gap is bridged: the voltage's integrals go on, the displacement's mean
        # is taken between the good samples on its two sides.
        u = form.u_from_centre(state, u)
        _move(state, settings, u)
    slope = abs(state.law.theta[1]) * settings.slope if state.belief is not None else 0.0
    if measured and not form.is_believable(state, settings, slope, x, False):
        state.outliers += 1.0
        outcome.last = REJECTED
        measured = False
    if not measured:
        state.gap += 1.0
        return
    x = form.x_from_centre(state, x)
    if state.level is not None:
        level.measure(state.level, u, x)
    if state.swing is not None:
        state.fraction = swing.fraction_of_swing(state.swing, state.travel, settings.first_half_period)
    z = form.filtered_regression(state, settings, x)
    if state.frozen != 0.0:
        outcome.last = HELD
        return
    if state.excitation is not None:
        form.excite(state, settings)
    _adapt(state, settings, z)


@register_jitable
def is_admissible(theta: Any, scale: Any) -> Any:
    """1.0 if the Coleman-Hodgdon parameters theta need not be moved."""
    return admissible.is_admissible(theta[0], theta[1], theta[2], LEAST * scale[0], LEAST * scale[1], MARGIN)


@register_jitable
def _start(theta: Any, scale: Any) -> None:
    """The start's model, or the nearest to it: where the estimate has none."""
    for i in range(len(theta)):
        theta[i] = 0.0
    alpha, beta = scale[0], scale[1]
    theta[0], theta[1] = alpha, beta
    area = alpha * beta
    theta[2] = min(max(scale[2], (1.0 + MARGIN) * area), (2.0 - MARGIN) * area)


@register_jitable
def trust_in_levels(state: Any, settings: Any) -> Any:
    """Fraction of the offset that levels give: 0 where the derivative shows it well, 1 where it cannot.

    It cannot where noise covers the changes of x, nor where the swing is small: the offset then comes from a
    difference of the slopes up and down that is smaller than what the loop's shape differs from the model's.
    """
    walk = settings.policies.random_walk
    if walk is None:
        return 0.0
    memory_squared = walk.memory * walk.memory
    half_swing = 0.5 * state.swing.size
    ratio = SLOPES_DIFFER / (_decay(state, settings) * LEVELS_DIFFER * half_swing + SLOWEST)
    by_slopes = ratio * ratio
    unknown = noise_memory(state, settings) + memory_squared * by_slopes * by_slopes
    return unknown / (unknown + memory_squared + SLOWEST)


@register_jitable
def _offset(state: Any, settings: Any, theta: Any) -> Any:
    """Offset of the loop: from the slopes, from levels, or the start's."""
    if state.centre is None:
        return settings.start.offset
    c = theta[2] / theta[0]
    origin = state.centre.x - c * state.centre.u
    offset = theta[3] / theta[0]
    trust = trust_in_levels(state, settings)
    if trust > 0.0:
        levels = 0.0  # the start's, until a whole period is known
        if level.is_known(state.level):
            levels = level.offset(state.level, c - theta[1], c)
        offset = offset + trust * (levels - offset)
    return offset + origin


@register_jitable
def _proposed_line(state: Any, settings: Any, theta: Any, model: Any) -> None:
    gain = admissible.kept_gain(theta[0], settings.start.gain, LEAST)
    model[0] = gain
    model[3] = settings.start.offset
    if state.centre is not None:
        model[3] = theta[1] + state.centre.x - gain * state.centre.u


@register_jitable
def _proposed_loop(state: Any, settings: Any, theta: Any, model: Any) -> None:
    scale, law_P = settings.parameter_scale, state.law.P
    if is_admissible(theta, scale) == 0.0:
        P = like(law_P)
        for i in range(len(theta)):
            for j in range(len(theta)):
                P[i, j] = law_P[i, j] * (scale[i] * scale[j])
        if not admissible.project_admissible(theta, P, LEAST * scale[0], LEAST * scale[1], MARGIN):
            _start(theta, scale)
    for i in range(3):
        model[i] = theta[i]
    model[3] = _offset(state, settings, theta)


@register_jitable
def proposed(state: Any, settings: Any, model: Any) -> None:
    """(alpha, beta, gamma, offset) or (gain, -, -, offset) into `model`: theta or its nearest point."""
    theta = like(state.law.theta)
    for i in range(len(theta)):
        theta[i] = state.law.theta[i] * settings.parameter_scale[i]
    if settings.loop is None:
        _proposed_line(state, settings, theta, model)
    else:
        _proposed_loop(state, settings, theta, model)


@register_jitable
def write_model(state: Any, settings: Any, model: Any) -> float:
    """Write the model as known now into settings of its inverse; what became of them, see `model_writing`."""
    return write_loop(state, settings, settings.loop is not None, model)


@inlined
def write_row(state: Any, settings: Any, row: Any) -> None:
    """The estimate, in its own units."""
    for i in range(len(state.law.theta)):
        row[i] = state.law.theta[i] * settings.parameter_scale[i]


@inlined
def outcome(state: Any) -> Any:
    """Innovation, its variance and P."""
    return state.law.innovation, state.law.innovation_variance, state.law.P
