"""The compiled inside of `HysteresisRLS`: from raw (u, x) to a regression, and into the law."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest._jit import unrolled
from piezoest.equations import coleman_hodgdon as equations
from piezoest.equations import filters, least_squares
from piezoest.estimators import believing, level, swing
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_policies as policies
from piezoest.estimators.delay_line import delayed

# State: what is known of the last good sample, and of the voltage's way since.
PRIMED, U_LAST, X_LAST, TRAVEL, MOMENT, RISE, GAP, SAMPLES, MISSED, OUTLIERS = range(10)
U_CENTRE, X_CENTRE, FROZEN = 10, 11, 12
LOW, HIGH, PHI = 13, 18, 23  # five filters each: four regressors and the output
SWING = 28
EXCITATION = SWING + swing.STATE  # mean over a swing of phi phi', both in unit of motion
ERROR, GAIN = EXCITATION + 16, EXCITATION + 32  # covariance of the estimate's error, filtered gain
# Filtered part of a swing that a sample is, and the swings (up to one) in EXCITATION's mean.
MOTION, WAY = EXCITATION + 36, EXCITATION + 37
# The sensor's noise: its variance as seen, and the last two changes of x it is seen from.
NOISE, CHANGE, CHANGE_BEFORE, SEEN_NOISE = range(EXCITATION + 38, EXCITATION + 42)
BELIEF = EXCITATION + 42
LEVEL = BELIEF + believing.STATE
FRONT = LEVEL + level.STATE  # the law's state begins here, the policies' and the delay line follow it

# Configuration of the front end; the law's follows.
N, HYSTERETIC, LOW_POLE, HIGH_POLE, HIGH_PASS, FRACTION, OFFSET, LONGEST_GAP, NOISE_RATIO = range(9)
OUTLIER, FIRST_HALF, WALK, WALK_MEMORY, WARM_UP, PERIODS, DECAY_SCALE = 9, 10, 11, 12, 13, 14, 15
SCALE = 16  # four scales of the parameters, one of the output
# Policies that are off by default: numbers that their state takes (behind the law's), projection's margin,
# threshold and drift of the detection, least excitation, shortest memory of variable forgetting in
# parts of it, places of the memory of amplitudes, its tolerance, its variance.
EXTRA, MARGIN, THRESHOLD, RISEN, EXCITED, SHORTEST, PLACES, TOLERANCE, RECALLED = range(21, 30)
# Slope [µm/V] of a beta of one, variance of the sensor's noise to that of a slope, whether the covariance of
# the estimate's error is followed, whether the regressor's mean square is as a whole or its diagonal alone,
# and whether anybody asks for the voltage's swings.
SLOPE, NOISE_FACTOR, ERRORS, WHOLE, PACED = 30, 31, 32, 33, 34
CONFIG = 35

# Slower than so many swings a sample the voltage is at rest; slower than this part of its usual
# pace it counts as going at that.
SLOWEST, SLOW = 1e-12, 0.2
# Positions in theta; the offset may be off by this part of a swing, a parameter walks at least
# so much (squared), and no variance grows beyond so many times its start.
GAMMA, OFFSET_SLOPE = 2, 3
NOISE_SAMPLES, PRECISION = 2000.0, 3e-3
# Least alpha and beta of the model handed out, in parts of their initial values.
LEAST = 1e-2
OFF_CENTRE, LEAST_STEP, CEILING = 0.3, 1e-6, 1e4
# By how much the slopes up and down differ where nothing is off centre, relative to them; and the levels,
# relative to half a swing.
SLOPES_DIFFER, LEVELS_DIFFER = 3e-3, 2e-2
# Beyond this trace the covariance of the estimate's error says nothing, and starts anew.
LARGEST_ERROR = 1e60


@unrolled
def _filtered(state: Any, config: Any, extra: Any, i: int, value: Any) -> Any:
    """Low-pass (W_p of App. A), then the optional high-pass."""
    state[LOW + i] = filters.low_pass_step(state[LOW + i], value, config[LOW_POLE])
    value = state[LOW + i]
    if extra is not None and config[HIGH_PASS] != 0.0:
        state[HIGH + i], value = filters.high_pass_step(state[HIGH + i], value, config[HIGH_POLE])
    return value


@unrolled
def _prime(state: Any, config: Any, clock: Any, u: Any, x: Any) -> None:
    """Start from (u, x) as the last good sample; what is usual is learnt anew."""
    if clock is not None:
        state[BELIEF + believing.SEEN] = 0.0
    if state[PRIMED] == 0.0 and config[OFFSET] != 0.0:
        state[U_CENTRE] = u
        state[X_CENTRE] = x
    state[PRIMED] = 1.0
    state[U_LAST] = u - state[U_CENTRE]
    state[X_LAST] = x - state[X_CENTRE]
    state[TRAVEL] = state[MOMENT] = state[RISE] = state[GAP] = 0.0


@unrolled
def _believable(state: Any, config: Any, x: Any) -> Any:
    """Whether x is a reading that the stage can have made, after the last good one."""
    if config[OUTLIER] == 0.0:
        return True
    memory = state[BELIEF:LEVEL]
    dx = x - state[X_CENTRE] - state[X_LAST]
    if believing.stands_still(memory, dx, state[TRAVEL], state[SWING + swing.SIZE]):
        return False
    slope = abs(state[FRONT + law.HEAD + 1]) * config[SLOPE]
    return believing.believable(memory, dx, slope, state[TRAVEL], config[WARM_UP])


@unrolled
def _regression(state: Any, config: Any, clock: Any, extra: Any, x: Any, phi: Any, n: int) -> Any:
    """Regressor into `phi` and output, from the last good sample to this one; starts the next."""
    if clock is None or config[HYSTERETIC] != 0.0:
        z = x - state[X_LAST]
        if clock is not None and config[WALK] > 0.0:
            _measure_noise(state, z)
        phi[0] = -0.5 * (x + state[X_LAST]) * state[TRAVEL]
        phi[1] = state[RISE]
        phi[2] = state[MOMENT]
        if n == 4:
            phi[3] = state[TRAVEL]
    else:
        z = x
        phi[0] = state[U_LAST]
        if n == 2:
            phi[1] = 1.0
    state[X_LAST] = x
    state[TRAVEL] = state[MOMENT] = state[RISE] = state[GAP] = 0.0
    for i in range(n):
        phi[i] = _filtered(state, config, extra, i, phi[i] * config[SCALE + i])
    return _filtered(state, config, extra, 4, z * config[SCALE + 4])


@unrolled
def _measure_noise(state: Any, change: Any) -> None:
    """Variance of the sensor's noise, from the third differences of x: a stage moves more smoothly."""
    third = change - 2.0 * state[CHANGE] + state[CHANGE_BEFORE]
    state[CHANGE_BEFORE] = state[CHANGE]
    state[CHANGE] = change
    state[SEEN_NOISE] = min(state[SEEN_NOISE] + 1.0, NOISE_SAMPLES)
    if state[SEEN_NOISE] > 3.0:  # of the first differences none is whole
        state[NOISE] += (third * third / 20.0 - state[NOISE]) / (state[SEEN_NOISE] - 3.0)


@unrolled
def _noise_memory(state: Any, config: Any) -> Any:
    """Square of the memory in swings that it takes for the sensor's noise to move the gain by no more.

    Over a swing of the displacement noise behind W_p leaves the slope uncertain by sqrt(2) parts of its
    size.
    """
    if state[SWING + swing.USUAL] == 0.0:
        return 0.0  # nobody knows yet how far a swing goes
    swing_of_x = state[SWING + swing.SIZE] * state[FRONT + law.HEAD + 1] * config[SLOPE]
    return state[NOISE] * config[NOISE_FACTOR] / max(swing_of_x * swing_of_x, SLOWEST)


@unrolled
def trust_in_levels(state: Any, config: Any) -> Any:
    """Fraction of the offset to take from levels: 0 where the derivative tells it well, 1 where it cannot.

    It cannot where noise covers the changes of x, nor where the swing is small: the offset is then told by a
    difference of the slopes up and down that is smaller than what the loop's shape differs from the model's.
    """
    if config[WALK] == 0.0:
        return 0.0
    memory_squared = config[WALK_MEMORY] * config[WALK_MEMORY]
    half_swing = 0.5 * state[SWING + swing.SIZE]
    ratio = SLOPES_DIFFER / (_decay(state, config) * LEVELS_DIFFER * half_swing + SLOWEST)
    by_slopes = ratio * ratio
    unknown = _noise_memory(state, config) + memory_squared * by_slopes * by_slopes
    return unknown / (unknown + memory_squared + SLOWEST)


@unrolled
def _decay(state: Any, config: Any) -> Any:
    """alpha [1/V] as estimated, kept to what its model may have."""
    return max(state[FRONT + law.HEAD], LEAST) * abs(config[DECAY_SCALE])


@unrolled
def _square_step(state: Any, config: Any, i: int) -> Any:
    """Square of what a parameter walks in a swing: a part of itself; the offset, a part of the swing."""
    head = FRONT + law.HEAD
    size = state[head + i]
    if i == OFFSET_SLOPE:
        swing_in_offset = state[SWING + swing.SIZE] * config[SCALE + GAMMA] / config[SCALE + OFFSET_SLOPE]
        size = OFF_CENTRE * state[head + GAMMA] * swing_in_offset
    return config[WALK] * max(size * size, LEAST_STEP)


@unrolled
def _excite(state: Any, config: Any, phi: Any, n: int, part: Any) -> None:
    """Take the regressor into its mean square over a swing."""
    state[MOTION] = part = filters.low_pass_step(state[MOTION], part, config[LOW_POLE])
    way = state[WAY] + part
    if way < SLOWEST:
        return
    state[WAY] = way = min(way, 1.0)
    fresh, old = 1.0 / (max(part, SLOWEST) * way), part / way
    for i in range(n):
        mean = state[EXCITATION + i * n + i]
        state[EXCITATION + i * n + i] = mean + (fresh * phi[i] * phi[i] - old * mean)
    if config[WHOLE] == 0.0:
        return
    for i in range(n):
        for j in range(i + 1, n):
            mean = state[EXCITATION + i * n + j]
            mean += fresh * phi[i] * phi[j] - old * mean
            state[EXCITATION + i * n + j] = mean
            state[EXCITATION + j * n + i] = mean


@unrolled
def _walk(state: Any, config: Any, extra: Any, n: int, half: Any) -> Any:
    """Let P grow, and return the noise variance of a sample that gives the memory wanted.

    Everything is counted in swings of the voltage. With P growing by q a swing, the best
    excited direction forgets within sqrt(rho/(q phi²)) swings, where phi is the regressor and rho
    the noise variance of a whole swing: rho follows from the memory wanted and the mean of phi².
    """
    part = state[MOTION]
    rho = 0.0
    for i in range(n):
        q = _square_step(state, config, i)
        rho += q * state[EXCITATION + i * n + i]
        k = FRONT + law.HEAD + n + i * n + i
        if extra is not None and config[EXCITED] > 0.0:
            q *= 1.0 - extra[policies.SHUT]
        state[k] = least_squares.random_walk(state[k], q * part, CEILING * max(q, state[k + n * n]))
    # Near a standstill the mechanics still move, which says nothing of the hysteresis.
    memory_squared = config[WALK_MEMORY] * config[WALK_MEMORY] + _noise_memory(state, config)
    return 1.0 + memory_squared * rho * max(part, SLOW / half)


@unrolled
def _propagate_error(state: Any, config: Any, phi: Any, n: int, forgetting: Any, restart: bool) -> None:
    """Covariance of the estimate's error under the sensor's noise, coloured by W_p and difference."""
    C = state[ERROR : ERROR + n * n]
    start = FRONT + law.HEAD + n + n * n
    gain = state[start + n * n : start + n * n + n]  # the law's work space: P phi
    work = state[start + n * n + n : start + n * n + 4 * n]
    if restart:
        for i in range(n * n):
            C[i] = state[start + i]
    scale = 1.0 / (forgetting * state[FRONT + law.INNOVATION_VARIANCE])
    for i in range(n):
        gain[i] *= scale
    filtered = state[GAIN : GAIN + n]
    ratio, differenced = config[NOISE_RATIO], config[HYSTERETIC]
    least_squares.propagate_error(C, phi, gain, filtered, n, config[LOW_POLE], ratio, differenced, work)
    if not (least_squares.is_covariance(C, n) and least_squares.trace(C, n) < LARGEST_ERROR):
        for i in range(n * n):
            C[i] = state[start + i]


@register_jitable
def _visit(state: Any, config: Any, extra: Any, n: int, part: Any) -> None:
    """Let the memory of amplitudes look at the swing."""
    start = FRONT + law.HEAD
    clock = state[SWING : SWING + swing.STATE]
    theta = state[start : start + n]
    if policies.visit(extra, clock, theta, n, part, int(config[PLACES]), config[TOLERANCE]):
        policies.enlarge(state[start + n : start + n + n * n], n, config[RECALLED])
        policies.enlarge(state[ERROR : ERROR + n * n], n, config[RECALLED])
        state[FRONT + law.RESETS] += 1.0


@register_jitable
def _varied(
    state: Any, config: Any, extra: Any, phi: Any, z: Any, n: int, R: Any, forgetting: Any, half: Any
) -> Any:
    """Factor of variable forgetting, against the innovation's usual energy."""
    least = config[CONFIG + law.LEAST_FACTOR]
    if config[PERIODS] > 0.0:
        samples = 2.0 * half * config[PERIODS] * config[SHORTEST]
        least = samples / (samples + 1.0)
    forgetting = policies.nominal(extra, forgetting)
    return law.varied(state[FRONT:], phi, z, n, R, forgetting, least)


@register_jitable
def _watch(state: Any, config: Any, extra: Any, n: int, part: Any) -> None:
    """Learn the innovation's usual energy, and add P_0 where it says that something changed."""
    y, S = state[FRONT + law.INNOVATION], state[FRONT + law.INNOVATION_VARIANCE]
    if policies.changed(extra, y, S, part, config[THRESHOLD], config[RISEN]):
        start = FRONT + law.HEAD + n
        P_0 = state[start + n * n : start + 2 * n * n]
        least_squares.add_covariance(state[start : start + n * n], P_0, n)
        state[FRONT + law.RESETS] += 1.0


@unrolled
def _move(state: Any, config: Any, clock: Any, u: Any, n: int) -> None:
    """Take a voltage into the regressor's integrals, and into the clock where anybody asks for it."""
    du = u - state[U_LAST]
    rise, moment, travel = equations.sample_regressor(state[U_LAST], u)
    state[RISE] += rise
    state[MOMENT] += moment
    state[TRAVEL] += travel
    state[U_LAST] = u
    if clock is not None and config[PACED] != 0.0 and rise != 0.0:
        swing.follow(clock, u)
        if n == 4:
            level.move(state[LEVEL:FRONT], du, _decay(state, config))
            if clock[swing.SINCE] == 0.0:
                level.turn(state[LEVEL:FRONT])


@unrolled
def _adapt(
    state: Any,
    config: Any,
    extra: Any,
    phi: Any,
    z: Any,
    n: int,
    R: Any,
    forgetting: Any,
    half: Any,
    part: Any,
) -> None:
    """The law, with what is off by default around it."""
    law_state = state[FRONT:]
    head = law.HEAD
    resets, updates = law_state[law.RESETS], law_state[law.UPDATES]
    if config[EXCITED] > 0.0:
        work = law_state[head + n + 2 * n * n :]
        policies.gate(extra, state[EXCITATION : EXCITATION + n * n], n, config[EXCITED], work)
        if extra[policies.SHUT] != 0.0:
            law_state[law.LAST] = law.HOLDING
            law_state[law.HELD] += 1.0
            return
    if config[CONFIG + law.LEAST_FACTOR] > 0.0:
        forgetting = _varied(state, config, extra, phi, z, n, R, forgetting, half)
    law.adapt(law_state, config[CONFIG:], phi, z, n, R, forgetting)
    if config[EXTRA] > 0.0 and law_state[law.LAST] == law.UPDATED:
        _watch(state, config, extra, n, part)
    if config[MARGIN] > 0.0:
        policies.project(
            law_state[head : head + n],
            law_state[head + n : head + n + n * n],
            n,
            config[SCALE : SCALE + 5],
            LEAST,
            config[MARGIN],
            law_state[head + 2 * n + 2 * n * n :],  # of the work space what the law's gain is not in
        )
    if law_state[law.LAST] == law.UPDATED and config[ERRORS] != 0.0:
        restart = updates == 0.0 or law_state[law.RESETS] != resets
        if config[CONFIG + law.DIRECTIONAL] != 0.0:
            forgetting = 1.0  # it is not in that law's gain
        _propagate_error(state, config, phi, n, forgetting, restart)


@unrolled
def _take(
    state: Any, config: Any, clock: Any, line: Any, extra: Any, u: Any, x: Any, n: int, trial: Any
) -> None:  # fmt: skip
    """One raw sample: a regression of n parameters for the law, or a note of why there is none.

    `clock` is the state of `swing`, `line` the delay line, `extra` the state of the policies that are off by
    default; `trial` says that the bare law is to take it on trial. Each may be None where nobody asks for it,
    and nothing is compiled for it.
    """
    law_state = state[FRONT:]
    if line is not None and np.abs(u) < WILDEST:
        u = delayed(line, config[FRACTION], u)
    state[SAMPLES] += 1.0
    # Asked once and early: the compiler would ask twice, and lose the bank's vector instructions.
    waiting = state[PRIMED] == 0.0 or state[GAP] > config[LONGEST_GAP]
    known = np.abs(u) < WILDEST
    measured = known and np.abs(x) < WILDEST
    if not measured:
        state[MISSED] += 1.0
        law_state[law.LAST] = law.MISSING
    if waiting:
        if measured:
            _prime(state, config, clock, u, x)
            law_state[law.LAST] = law.WAITING
        return
    if known:
        # A short gap is bridged: the voltage's integrals go on, the displacement's mean
        # is taken between the good samples on its two sides.
        u -= state[U_CENTRE]
        _move(state, config, clock, u, n)
    if clock is not None and measured and not _believable(state, config, x):
        state[OUTLIERS] += 1.0
        law_state[law.LAST] = law.REJECTED
        measured = False
    if not measured:
        state[GAP] += 1.0
        return
    if n == 4:
        level.measure(state[LEVEL:FRONT], u, x - state[X_CENTRE])
    phi = state[PHI : PHI + n]
    part = 0.0  # nobody asks for it
    if clock is not None and config[PACED] != 0.0:
        part = swing.part_of_swing(clock, state[TRAVEL], config[FIRST_HALF])
    z = _regression(state, config, clock, extra, x - state[X_CENTRE], phi, n)
    if state[FROZEN] != 0.0:
        law_state[law.LAST] = law.HOLDING
        return
    forgetting = config[CONFIG + law.FORGETTING]
    if trial is not None:
        law.adapt_on_trial(law_state, config[CONFIG:], phi, z, n, 1.0, forgetting)
        return
    if clock is None:
        law.adapt_discretely(law_state, config[CONFIG:], phi, z, n, 1.0, forgetting)
        return
    if extra is not None and config[PLACES] > 0.0:
        _visit(state, config, extra, n, part)
    half = 0.0  # nobody asks for it
    if config[WALK] > 0.0 or config[PERIODS] > 0.0:
        half = swing.half_period(clock, config[FIRST_HALF])
    if config[PERIODS] > 0.0:
        samples = 2.0 * half * config[PERIODS]
        forgetting = samples / (samples + 1.0)
    if config[PACED] != 0.0:
        _excite(state, config, phi, n, part)
    R = 1.0
    if config[WALK] > 0.0 and state[WAY] >= SLOWEST:
        R = _walk(state, config, extra, n, half)
    if extra is not None:
        _adapt(state, config, extra, phi, z, n, R, forgetting, half, part)
        return
    resets = law_state[law.RESETS] - (law_state[law.UPDATES] == 0.0)
    law.adapt_discretely(law_state, config[CONFIG:], phi, z, n, R, forgetting)
    if law_state[law.LAST] == law.UPDATED and config[ERRORS] != 0.0:
        _propagate_error(state, config, phi, n, forgetting, law_state[law.RESETS] != resets)


@register_jitable
def _sample(state: Any, config: Any, u: Any, x: Any) -> None:
    """One raw sample, with whatever was asked for."""
    n = int(config[N])
    extra = state[FRONT + law.state_size(n) :]
    _take(state, config, state[SWING:EXCITATION], extra[int(config[EXTRA]) :], extra, u, x, n, None)
