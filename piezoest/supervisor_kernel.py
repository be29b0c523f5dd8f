"""What the guard keeps of the past, by travel, and how it compares models with a straight line by it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray
from piezoest._jit import UNCOUNTED, compiled
from piezoest.equations import recent_path
from piezoest.equations.coleman_hodgdon import hysteresis_step
from piezoest.estimators.believing import STANDS_STILL

# Points are kept this many times a swing of the voltage or of the reference; a verdict falls after so many.
A_SWING, A_VERDICT = 64, 4
# Points that are judged by, the newest, and how many of these ago counts for half; room for them.
WINDOW, HALF_LIFE, ROOM = 160, 64, 192
# A way back of this part of a swing is a turn, and a swing fades by this part from one to the next; it
# never counts for less than this part of the largest, or noise would.
TURN, FADES, LEAST = 1.0 / 32.0, 0.2, 0.01
# A line takes so many points, and goes through the mean of the first ones until the voltage has turned twice.
FIRST = 16
# The line's gain must be known this well before anything is judged by it, and lie within this factor of
# what was known before.
GAIN_KNOWN, FAR = 0.05, 20.0
# A displacement that changes by less than this part of the line's over so many points stands still.
FROZEN, STRETCH = 0.04, 8
# Errors that do not count, the largest of a window, if they are so many times the mean one; the largest of
# the others, but for this many, counts like a root mean square so many times smaller.
SPIKES, FAR_OFF, PEAK = 4, 5.0, 2.0

# Rows of what is kept: voltage, displacement, reference, sample, what kind of point it is, a model's error.
U, X, R, SAMPLE, KIND, MISSED, ROWS = range(7)
# Kinds: one to judge by; the voltage rests, the reference moves; the reading tells nothing; a spike.
GOOD, RESTS, DEAD, SPIKE = range(4)
# Flat memory. Of voltage and reference: direction, furthest value in it, last turning point, size of a
# swing, largest of all. Then numbers of points, the last reading and the line.
DIRECTION, FURTHEST, TURNED, SWING, LARGEST, OF_R = range(6)
(
    TURNS, FURTHEST_X, FURTHEST_R, SAMPLES, COUNT, NEW, KEPT, LAST_U, LAST_R, THINNED, LOWEST, HIGHEST,
    READING, READ_AT, STILL, KNOWN, BASE, GAIN, OFFSET, UNEXPLAINED, SPAN, LEAST_MISS, WORST_MISS, FOUND,
    PATH,
) = range(2 * OF_R, 2 * OF_R + 25)  # fmt: skip
# What a look at an interval says.
NOT_YET, NOTHING_READ, NO_LINE, AT_REST, JUDGE = range(5)


@register_jitable
def _follow(memory: Any, at: Any, value: Any) -> bool:
    """Follow voltage or reference; whether it has turned."""
    if memory[KEPT] == 0.0:
        memory[at + FURTHEST] = memory[at + TURNED] = value
    way = value - memory[at + FURTHEST]
    turned = memory[at + DIRECTION] * way < -TURN * memory[at + SWING]
    if turned:
        faded = max((1.0 - FADES) * memory[at + SWING], LEAST * memory[at + LARGEST])
        memory[at + SWING] = max(faded, abs(memory[at + FURTHEST] - memory[at + TURNED]))
        memory[at + TURNED] = memory[at + FURTHEST]
    if turned or memory[at + DIRECTION] * way >= 0.0:
        memory[at + DIRECTION] = np.sign(way) if way != 0.0 else memory[at + DIRECTION]
        memory[at + FURTHEST] = value
    memory[at + SWING] = max(memory[at + SWING], abs(value - memory[at + TURNED]))
    memory[at + LARGEST] = max(memory[at + LARGEST], memory[at + SWING])
    return turned


@register_jitable
def _readable(memory: Any, u: Any, x: Any) -> bool:
    """Whether a reading is no repetition of the last: a saturated or dead sensor tells nothing."""
    if x != memory[READING]:
        memory[READING], memory[READ_AT], memory[STILL] = x, u, 0.0
    elif abs(u - memory[READ_AT]) > STANDS_STILL * memory[SWING]:
        memory[STILL] = 1.0
    return memory[STILL] == 0.0 and np.isfinite(x)


@register_jitable
def _keep(memory: Any, points: Any, u: Any, x: Any, r: Any, readable: Any) -> None:
    """Keep a point; the oldest go into the recent path of the voltage."""
    n = int(memory[COUNT])
    if n == ROOM:
        gone = ROOM - WINDOW
        for j in range(gone):
            recent_path.follow(memory, PATH, points[U, j])
        for row in range(ROWS):
            for j in range(gone, ROOM):
                points[row, j - gone] = points[row, j]
        n = WINDOW
    step = memory[SWING] / A_SWING
    rests = memory[KEPT] > 0.0 and abs(u - memory[LAST_U]) < 0.25 * step
    points[U, n], points[X, n], points[R, n], points[SAMPLE, n] = u, x, r, memory[SAMPLES]
    points[KIND, n] = RESTS if rests else (GOOD if readable else DEAD)
    before = n - STRETCH
    way = abs(u - points[U, before]) if before >= 0 else 0.0
    if way > 0.75 * STRETCH * step and abs(x - points[X, before]) < FROZEN * abs(memory[GAIN]) * way:
        for j in range(before, n + 1):
            points[KIND, j] = DEAD
    memory[COUNT], memory[LAST_U], memory[LAST_R] = n + 1, u, r
    memory[NEW] += 1.0
    memory[KEPT] += 1.0


@register_jitable
def _thin(memory: Any, points: Any) -> None:
    """Where a swing has become twice as large, points are kept as far apart as they now are."""
    n, kept = int(memory[COUNT]), 1
    for j in range(1, n):
        u, r = points[U, j], points[R, j]
        travelled = abs(u - points[U, kept - 1]) >= memory[SWING] / A_SWING
        travelled = travelled or abs(r - points[R, kept - 1]) >= memory[OF_R + SWING] / A_SWING
        turn = j + 1 < n and (points[U, j + 1] - u) * (u - points[U, kept - 1]) < 0.0
        if travelled or turn:
            for row in range(ROWS):
                points[row, kept] = points[row, j]
            kept += 1
    memory[COUNT], memory[THINNED] = min(kept, n), memory[SWING]


@register_jitable
def _size(memory: Any, points: Any) -> float:
    """Root mean square of the errors [µm], the newest count more; a part of the largest if more."""
    n = int(memory[COUNT])
    first, second, third, squares, weights, weight = 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    for j in range(n - 1, max(0, n - WINDOW) - 1, -1):
        weight *= 0.5 ** (1.0 / HALF_LIFE)
        if points[KIND, j] == GOOD:
            size = abs(points[MISSED, j])
            squares += weight * size * size
            weights += weight
            third = max(third, min(second, size))
            second = max(second, min(first, size))
            first = max(first, size)
    return max(np.sqrt(squares / weights), third / PEAK)


@register_jitable
def _fit(memory: Any, points: Any, whole: Any) -> Any:
    """Gain and centre (u, x) of the best line and how well the gain is known; errors go to the points."""
    n = int(memory[COUNT])
    start = max(0, n - WINDOW)
    count, u_mean, x_mean = 0, 0.0, 0.0
    for j in range(start, n):
        if points[KIND, j] == GOOD and (whole or count < FIRST):
            count += 1
            u_mean += (points[U, j] - u_mean) / count
            x_mean += (points[X, j] - x_mean) / count
    spread, product = 0.0, 0.0
    for j in range(start, n):
        if points[KIND, j] == GOOD:
            spread += (points[U, j] - u_mean) ** 2
            product += (points[U, j] - u_mean) * (points[X, j] - x_mean)
    gain = product / spread
    squares, count = 0.0, 0
    for j in range(start, n):
        points[MISSED, j] = points[X, j] - x_mean - gain * (points[U, j] - u_mean)
        if points[KIND, j] == GOOD:
            squares += points[MISSED, j] ** 2
            count += 1
    doubt = np.sqrt(squares / (count * spread)) / abs(gain)
    return gain, x_mean - gain * u_mean, doubt, np.sqrt(squares / count)


@register_jitable
def _leave_out_spikes(memory: Any, points: Any, usual: Any) -> bool:
    """Mark the few errors that are far off; False if there are none, or too many for spikes."""
    found, n = 0, int(memory[COUNT])
    for j in range(max(0, n - WINDOW), n):
        if points[KIND, j] == GOOD and abs(points[MISSED, j]) > FAR_OFF * usual:
            found += 1
    if found == 0 or found > SPIKES:
        return False
    for j in range(max(0, n - WINDOW), n):
        if points[KIND, j] == GOOD and abs(points[MISSED, j]) > FAR_OFF * usual:
            points[KIND, j] = SPIKE
    return True


@register_jitable
def _draw_line(memory: Any, points: Any, whole: Any) -> int:
    """Find the line, and what it misses, unless that cannot be told yet or makes no sense."""
    n, count, low, high = int(memory[COUNT]), 0, np.inf, -np.inf
    for j in range(max(0, n - WINDOW), n):
        if points[KIND, j] == SPIKE:
            points[KIND, j] = GOOD
        if points[KIND, j] == GOOD:
            count += 1
            low, high = min(low, points[X, j]), max(high, points[X, j])
    if count < FIRST:
        return NO_LINE
    gain, offset, doubt, usual = _fit(memory, points, whole)
    if _leave_out_spikes(memory, points, usual):
        gain, offset, doubt, usual = _fit(memory, points, whole)
    if not doubt < GAIN_KNOWN:
        return NO_LINE
    if not 1.0 / FAR < gain / memory[BASE] < FAR:
        return NOTHING_READ
    if whole and memory[KNOWN] == 0.0:
        memory[KNOWN], memory[BASE] = 1.0, gain
    memory[GAIN], memory[OFFSET] = gain, offset
    memory[UNEXPLAINED], memory[SPAN] = (
        _size(memory, points),
        min(high - low, abs(gain) * 2.0 * memory[SWING]),
    )
    return JUDGE


@register_jitable
def _track(memory: Any, points: Any) -> Any:
    """Least and largest root mean square of r - x [µm] in the quarters of the last swing; points at rest."""
    n, least, worst, resting = int(memory[COUNT]), np.inf, 0.0, 0
    for quarter in range(4):
        squares, count = 0.0, 0
        end = n - quarter * A_SWING // 4
        for j in range(max(0, end - A_SWING // 4), end):
            needed = (points[R, j] - memory[OFFSET]) / memory[GAIN]
            if memory[LOWEST] <= needed <= memory[HIGHEST]:
                resting += points[KIND, j] == RESTS and quarter < 2
                if points[KIND, j] < DEAD:
                    squares += (points[R, j] - points[X, j]) ** 2
                    count += 1
        known = count >= A_SWING // 8
        least = min(least, np.sqrt(squares / count) if known else 0.0)
        worst = max(worst, np.sqrt(squares / count) if known else np.inf)
    return least, worst, resting


@register_jitable
def _what_can_be_said(memory: Any, points: Any) -> int:
    """What a look at the points says, once it is time for a verdict."""
    n, dead = int(memory[COUNT]), 0
    if memory[KNOWN] == 0.0 and points[KIND, n - 1] < DEAD:
        memory[OFFSET] = points[X, n - 1] - memory[GAIN] * points[U, n - 1]
    memory[LEAST_MISS], memory[WORST_MISS], resting = _track(memory, points)
    if resting >= 3 * A_SWING // 8:
        return AT_REST
    for j in range(max(0, n - A_SWING // 4), n):
        dead += points[KIND, j] == DEAD
    if 2 * dead > min(n, A_SWING // 4):
        return NOTHING_READ
    return _draw_line(memory, points, memory[TURNS] >= 2.0)


@compiled("i8(f8[::1], f8[:, ::1], f8[::1], f8[::1], f8[::1])", **UNCOUNTED)
def look(memory: Any, points: Any, r: Any, u: Any, x: Any) -> int:
    """Take an interval; what can be said now."""
    for k in range(u.size):
        memory[SAMPLES] += 1.0
        readable = _readable(memory, u[k], x[k])
        extreme, extreme_x, extreme_r = memory[FURTHEST], memory[FURTHEST_X], memory[FURTHEST_R]
        turned = _follow(memory, 0, u[k])
        _follow(memory, OF_R, r[k])
        if turned:
            memory[TURNS] += 1.0
            if extreme != memory[LAST_U]:
                _keep(memory, points, extreme, extreme_x, extreme_r, np.isfinite(extreme_x))
        if memory[FURTHEST] == u[k]:
            memory[FURTHEST_X], memory[FURTHEST_R] = x[k] if readable else np.nan, r[k]
        memory[LOWEST], memory[HIGHEST] = min(memory[LOWEST], u[k]), max(memory[HIGHEST], u[k])
        du, dr = abs(u[k] - memory[LAST_U]), abs(r[k] - memory[LAST_R])
        travelled = du > 0.0 and du >= memory[SWING] / A_SWING
        if memory[KEPT] == 0.0 or travelled or (dr > 0.0 and dr >= memory[OF_R + SWING] / A_SWING):
            if memory[SWING] > 2.0 * memory[THINNED]:
                _thin(memory, points)
            _keep(memory, points, u[k], x[k], r[k], readable)
    if memory[NEW] < A_VERDICT:
        return NOT_YET
    memory[NEW] = 0.0
    memory[FOUND] = _what_can_be_said(memory, points)
    return int(memory[FOUND])


@compiled("f8(f8[::1], f8[:, ::1], f8, f8, f8, f8)", **UNCOUNTED)
def missed_by_loop(memory: Any, points: Any, a: float, b: float, c: float, offset: float) -> float:
    """What a Coleman-Hodgdon model misses [µm], from where the recent path of the voltage puts it."""
    recent_path.take_up(memory, PATH, a)
    w_h, u = b * recent_path.hysteresis(memory, PATH), memory[PATH + recent_path.PRESENT]
    for j in range(int(memory[COUNT])):
        w_h = hysteresis_step(w_h, points[U, j] - u, a, b)
        u = points[U, j]
        points[MISSED, j] = points[X, j] - (c * u + w_h + offset)
    return _size(memory, points)


@compiled("f8(f8[::1], f8[:, ::1], f8[::1])", **UNCOUNTED)
def missed_but_for_mean(memory: Any, points: Any, y: Any) -> float:
    """What displacements y miss, but for the mean error [µm]."""
    n, count, mean = int(memory[COUNT]), 0, 0.0
    for j in range(max(0, n - WINDOW), n):
        points[MISSED, j] = points[X, j] - y[j]
        if points[KIND, j] == GOOD:
            count += 1
            mean += (points[MISSED, j] - mean) / count
    for j in range(n):
        points[MISSED, j] -= mean
    return _size(memory, points)


def begin(gain: float, offset: float) -> tuple[FloatArray, FloatArray]:
    """Empty memory and points, with the line of the first model."""
    memory, points = np.zeros(PATH + recent_path.SIZE), np.zeros((ROWS, ROOM))
    memory[BASE] = memory[GAIN] = gain
    memory[OFFSET], memory[READING] = offset, math.nan
    recent_path.begin(memory, PATH, 0.0, 1.0)
    return memory, points


def voltages(memory: FloatArray, points: FloatArray) -> FloatArray:
    """Voltages of the points, after the turning points of the recent path that led there."""
    newest, count = int(memory[PATH + recent_path.NEWEST]), int(memory[PATH + recent_path.COUNT])
    places = (newest - np.arange(count - 1, -1, -1)) % recent_path.MOST
    turns = memory[PATH + recent_path.POINTS + places]
    return np.concatenate([turns, memory[[PATH + recent_path.FURTHEST]], points[U, : int(memory[COUNT])]])
