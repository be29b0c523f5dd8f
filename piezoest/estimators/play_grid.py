"""Plays on a grid: where thresholds and bends lie, what starts there, regressors, and how slopes move on."""

import functools
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray, as_floats, finite
from piezoest.equations.bent_plays import between
from piezoest.equations.creep import unit_creep_step
from piezoest.equations.play import play, sum_of_first
from piezoest.equations.turning_points import TURNING_POINTS, recall
from piezoest.layout import (
    AMOUNT,
    COUNT,
    DISTANCE,
    FIXED,
    MEASURED,
    NUMBER,
    WORK,
    Kind,
    Length,
    Record,
    numbers,
    record,
    whole,
)
from piezoest.models import ColemanHodgdon, LinearGain, PrandtlIshlinskii

# Half-width of the first grid of a Coleman-Hodgdon model, relative to 1/alpha.
FIRST_RANGE = 0.6
LEAST_RANGE = 1e-15  # least half-width of a grid [V]
LEAST_SHRUNK = 1e-9  # half-width that a grid shrinks to, relative to the one before
FAR = 1e30  # where the outer segments end [V]
LEVEL_START = 0.03  # deviation of the level where nothing is known of it, relative to the stroke
# Turns after which a grid that was laid too wide shrinks, and once it was looked at.
ENOUGH_TURNS, LOOKED_AT = 4.0, 5.0

# Prior: deviations of the gain, of each weight relative to the mean one, between segments.
GAIN_DEVIATION, WEIGHT_DEVIATION, SEGMENT_SHARE = 0.15, 1.0, 0.6
CORRELATION = 3.0  # thresholds over which the weights' deviations are alike
CREEP_START, CREEP_DEVIATION = 0.01, 0.03


# ---------------------------------------------------------------- start


class Plan(NamedTuple):
    """Grid and start."""

    relative: FloatArray  # thresholds relative to half the range
    bends: FloatArray  # the same, from the middle
    times: FloatArray
    centre: float
    half_width: float
    fixed: bool
    unit: float  # µm/V
    slopes: FloatArray  # (1 + n, 1 + k) [µm/V]
    gains: FloatArray
    offset: float


def plan(initial: Any, voltage_range: Any, thresholds: int, bends: int, times: FloatArray) -> Plan:
    """Grid and start that the arguments ask for."""
    if np.any(times <= 0.0):
        raise ValueError(f"creep must hold time constants above zero, got {times.min():g} s")
    return _plan(initial, None if voltage_range is None else _middle(voltage_range), thresholds, bends, times)


@functools.singledispatch
def _plan(initial: Any, given: Any, thresholds: int, bends: int, times: FloatArray) -> Plan:
    """Plan for a model; `given` are middle and half-width of the range of voltage, where one is."""
    raise NotImplementedError


@_plan.register
def _of_line(initial: LinearGain, given: Any, thresholds: int, bends: int, times: FloatArray) -> Plan:
    if initial.gain <= 0.0:
        raise ValueError(f"initial_model must have a gain above zero, got {initial.gain:g} µm/V")
    slopes, none = np.array([[initial.gain]]), np.empty(0)
    centre, half_width = given or (0.0, 1.0)
    return Plan(none, none, none, centre, half_width, True, initial.gain, slopes, none, initial.offset)


@_plan.register
def _of_plays(initial: PrandtlIshlinskii, given: Any, thresholds: int, bends: int, times: FloatArray) -> Plan:
    n, k = initial.thresholds.size, initial.bends.size
    half_width = float(initial.thresholds[-1]) if n else 1.0
    centre = float(np.mean(initial.bends)) if k else 0.0
    first = np.append(initial.gain, initial.weights)[:, None]
    slopes = np.hstack([first, first + np.cumsum(initial.bend_weights, axis=0).T])
    times = np.empty(0) if initial.creep is None else initial.creep.time_constants
    gains = np.empty(0) if initial.creep is None else initial.creep.gains
    relative, edges = initial.thresholds / half_width, (initial.bends - centre) / half_width
    return Plan(relative, edges, times, centre, half_width, True, initial.gain, slopes, gains, initial.offset)


@_plan.register
def _of_loop(initial: ColemanHodgdon, given: Any, thresholds: int, bends: int, times: FloatArray) -> Plan:
    centre, half_width = given or (0.0, FIRST_RANGE / initial.alpha)
    fixed = given is not None
    relative = np.arange(1, thresholds + 1) / max(1, thresholds)
    edges = np.linspace(-1.0, 1.0, bends + 2)[1:-1]
    loop = _with_the_loop_of(initial, half_width * relative, half_width)
    slopes = np.repeat(loop[:, None], bends + 1, axis=1)
    gains = np.full(times.size, CREEP_START)
    return Plan(
        relative, edges, times, centre, half_width, fixed, float(loop[0]), slopes, gains, initial.offset
    )


def _middle(voltage_range: Any) -> tuple[float, float]:
    """Middle and half-width of a range of voltage."""
    values = as_floats("voltage_range", voltage_range)
    if values.shape != (2,) or not values[0] < values[1]:
        raise ValueError(f"voltage_range must be (least, largest) in V, got {voltage_range!r}")
    low, high = (finite("voltage_range", float(value)) for value in values)
    return 0.5 * (low + high), 0.5 * (high - low)


def _with_the_loop_of(model: ColemanHodgdon, thresholds: FloatArray, amplitude: float) -> FloatArray:
    """Gain and weights, not below zero, whose loop at an amplitude is nearest to the model's."""
    from scipy.optimize import nnls

    quarter = np.linspace(0.0, amplitude, 101)[1:]
    u = np.concatenate([quarter, *([quarter[-2::-1], -quarter[:1], -quarter, -quarter[-2::-1], quarter] * 2)])
    x = model.simulate(u, allow_jumps=True) - model.offset
    plain = [PrandtlIshlinskii(0.0, [r], [1.0]).simulate(u) for r in thresholds]
    columns = np.column_stack([u, *plain])
    late = slice(quarter.size, None)
    found = nnls(columns[late], x[late])[0]
    # None at zero: a weight there would have no scale.
    least = np.append(0.1, np.full(thresholds.size, 0.1 / max(1, thresholds.size))) * (found.sum() or 1.0)
    return np.asarray(np.maximum(found, 0.1 * least))


def prior(plan: Plan, uncertainty: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Start, deviations and covariance of all parameters in the law's units."""
    slopes = plan.slopes / plan.unit
    rows, columns = slopes.shape
    n, m = rows - 1, plan.times.size
    deviation = np.full(rows, GAIN_DEVIATION)
    if n:
        deviation[1:] = WEIGHT_DEVIATION * max(float(slopes[1:].sum()) / (n * columns), 0.3 / n)
    index = np.arange(rows)
    alike = np.exp(-np.abs(index[:, None] - index) / CORRELATION)
    alike[0, 1:] = alike[1:, 0] = 0.0
    segments = np.full((columns, columns), 1.0) + SEGMENT_SHARE**2 * np.eye(columns)
    shape = np.kron(alike * np.outer(deviation, deviation), segments)
    flat = slopes.ravel()
    size = flat.size + m + 1
    P = np.zeros((size, size))
    P[: flat.size, : flat.size] = shape + uncertainty**2 * np.outer(flat, flat)
    place = np.arange(flat.size, flat.size + m)
    P[place, place] = CREEP_DEVIATION**2
    P[-1, -1] = (LEVEL_START * plan.unit * plan.half_width) ** 2
    spread = np.concatenate([np.repeat(deviation, columns), np.full(m, CREEP_DEVIATION), [0.0]])
    return np.concatenate([flat, plan.gains, [plan.offset]]), spread, P


# ---------------------------------------------------------------- grid


def layout(plan: Plan) -> Record:
    """Layout of plays on a grid: its middle and half-width, the range seen, and what each slope has of them.

    Slopes stand by play, the voltage first, and within a play by segment: `reach` is the play's threshold,
    `lower` and `upper` are the ends of its segment, `zero` is what zero has of it; `y` is the play,
    `segments` what is between those ends, and `way` how far that has travelled in a window.
    """
    slopes, terms = Length("slopes", plan.slopes.size), Length("terms", plan.times.size)
    middle, half_width = MEASURED, Kind(LEAST_RANGE, DISTANCE.high)
    return record(
        u=MEASURED, travel=AMOUNT,
        centre=FIXED if plan.fixed else middle, half_width=FIXED if plan.fixed else half_width,
        low=MEASURED, high=MEASURED, turns=whole(0.0, LOOKED_AT), memory=TURNING_POINTS,
        phi=numbers(Length("size", plan.slopes.size + plan.times.size + 1)),
        y=numbers(slopes, kind=MEASURED), reach=numbers(slopes, kind=AMOUNT),
        segments=numbers(slopes, kind=MEASURED), way=numbers(slopes, kind=AMOUNT),
        lower=numbers(slopes), upper=numbers(slopes), zero=numbers(slopes),
        creep=numbers(terms), work=numbers(slopes, kind=WORK),
    )  # fmt: skip


def window_layout(plan: Plan) -> Record:
    """Layout of the sums since the last update."""
    size = plan.slopes.size + plan.times.size + 1
    return record(elapsed=COUNT, count=COUNT, x=NUMBER, phi=numbers(Length("size", size)))


@register_jitable
def regressor(plays: Any, unit: Any, counted: Any) -> None:
    """Regressor of the present plays and creep; its travel is added where `counted` is 1.0."""
    y, segments, way, phi, creep = plays.y, plays.segments, plays.way, plays.phi, plays.creep
    lower, upper, zero = plays.lower, plays.upper, plays.zero
    slopes = len(y)
    # Short loops over few arrays: the compiler makes vector instructions of them.
    for i in range(slopes):
        phi[i] = between(y[i], lower[i], upper[i]) - zero[i]
    for i in range(slopes):
        way[i] += counted * abs(phi[i] - segments[i])
    for i in range(slopes):
        segments[i] = phi[i]
    for i in range(slopes):
        phi[i] *= unit
    for i in range(len(creep)):
        phi[slopes + i] = creep[i]
    phi[len(phi) - 1] = 1.0


@register_jitable
def advance(plays: Any, settings: Any, theta: Any, u: Any) -> None:
    """Plays, creep and regressor after the next voltage; creep follows what `theta` makes of the plays."""
    y, reach = plays.y, plays.reach
    slopes = len(y)
    for i in range(slopes):
        y[i] = play(y[i], u, reach[i])
    plays.travel += abs(u - plays.u)
    plays.u = u
    regressor(plays, settings.unit, 1.0)
    creep, phi = plays.creep, plays.phi
    if len(creep) == 0:
        return
    unit_creep_step(creep, sum_of_first(slopes, theta, phi), settings.decays)
    for i in range(len(creep)):
        phi[slopes + i] = creep[i]


@register_jitable
def begin_window(window: Any, plays: Any) -> None:
    """Begin the sums and the travel again."""
    window.elapsed = window.count = window.x = plays.travel = 0.0
    phi, way = window.phi, plays.way
    for i in range(len(phi)):
        phi[i] = 0.0
    for i in range(len(way)):
        way[i] = 0.0


@register_jitable
def _end_of_segment(bends: Any, s: int, centre: Any, half_width: Any) -> Any:
    """Upper end of segment s, which is where the next begins; the outer ones are without end."""
    if s < 0:
        return -FAR
    if s == len(bends):
        return FAR
    return centre + half_width * bends[s]


@register_jitable
def lay(plays: Any, settings: Any) -> None:
    """Thresholds and ends of segments of all slopes, for the grid's middle and half-width."""
    reach, lower, upper, zero = plays.reach, plays.lower, plays.upper, plays.zero
    relative, bends = settings.relative_thresholds, settings.relative_bends
    centre, half_width = plays.centre, plays.half_width
    columns = len(bends) + 1
    for place in range(len(reach)):
        i, s = place // columns, place % columns
        reach[place] = half_width * relative[i - 1] if i > 0 else 0.0
        lower[place] = _end_of_segment(bends, s - 1, centre, half_width)
        upper[place] = _end_of_segment(bends, s, centre, half_width)
        zero[place] = between(0.0, lower[place], upper[place])


@register_jitable
def _cell_edge(relative: Any, i: int) -> Any:
    """Upper edge of the thresholds' cell i relative to the half-width; cell 0 is the voltage's own."""
    n = len(relative)
    if i == 0:
        return 0.5 * relative[0]
    if i < n:
        return 0.5 * (relative[i - 1] + relative[i])
    return relative[n - 1] + 0.5 * (relative[n - 1] - (relative[n - 2] if n > 1 else 0.0))


@register_jitable
def _over_thresholds(theta: Any, relative: Any, columns: int, ratio: Any, moved: Any) -> None:
    """Slopes for thresholds that are smaller by `ratio`, into `moved`; beyond the old ones all are alike."""
    n = len(relative)
    top = _cell_edge(relative, n) * ratio
    for s in range(columns):
        tail, length = 0.0, 0.0
        for i in range(n - max(1, n // 3), n):
            tail += theta[(i + 1) * columns + s]
            length += (_cell_edge(relative, i + 1) - _cell_edge(relative, i)) * ratio
        for c in range(n + 1):
            low = 0.0 if c == 0 else _cell_edge(relative, c - 1)
            high = _cell_edge(relative, c)
            total = theta[s] if c == 0 else 0.0
            for i in range(1, n + 1):
                a = _cell_edge(relative, i - 1) * ratio
                b = _cell_edge(relative, i) * ratio
                overlap = max(0.0, min(high, b) - max(low, a))
                total += theta[i * columns + s] * overlap / (b - a)
            total += tail / length * max(0.0, high - max(low, top))
            moved[c * columns + s] = total


@register_jitable
def _over_voltage(slopes: Any, plays: Any, bends: Any, centre: Any, half_width: Any, moved: Any) -> None:
    """Slopes for segments of another grid, into `moved`: means of the old ones over each."""
    columns = len(bends) + 1
    for place in range(len(slopes)):
        s = place % columns
        low = max(_end_of_segment(bends, s - 1, centre, half_width), centre - half_width)
        high = min(_end_of_segment(bends, s, centre, half_width), centre + half_width)
        total = 0.0
        for o in range(columns):
            a = _end_of_segment(bends, o - 1, plays.centre, plays.half_width)
            b = _end_of_segment(bends, o, plays.centre, plays.half_width)
            total += slopes[place - s + o] * max(0.0, min(high, b) - max(low, a))
        moved[place] = total / (high - low)


@register_jitable
def wanted_half_width(plays: Any) -> Any:
    """Half-width of a new grid where the voltage leaves it, or once where it is far too wide; else zero."""
    plays.low = min(plays.low, plays.u)
    plays.high = max(plays.high, plays.u)
    seen = 0.5 * (plays.high - plays.low)
    if abs(plays.u - plays.centre) > 1.02 * plays.half_width:
        return max(1.1 * seen, 0.9 * plays.half_width)
    if plays.turns == ENOUGH_TURNS:
        plays.turns = LOOKED_AT
        if 1.3 * seen < plays.half_width and seen > 0.0:
            return max(1.05 * seen, LEAST_SHRUNK * plays.half_width)
    return 0.0


@register_jitable
def move(plays: Any, settings: Any, theta: Any, half_width: Any) -> None:
    """Lay a grid about the middle of the range seen, and move the slopes in `theta` to it.

    Slopes are densities: over the thresholds, continued evenly beyond the old grid, and over the voltage. The
    new plays are where the voltage's turning points have left them.
    """
    relative, bends, y = settings.relative_thresholds, settings.relative_bends, plays.y
    columns, centre = len(bends) + 1, 0.5 * (plays.high + plays.low)
    _over_thresholds(theta, relative, columns, plays.half_width / half_width, plays.work)
    _over_voltage(plays.work, plays, bends, centre, half_width, theta)
    plays.half_width = half_width
    plays.centre = centre
    lay(plays, settings)
    for first in range(0, len(y), columns):
        value = recall(plays.memory, plays.reach[first]) if first > 0 else plays.u
        for s in range(columns):
            y[first + s] = value
