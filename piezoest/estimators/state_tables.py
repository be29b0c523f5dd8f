"""What each estimator's flat state consists of, block by block, for `saved_state.check`.

The places are the layouts' own names, and a block ends where the next one starts: a layout that changes
takes its table with it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from piezoest._checks import WILDEST, FloatArray
from piezoest.equations import turning_points
from piezoest.estimators import believing, ekf_kernel, level, swing
from piezoest.estimators import output_error_kernel as oe
from piezoest.estimators import play_rls_layout as plays
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as front
from piezoest.estimators import rls_policies as extra
from piezoest.estimators.play_rls_grid import lay_grid
from piezoest.estimators.saved_state import (
    AMOUNT,
    COUNT,
    COVARIANCE,
    FIXED,
    FLAG,
    NUMBER,
    SHARE,
    SIGN,
    SYMMETRIC,
    WORK,
    Block,
    Kind,
    Table,
    whole,
)

# Voltages [V] and displacements [µm], also less a centre; what comes in is below WILDEST.
MEASURED = Kind(-1e3 * WILDEST, 1e3 * WILDEST)
DISTANCE = Kind(0.0, 1e3 * WILDEST)
# Parameters, most of them in parts of their start.
PARAMETER = Kind(-1e20, 1e20)
# In parts of the least decay and of the margin of an EKF, which are 1e-2 and 1e-3 of its start.
GROWING, GREATEST = 1e5, 1e10
# Least half-width of a grid of plays [V].
LEAST_RANGE = 1e-15

Rule = tuple[str, Callable[[FloatArray], Any]]


def at(start: int, *blocks: tuple[int, str, Kind]) -> tuple[Block, ...]:
    """Blocks whose places are counted from `start`."""
    return tuple(Block(start + place, name, kind) for place, name, kind in blocks)


def delay_line(start: int, size: int) -> tuple[Block, ...]:
    """Storage of a delay at the end of a state of `size` numbers."""
    return at(
        start,
        (0, "the delay line's position", whole(-1.0, size - start - 2.0)),
        (1, "the delay line", MEASURED),
    )


SWING = at(
    0,
    (swing.DIRECTION, "the voltage's direction", SIGN),
    (swing.FURTHEST, "the voltage's furthest point", MEASURED),
    (swing.SINCE, "samples since the last turn", COUNT),
    (swing.USUAL, "samples of a usual swing", AMOUNT),
    (swing.SIZE, "the size of a usual swing", DISTANCE),
    (swing.TURNED, "the last turning point", MEASURED),
)
BELIEF = at(
    0,
    (believing.SEEN, "readings seen", COUNT),
    (believing.USUAL_STEP, "the usual change of a reading", DISTANCE),
    (believing.SAME, "the travel since a reading changed", AMOUNT),
)
LEVEL = at(
    0,
    (level.PLACE, "the level's hysteresis", NUMBER),
    (level.TURNS, "the level's turns", COUNT),
    *(
        row
        for start in (level.NOW, level.LAST, level.PERIOD)
        for row in ((start, "the level's samples", COUNT), (start + 1, "the level's sums", NUMBER))
    ),
)
LAW = at(
    0,
    (law.INNOVATION, "the innovation", NUMBER),
    (law.INNOVATION_VARIANCE, "the innovation's variance", AMOUNT),
    (law.UPDATES, "updates", COUNT),
    (law.HELD, "samples held", COUNT),
    (law.RESETS, "resets", COUNT),
    (law.LAST, "what became of the last sample", whole(0.0, 4.0)),
)
POLICIES = at(
    0,
    (extra.SUM, "the change detection's sum", AMOUNT),
    (extra.USUAL, "the innovation's usual energy", AMOUNT),
    (extra.WAY, "the swings that the energy is known from", Kind(0.0, extra.ENOUGH)),
    (extra.SHUT, "whether the gate is shut", FLAG),
    (extra.LOOK, "samples until the gate is looked at", whole(0.0, extra.EVERY)),
    (extra.AT, "the swing of the memory of amplitudes", DISTANCE),
    (extra.MIDDLE, "the middle of the swing", MEASURED),
    (extra.BEGAN, "where the swing began", MEASURED),
    (extra.STEADY, "swings alike", COUNT),
    (extra.ODD, "swings unlike", COUNT),
    (extra.ANNOUNCED, "turns of an announcement", COUNT),
    (extra.TRAVELLED, "the travel of the sums", AMOUNT),
    (extra.SUMS, "sums of theta", NUMBER),
)
PLACE = at(0, (0, "the swing of a remembered amplitude", DISTANCE), (1, "a remembered theta", NUMBER))


def moved(start: int, blocks: tuple[Block, ...]) -> tuple[Block, ...]:
    """The same blocks from another place on."""
    return at(start, *blocks)


def _swing_has_a_size(start: int) -> Rule:
    return (
        "a usual swing that took time must have a size",
        lambda state: state[start + swing.USUAL] == 0.0 or state[start + swing.SIZE] > 0.0,
    )


def no_more_than(samples: int, *parts: int) -> Rule:
    """Counters that are parts of another."""
    return (
        "its counters cannot add up to more than the samples or solves that there were",
        lambda state: state[list(parts)].sum() <= state[samples],
    )


# What the front end of `HysteresisRLS` has in front of its filters, and behind its covariances.
HEAD = at(
    0,
    (front.PRIMED, "whether there was a sample", FLAG),
    (front.U_LAST, "the last voltage", MEASURED),
    (front.X_LAST, "the last displacement", MEASURED),
    (front.TRAVEL, "the travel of the voltage", AMOUNT),
    (front.MOMENT, "the moment of the voltage", NUMBER),
    (front.RISE, "the rise of the voltage", NUMBER),
    (front.GAP, "samples of a gap", COUNT),
    (front.SAMPLES, "samples", COUNT),
    (front.MISSED, "samples missing", COUNT),
    (front.OUTLIERS, "samples rejected", COUNT),
    (front.U_CENTRE, "the first voltage", MEASURED),
    (front.X_CENTRE, "the first displacement", MEASURED),
    (front.FROZEN, "whether the estimate is held", FLAG),
)
NOISE = at(
    0,
    (front.MOTION, "the filtered part of a swing", SHARE),
    (front.WAY, "the swings that the excitation is known from", SHARE),
    (front.NOISE, "the noise's variance", AMOUNT),
    (front.CHANGE, "the last change", MEASURED),
    (front.CHANGE_BEFORE, "the change before", MEASURED),
    (front.SEEN_NOISE, "samples of the noise", whole(0.0, front.NOISE_SAMPLES)),
)
FRONT_RULES = (
    _swing_has_a_size(front.SWING),
    no_more_than(
        front.SAMPLES, front.MISSED, front.OUTLIERS, front.FRONT + law.UPDATES, front.FRONT + law.HELD
    ),
)


def rls(config: FloatArray, size: int) -> Table:
    """Layout of `HysteresisRLS`."""
    n = int(config[front.N])
    head = front.FRONT + law.HEAD
    end = front.FRONT + int(law.state_size(n))
    line = end + int(config[front.EXTRA])
    places = range(end + extra.HEAD, line, extra.PLACE)
    return Table(
        (
            *HEAD,
            Block(front.LOW, "the low-pass filters", NUMBER),
            Block(front.HIGH, "the high-pass filters", NUMBER),
            Block(front.PHI, "the regressor", NUMBER),
            *moved(front.SWING, SWING),
            Block(front.EXCITATION, "the excitation", COVARIANCE),
            Block(front.EXCITATION + n * n, "what follows the excitation", FIXED),
            Block(front.ERROR, "the error's covariance", SYMMETRIC),
            Block(front.ERROR + n * n, "what follows the error's covariance", FIXED),
            Block(front.GAIN, "the filtered gain", NUMBER),
            *NOISE,
            *moved(front.BELIEF, BELIEF),
            *moved(front.LEVEL, LEVEL),
            *moved(front.FRONT, LAW),
            *at(
                head,
                (0, "theta", PARAMETER),
                (n, "the covariance P", COVARIANCE),
                (n + n * n, "the initial covariance", FIXED),
                (n + 2 * n * n, "the work space", WORK),
            ),
            *(moved(end, POLICIES) if line > end else ()),
            *(block for place in places for block in moved(place, PLACE)),
            *delay_line(line, size),
        ),
        FRONT_RULES,
    )


def output_error(config: FloatArray, size: int) -> Table:
    """Layout of `OutputErrorRLS`: that of `HysteresisRLS` in front, with other things in its gaps."""
    member = whole(0.0, config[oe.MEMBERS] - 1.0)
    return Table(
        (
            *HEAD,
            Block(oe.BEFORE, "the regressors at the last update", NUMBER),
            Block(oe.MEMBER, "the bank's member in use", member),
            Block(oe.MEMBER_BEFORE, "the bank's member before", member),
            Block(oe.RESTED, "samples at rest", COUNT),
            Block(oe.RESTED + 1, "what follows the samples at rest", FIXED),
            Block(front.PHI, "the regressor", NUMBER),
            *moved(front.SWING, SWING),
            Block(front.EXCITATION, "the excitation", COVARIANCE),
            Block(front.EXCITATION + 9, "what follows the excitation", FIXED),
            *NOISE,
            *moved(front.BELIEF, BELIEF),
            Block(front.LEVEL, "what follows the usual change", FIXED),
            *moved(front.FRONT, LAW),
            Block(oe.S, "the filter's state", PARAMETER),
            Block(oe.P, "the covariance", COVARIANCE),
            Block(oe.GAIN, "the gain", NUMBER),
            Block(oe.WORK, "the work space", WORK),
            Block(oe.BANK, "the bank", MEASURED),
            *delay_line(int(oe.bank_end(config)), size),
        ),
        FRONT_RULES,
    )


def ekf(config: FloatArray, size: int) -> Table:
    """Layout of `HysteresisEKF`, and of filterpy's filters."""
    k, n = ekf_kernel, int(config[ekf_kernel.N])

    def parameters_fit(state: FloatArray) -> bool:
        a, b, c = state[k.HEAD + 1 : k.HEAD + 4]
        least_a, least_b = config[k.LEAST_A], config[k.LEAST_B]
        if config[k.PROJECT] != 0.0:
            return bool(a >= least_a and b >= least_b)
        # Without projection a decay below zero is an exponential that grows: not without end.
        return bool(-GROWING * least_a <= a and abs(c) <= GREATEST * config[k.MARGIN])

    return Table(
        (
            *at(
                0,
                (k.U_LAST, "the last voltage", MEASURED),
                (k.PRIMED, "whether there was a voltage", FLAG),
                (k.SAMPLES, "samples", COUNT),
                (k.MISSED, "samples missing", COUNT),
                (k.UPDATES, "updates", COUNT),
                (k.MOVED, "whether the estimate was projected", FLAG),
                (k.LAST, "what became of the last sample", whole(0.0, 3.0)),
                (k.INNOVATION, "the innovation", NUMBER),
                (k.INNOVATION_VARIANCE, "the innovation's variance", AMOUNT),
                (k.U_CENTRE, "the first voltage", MEASURED),
                (k.X_CENTRE, "the first displacement", MEASURED),
                (k.CENTRED, "whether there was a displacement", FLAG),
                (k.HELD, "samples held", COUNT),
                (k.RESETS, "resets", COUNT),
            ),
            *at(
                k.HEAD,
                (0, "the filter's state", PARAMETER),
                (n, "the covariance", COVARIANCE),
                (n + n * n, "the gain", NUMBER),
                (2 * n + n * n, "the work space", WORK),
            ),
            *delay_line(int(k.state_size(n)), size),
        ),
        (
            no_more_than(k.SAMPLES, k.MISSED, k.UPDATES),
            (
                "the filter's parameters must be admissible, or near it where it does not project",
                lambda state: config[k.HYSTERETIC] == 0.0 or parameters_fit(state),
            ),
        ),
    )


def play_rls(config: FloatArray, size: int) -> Table:
    """Layout of `PrandtlIshlinskiiRLS`."""
    k = plays
    place = config.astype(int)
    grid = FIXED if config[k.FIXED] != 0.0 else None

    def as_laid(state: FloatArray) -> bool:
        laid = state.copy()
        lay_grid(laid, config)
        return bool(np.array_equal(laid, state))

    def usable(state: FloatArray) -> bool:
        used = state[place[k.USED] : place[k.USED] + place[k.N] - 1]
        return bool(np.all(used >= 0.0) and np.all(used[: place[k.BENDS] + 1] >= config[k.LEAST]))

    return Table(
        (
            *at(
                0,
                (k.SAMPLES, "samples", COUNT),
                (k.MISSED, "samples missing", COUNT),
                (k.OUTLIERS, "samples rejected", COUNT),
                (k.UPDATES, "updates", COUNT),
                (k.HELD, "samples held", COUNT),
                (k.RESETS, "resets", COUNT),
                (k.LAST, "what became of the last sample", whole(0.0, 4.0)),
                (k.FROZEN, "whether the estimate is held", FLAG),
                (k.PRIMED, "whether there was a sample", FLAG),
                (k.INNOVATION, "the innovation", NUMBER),
                (k.VARIANCE, "the innovation's variance", AMOUNT),
                (k.U_LAST, "the last voltage", MEASURED),
                (k.ELAPSED, "samples of the window", COUNT),
                (k.COUNT, "measurements of the window", COUNT),
                (k.TRAVEL, "the travel of the window", AMOUNT),
                (k.X_SUM, "the sum of the window", NUMBER),
                (k.OFFSET, "the offset", PARAMETER),
                (k.X_LAST, "the last displacement", MEASURED),
                (k.GAP, "samples of a gap", COUNT),
                (k.GAP_TRAVEL, "the travel of a gap", AMOUNT),
                (k.CENTRE, "the grid's middle", grid or MEASURED),
                (k.RANGE, "the grid's half-width", grid or Kind(LEAST_RANGE, DISTANCE.high)),
                (k.LOW, "the least voltage", MEASURED),
                (k.HIGH, "the largest voltage", MEASURED),
                (k.TURNS, "turns", whole(0.0, 5.0)),
            ),
            *moved(k.BELIEF, BELIEF),
            *moved(k.SWING, SWING),
            *at(
                k.MEMORY,
                (0, "the memory's direction", SIGN),
                (1, "the memory's count", whole(0.0, turning_points.MOST - 1.0)),
                (2, "the memory's turning points", MEASURED),
            ),
            *(Block(int(place[name]), words, kind) for name, words, kind in PLAY_ARRAYS),
            *delay_line(int(place[k.LINE]), size),
        ),
        (
            _swing_has_a_size(k.SWING),
            no_more_than(k.SAMPLES, k.MISSED, k.OUTLIERS, k.UPDATES, k.HELD),
            ("the grid must be as its middle and half-width lay it", as_laid),
            ("the parameters in use must be zero or more", usable),
        ),
    )


PLAY_ARRAYS = (
    (plays.Y, "the plays", MEASURED),
    (plays.Z, "the creep", NUMBER),
    (plays.PHI, "the regressor", NUMBER),
    (plays.SUM, "the regressor's sums", NUMBER),
    (plays.WAY, "the regressor's travel", AMOUNT),
    (plays.SEGMENTS, "the plays within their segments", MEASURED),
    (plays.THETA, "theta", PARAMETER),
    (plays.P, "the covariance P", SYMMETRIC),
    (plays.WORK, "the work space", WORK),
    (plays.OLD, "the old grid's slopes", WORK),
    (plays.THRESHOLDS, "the thresholds", MEASURED),
    (plays.EDGES, "the edges of the segments", NUMBER),
    (plays.USED, "the parameters in use", PARAMETER),
    (plays.FORCE, "the forces of the constraints", AMOUNT),
    (plays.MOTION, "the mechanics' state", NUMBER),
    (plays.REACH, "the thresholds of the slopes", AMOUNT),
    (plays.LOWER, "the lower ends of the segments", NUMBER),
    (plays.UPPER, "the upper ends of the segments", NUMBER),
    (plays.ZERO, "the zeros of the segments", NUMBER),
)
