"""What the guard keeps of the past, by travel, and how it compares models with a straight line by it."""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray
from piezoest.compile import Record, Vector, compiled
from piezoest.equations import recent_path
from piezoest.equations.believing import STANDS_STILL
from piezoest.equations.coleman_hodgdon import hysteresis_step
from piezoest.layout import AMOUNT, COUNT, FLAG, NUMBER, SIGN, Named, new, numbers, record

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

# Points: one to judge by; the voltage rests, the reference moves; the reading tells nothing; a spike.
GOOD, RESTS, DEAD, SPIKE = range(4)
# What a look at an interval says.
NOT_YET, NOTHING_READ, NO_LINE, AT_REST, JUDGE = range(5)

# Of voltage or reference: direction, furthest value in it, last turning point, size of a swing, the largest.
FOLLOWED = record(direction=SIGN, furthest=NUMBER, turned=NUMBER, swing=AMOUNT, largest=AMOUNT)
# Voltage, displacement, reference, sample, one of the four above, what a model misses there [µm].
POINTS = record(
    u=numbers(ROOM), x=numbers(ROOM), r=numbers(ROOM), sample=numbers(ROOM), quality=numbers(ROOM),
    missed=numbers(ROOM),
)  # fmt: skip
# What verdicts rest on: what was said last; turns of the voltage, points ever kept, voltage of the last one;
# whether the line is known, its gain before, gain, offset and error [µm]; range of the displacement; least
# and largest error of tracking in the quarters of the last swing [µm].
SEEN = record(
    found=COUNT, turns=COUNT, kept=COUNT, last_u=NUMBER,
    known=FLAG, base=NUMBER, gain=NUMBER, offset=NUMBER, unexplained=AMOUNT, span=AMOUNT,
    least_miss=AMOUNT, worst_miss=AMOUNT,
)  # fmt: skip
# Reading and reference where the voltage is furthest; samples, points, points since the last verdict, swing
# when they were thinned; reference of the last point, range of the voltage; last reading, where it came,
# whether it stands still.
MEMORY = record(
    u=FOLLOWED, r=FOLLOWED, furthest_x=NUMBER, furthest_r=NUMBER,
    samples=COUNT, count=COUNT, fresh=COUNT, thinned=AMOUNT,
    last_r=NUMBER, lowest=NUMBER, highest=NUMBER, reading=NUMBER, read_at=NUMBER, still=FLAG,
    seen=SEEN, path=recent_path.PATH, points=POINTS,
)  # fmt: skip


_Seen: Any = namedtuple("_Seen", [name for name, _ in SEEN.fields])  # type: ignore[misc]


def seen_in(memory: Any) -> Any:
    """What was seen, in Python: a tuple with the names of `SEEN`."""
    return _Seen(*memory["seen"].tolist())


@register_jitable
def _follow(swing: Any, value: Any, is_first: Any) -> bool:
    """Follow voltage or reference; whether it has turned."""
    if is_first:
        swing.furthest = swing.turned = value
    way = value - swing.furthest
    turned = swing.direction * way < -TURN * swing.swing
    if turned:
        faded = max((1.0 - FADES) * swing.swing, LEAST * swing.largest)
        swing.swing = max(faded, abs(swing.furthest - swing.turned))
        swing.turned = swing.furthest
    if turned or swing.direction * way >= 0.0:
        swing.direction = np.sign(way) if way != 0.0 else swing.direction
        swing.furthest = value
    swing.swing = max(swing.swing, abs(value - swing.turned))
    swing.largest = max(swing.largest, swing.swing)
    return turned


@register_jitable
def _readable(memory: Any, u: Any, x: Any) -> bool:
    """Whether a reading is no repetition of the last: a saturated or dead sensor tells nothing."""
    if x != memory.reading:
        memory.reading, memory.read_at, memory.still = x, u, 0.0
    elif abs(u - memory.read_at) > STANDS_STILL * memory.u.swing:
        memory.still = 1.0
    return memory.still == 0.0 and np.isfinite(x)


@register_jitable
def _move(points: Any, source: int, target: int) -> None:
    for values in (points.u, points.x, points.r, points.sample, points.quality):
        values[target] = values[source]


@register_jitable
def _keep(memory: Any, u: Any, x: Any, r: Any, readable: Any) -> None:
    """Keep a point; the oldest go into the recent path of the voltage."""
    points = memory.points
    n = int(memory.count)
    if n == ROOM:
        gone = ROOM - WINDOW
        for j in range(gone):
            recent_path.follow(memory.path, points.u[j])
        for j in range(gone, ROOM):
            _move(points, j, j - gone)
        n = WINDOW
    step = memory.u.swing / A_SWING
    rests = memory.seen.kept > 0.0 and abs(u - memory.seen.last_u) < 0.25 * step
    points.u[n], points.x[n], points.r[n], points.sample[n] = u, x, r, memory.samples
    points.quality[n] = RESTS if rests else (GOOD if readable else DEAD)
    before = n - STRETCH
    way = abs(u - points.u[before]) if before >= 0 else 0.0
    if way > 0.75 * STRETCH * step and abs(x - points.x[before]) < FROZEN * abs(memory.seen.gain) * way:
        for j in range(before, n + 1):
            points.quality[j] = DEAD
    memory.count, memory.seen.last_u, memory.last_r = n + 1, u, r
    memory.fresh += 1.0
    memory.seen.kept += 1.0


@register_jitable
def _thin(memory: Any) -> None:
    """Where a swing has become twice as large, points are kept as far apart as they now are."""
    points = memory.points
    n, kept = int(memory.count), 1
    for j in range(1, n):
        u, r = points.u[j], points.r[j]
        du, dr = u - points.u[kept - 1], r - points.r[kept - 1]
        travelled = abs(du) >= memory.u.swing / A_SWING or abs(dr) >= memory.r.swing / A_SWING
        if travelled or (j + 1 < n and (points.u[j + 1] - u) * du < 0.0):
            _move(points, j, kept)
            kept += 1
    memory.count, memory.thinned = min(kept, n), memory.u.swing


@register_jitable
def _size(memory: Any) -> float:
    """Root mean square of the errors [µm], the newest count more; a part of the largest if more."""
    points = memory.points
    n = int(memory.count)
    first, second, third, squares, weights, weight = 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    for j in range(n - 1, max(0, n - WINDOW) - 1, -1):
        weight *= 0.5 ** (1.0 / HALF_LIFE)
        if points.quality[j] == GOOD:
            size = abs(points.missed[j])
            squares += weight * size * size
            weights += weight
            third = max(third, min(second, size))
            second = max(second, min(first, size))
            first = max(first, size)
    return max(np.sqrt(squares / weights), third / PEAK)


@register_jitable
def _fit(memory: Any, whole: Any) -> Any:
    """Gain and centre (u, x) of the best line and how well the gain is known; errors go to the points."""
    points = memory.points
    n = int(memory.count)
    start = max(0, n - WINDOW)
    count, u_mean, x_mean = 0, 0.0, 0.0
    for j in range(start, n):
        if points.quality[j] == GOOD and (whole or count < FIRST):
            count += 1
            u_mean += (points.u[j] - u_mean) / count
            x_mean += (points.x[j] - x_mean) / count
    spread, product = 0.0, 0.0
    for j in range(start, n):
        if points.quality[j] == GOOD:
            spread += (points.u[j] - u_mean) ** 2
            product += (points.u[j] - u_mean) * (points.x[j] - x_mean)
    gain = product / spread
    squares, count = 0.0, 0
    for j in range(start, n):
        points.missed[j] = points.x[j] - x_mean - gain * (points.u[j] - u_mean)
        if points.quality[j] == GOOD:
            squares += points.missed[j] ** 2
            count += 1
    doubt = np.sqrt(squares / (count * spread)) / abs(gain)
    return gain, x_mean - gain * u_mean, doubt, np.sqrt(squares / count)


@register_jitable
def _leave_out_spikes(memory: Any, usual: Any) -> bool:
    """Mark the few errors that are far off; False if there are none, or too many for spikes."""
    points = memory.points
    found, n = 0, int(memory.count)
    for j in range(max(0, n - WINDOW), n):
        if points.quality[j] == GOOD and abs(points.missed[j]) > FAR_OFF * usual:
            found += 1
    if found == 0 or found > SPIKES:
        return False
    for j in range(max(0, n - WINDOW), n):
        if points.quality[j] == GOOD and abs(points.missed[j]) > FAR_OFF * usual:
            points.quality[j] = SPIKE
    return True


@register_jitable
def _draw_line(memory: Any, whole: Any) -> int:
    """Find the line, and what it misses, unless that cannot be told yet or makes no sense."""
    points = memory.points
    n, count, low, high = int(memory.count), 0, np.inf, -np.inf
    for j in range(max(0, n - WINDOW), n):
        if points.quality[j] == SPIKE:
            points.quality[j] = GOOD
        if points.quality[j] == GOOD:
            count += 1
            low, high = min(low, points.x[j]), max(high, points.x[j])
    if count < FIRST:
        return NO_LINE
    gain, offset, doubt, usual = _fit(memory, whole)
    if _leave_out_spikes(memory, usual):
        gain, offset, doubt, usual = _fit(memory, whole)
    if not doubt < GAIN_KNOWN:
        return NO_LINE
    if not 1.0 / FAR < gain / memory.seen.base < FAR:
        return NOTHING_READ
    if whole and memory.seen.known == 0.0:
        memory.seen.known, memory.seen.base = 1.0, gain
    memory.seen.gain, memory.seen.offset = gain, offset
    memory.seen.unexplained = _size(memory)
    memory.seen.span = min(high - low, abs(gain) * 2.0 * memory.u.swing)
    return JUDGE


@register_jitable
def _track(memory: Any) -> Any:
    """Least and largest root mean square of r - x [µm] in the quarters of the last swing; points at rest."""
    points = memory.points
    n, least, worst, resting = int(memory.count), np.inf, 0.0, 0
    for quarter in range(4):
        squares, count = 0.0, 0
        end = n - quarter * A_SWING // 4
        for j in range(max(0, end - A_SWING // 4), end):
            needed = (points.r[j] - memory.seen.offset) / memory.seen.gain
            if memory.lowest <= needed <= memory.highest:
                resting += points.quality[j] == RESTS and quarter < 2
                if points.quality[j] < DEAD:
                    squares += (points.r[j] - points.x[j]) ** 2
                    count += 1
        known = count >= A_SWING // 8
        least = min(least, np.sqrt(squares / count) if known else 0.0)
        worst = max(worst, np.sqrt(squares / count) if known else np.inf)
    return least, worst, resting


@register_jitable
def _what_can_be_said(memory: Any) -> int:
    """What a look at the points says, once it is time for a verdict."""
    points = memory.points
    n, dead = int(memory.count), 0
    if memory.seen.known == 0.0 and points.quality[n - 1] < DEAD:
        memory.seen.offset = points.x[n - 1] - memory.seen.gain * points.u[n - 1]
    memory.seen.least_miss, memory.seen.worst_miss, resting = _track(memory)
    if resting >= 3 * A_SWING // 8:
        return AT_REST
    for j in range(max(0, n - A_SWING // 4), n):
        dead += points.quality[j] == DEAD
    if 2 * dead > min(n, A_SWING // 4):
        return NOTHING_READ
    return _draw_line(memory, memory.seen.turns >= 2.0)


@compiled
def look(memory: Record, r: Vector, u: Vector, x: Vector) -> int:
    """Take an interval; what can be said now."""
    for k in range(u.size):
        memory.samples += 1.0
        readable = _readable(memory, u[k], x[k])
        extreme, extreme_x, extreme_r = memory.u.furthest, memory.furthest_x, memory.furthest_r
        is_first = memory.seen.kept == 0.0
        turned = _follow(memory.u, u[k], is_first)
        _follow(memory.r, r[k], is_first)
        if turned:
            memory.seen.turns += 1.0
            if extreme != memory.seen.last_u:
                _keep(memory, extreme, extreme_x, extreme_r, np.isfinite(extreme_x))
        if memory.u.furthest == u[k]:
            memory.furthest_x, memory.furthest_r = x[k] if readable else np.nan, r[k]
        memory.lowest, memory.highest = min(memory.lowest, u[k]), max(memory.highest, u[k])
        du, dr = abs(u[k] - memory.seen.last_u), abs(r[k] - memory.last_r)
        travelled = du > 0.0 and du >= memory.u.swing / A_SWING
        if is_first or travelled or (dr > 0.0 and dr >= memory.r.swing / A_SWING):
            if memory.u.swing > 2.0 * memory.thinned:
                _thin(memory)
            _keep(memory, u[k], x[k], r[k], readable)
    if memory.fresh < A_VERDICT:
        return NOT_YET
    memory.fresh = 0.0
    memory.seen.found = _what_can_be_said(memory)
    return int(memory.seen.found)


@compiled
def missed_by_loop(memory: Record, a: float, b: float, c: float, offset: float) -> float:
    """What a Coleman-Hodgdon model misses [µm], from where the recent path of the voltage puts it."""
    points = memory.points
    recent_path.use_decay(memory.path, a)
    w_h, u = b * recent_path.hysteresis(memory.path), memory.path.present
    for j in range(int(memory.count)):
        w_h = hysteresis_step(w_h, points.u[j] - u, a, b)
        u = points.u[j]
        points.missed[j] = points.x[j] - (c * u + w_h + offset)
    return _size(memory)


@compiled
def missed_but_for_mean(memory: Record, y: Vector) -> float:
    """What displacements y miss, but for the mean error [µm]."""
    points = memory.points
    n, count, mean = int(memory.count), 0, 0.0
    for j in range(max(0, n - WINDOW), n):
        points.missed[j] = points.x[j] - y[j]
        if points.quality[j] == GOOD:
            count += 1
            mean += (points.missed[j] - mean) / count
    for j in range(n):
        points.missed[j] -= mean
    return _size(memory)


def begin(gain: float, offset: float) -> Any:
    """Empty memory, with the line of the first model."""
    memory = new(MEMORY, reading=math.nan, seen={"base": gain, "gain": gain, "offset": offset})
    recent_path.begin(Named(memory["path"], recent_path.PATH), 0.0, 1.0)
    return memory


def voltages(memory: Any) -> FloatArray:
    """Voltages of the points, after the turning points of the recent path that led there."""
    path, count = memory["path"], int(memory["count"])
    places = (int(path["newest"]) - np.arange(int(path["count"]) - 1, -1, -1)) % recent_path.MOST
    return np.concatenate([path["points"][places], [path["furthest"]], memory["points"]["u"][:count]])
