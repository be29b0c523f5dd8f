"""Records the loop: the last leg of the voltage in each direction becomes a smooth curve.

The samples of a leg are averaged in bins of equal width; when it becomes too long, the bins are joined in
pairs. At its end a polynomial is fitted by least squares, which removes oscillations and most of the noise.
The functions are those of an estimator's kernel, see `piezoest.estimators.compiled.CompiledEstimator`.

Source: G. E. Forsythe, J. Soc. Indust. Appl. Math. 5 (1957) 74-88 (polynomials orthogonal on given points).
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.compile import like, local
from piezoest.controller import travel as travels
from piezoest.controller.recorded_loop import KNOTS, LOOP, STEEP, curve_of
from piezoest.estimators.model_writing import NO_MODEL, NOT_CLOSED, TO_BE_PLACED
from piezoest.layout import AMOUNT, COUNT, DISTANCE, FIXED, FLAG, MEASURED, NUMBER, SIGN, numbers, record

BINS = 32
# Voltage where a leg began; its samples with a voltage of their own, and all of them until it last went on;
# whether a rest has broken it; width of a bin; points in each bin, sums of their voltages and displacements.
LEG = record(
    turned=MEASURED, passed=COUNT, taken=COUNT, broken=FLAG, width=AMOUNT, count=numbers(BINS, kind=COUNT),
    sum_u=numbers(BINS, kind=NUMBER), sum_x=numbers(BINS, kind=NUMBER),
)  # fmt: skip
# Direction of travel and furthest voltage in it; this leg; the way back from there, which becomes the next
# leg, and its length; length of the last leg, and of the longest recent one; samples since the voltage went
# farther, turns, samples of the longest recent leg; the loop; the only direction that was recorded, zero for
# both; whether the loop is newer than the model in use.
STATE = record(
    __name__, direction=SIGN, furthest=MEASURED, leg=LEG, back=LEG, far=DISTANCE, last=DISTANCE,
    longest=DISTANCE, waits=COUNT, turns=COUNT, usual=AMOUNT, loop=LOOP, alone=SIGN, fresh=FLAG,
)  # fmt: skip
# Settings: least number of samples of a leg that is drawn finely.
LAYOUTS = STATE, record(fine=FIXED)

# A leg shorter than SHORT times the longest recent one is not recorded. At each turn the longest one loses
# FADES of itself, less after shorter legs. A way back longer than TURN times this leg and the last one is a
# turn: when models change, the voltage may go back for a moment.
SHORT, FADES, TURN = 0.05, 0.03, 0.04
# A leg that takes so many times the samples of the longest recent one, which becomes SLOWER at each turn, has
# a rest within it, in which the stage creeps: it is not recorded. Before SHOWN turns nobody knows.
BROKEN, SLOWER, SHOWN = 2.5, 0.7, 3.0
# If a leg is shorter than this part of the next one, the next one, reversed, is better for its direction.
ALIKE = 0.7
# First width of a bin, in units; degree of the polynomial; least number of bins with readings.
NARROW, DEGREE, LEAST = 1e-3, 4, 8
# A leg gets a higher degree if that leaves less than this part of the squares: a wide loop has sharp bends.
# The leg must take so long [s], for on a faster one a higher degree would follow the oscillations of a
# resonance, and be as long as the last one within this factor: only motion that repeats itself stays within
# its ends.
FINE, FINER, LONG, SAME = 8, 0.3, 40e-3, 0.9
# Part of a leg that readings must cover, and of its samples that must have one: far from its points a
# polynomial is useless.
COVERED, READ = 0.9, 0.5
# A loop is closed if its end lies beside its beginning by less than this part of the last leg: a stage
# drifts to a new loop, and some take several legs.
CLOSED = 0.01


@register_jitable
def _begin_leg(leg: Any, u: Any) -> None:
    """Begin a leg at a voltage."""
    leg.turned, leg.width = u, NARROW
    leg.passed = leg.taken = leg.broken = 0.0
    for i in range(BINS):
        leg.count[i] = leg.sum_u[i] = leg.sum_x[i] = 0.0


@register_jitable
def _widen(numbers: Any) -> None:
    """Join each two bins."""
    for i in range(BINS // 2):
        numbers[i] = numbers[2 * i] + numbers[2 * i + 1]
    for i in range(BINS // 2, BINS):
        numbers[i] = 0.0


@register_jitable
def _add(leg: Any, u: Any, x: Any) -> None:
    """Take a sample of a leg; x may be missing."""
    leg.passed += 1.0
    if not np.abs(x) < WILDEST:
        return
    leg.width = max(leg.width, NARROW)
    while np.abs(u - leg.turned) >= BINS * leg.width:
        leg.width *= 2.0
        _widen(leg.count)
        _widen(leg.sum_u)
        _widen(leg.sum_x)
    i = int(np.abs(u - leg.turned) / leg.width)
    leg.count[i] += 1.0
    leg.sum_u[i] += u
    leg.sum_x[i] += x


@register_jitable
def _length(state: Any) -> float:
    """Length of this leg so far."""
    return np.abs(state.furthest - state.leg.turned)


@register_jitable
def _used(leg: Any) -> int:
    """Number of bins with readings."""
    used = 0
    for i in range(BINS):
        used += leg.count[i] > 0.0
    return used


@register_jitable
def _is_fine(state: Any, settings: Any) -> bool:
    """Whether a leg may have a higher degree."""
    leg = state.leg
    again = travels.are_alike(_length(state), state.last, SAME)
    return again and leg.passed >= settings.fine and _used(leg) >= 2 * FINE


@register_jitable
def _squares(leg: Any, left: Any) -> float:
    """Sum of the squares of what is left in the bins."""
    total = 0.0
    for i in range(BINS):
        total += leg.count[i] * left[i] * left[i]
    return total


@register_jitable
def _draw(state: Any, settings: Any, curve: Any) -> None:
    """Draw a polynomial through the bins of a leg, from its beginning to its end, as a curve of the loop."""
    leg, x = state.leg, state.loop.x
    apart = _length(state) / (KNOTS - 1.0)
    state.loop.begins[curve], state.loop.apart[curve] = leg.turned, apart
    # Each polynomial and the one before it, in the bins and at the knots: p(t), t = -1...1 along the curve.
    in_bins, bins_before = like(leg.count), like(leg.count)
    at_knots, knots_before = local(KNOTS), local(KNOTS)
    for k in range(KNOTS):
        at_knots[k], knots_before[k], x[curve, k] = 1.0, 0.0, 0.0
    half, norm_before = 0.5 * (KNOTS - 1.0), 1.0
    t, left = like(leg.count), like(leg.count)
    for i in range(BINS):
        in_bins[i], bins_before[i], t[i], left[i] = 1.0, 0.0, 0.0, 0.0
        if leg.count[i] > 0.0:
            t[i] = np.abs(leg.sum_u[i] / leg.count[i] - leg.turned) / (apart * half) - 1.0
            left[i] = leg.sum_x[i] / leg.count[i]
    # The curve of the lower degree, and what it leaves.
    plain, squares, most = local(KNOTS), 0.0, FINE if _is_fine(state, settings) else DEGREE
    for degree in range(most + 1):
        norm = product = middle = 0.0
        for i in range(BINS):
            weight = leg.count[i] * in_bins[i]
            norm += weight * in_bins[i]
            middle += weight * t[i] * in_bins[i]
            product += weight * left[i]
        if not norm > 0.0:
            break
        share, middle, before = product / norm, middle / norm, norm / norm_before
        norm_before = norm
        for i in range(BINS):
            left[i] -= share * in_bins[i]
            next_one = (t[i] - middle) * in_bins[i] - before * bins_before[i]
            in_bins[i], bins_before[i] = next_one, in_bins[i]
        for k in range(KNOTS):
            x[curve, k] += share * at_knots[k]
            next_one = (k / half - 1.0 - middle) * at_knots[k] - before * knots_before[k]
            at_knots[k], knots_before[k] = next_one, at_knots[k]
        if degree == DEGREE:
            squares = _squares(leg, left)
            for k in range(KNOTS):
                plain[k] = x[curve, k]
    if most == FINE and _squares(leg, left) > FINER * squares:
        for k in range(KNOTS):
            x[curve, k] = plain[k]
    for k in range(1, KNOTS):
        gone = (x[curve, k] - x[curve, k - 1]) * state.direction
        x[curve, k] = x[curve, k - 1] + max(gone, STEEP * apart) * state.direction


@register_jitable
def _is_known(state: Any) -> bool:
    """Whether there are readings all along a leg."""
    leg = state.leg
    points, nearest, farthest = 0.0, np.inf, 0.0
    for i in range(BINS):
        if leg.count[i] > 0.0:
            points += leg.count[i]
            way = np.abs(leg.sum_u[i] / leg.count[i] - leg.turned)
            nearest, farthest = min(nearest, way), max(farthest, way)
    length = _length(state)
    return _used(leg) >= LEAST and points >= READ * leg.passed and farthest - nearest >= COVERED * length


@register_jitable
def _end_leg(state: Any, settings: Any) -> None:
    """Record a leg that is over, if it is known."""
    if not _is_known(state):
        return
    loop, curve = state.loop, curve_of(state.direction)
    other = 1 - curve
    alone = loop.ended == 0.0 or state.alone == state.direction
    state.alone = state.direction if alone else 0.0
    _draw(state, settings, curve)
    if alone or loop.apart[other] < ALIKE * loop.apart[curve]:
        # Reversed, the curve is used for the other direction, too: loops are about symmetric.
        loop.begins[other], loop.apart[other] = state.furthest, loop.apart[curve]
        for k in range(KNOTS):
            loop.x[other, k] = loop.x[curve, KNOTS - 1] - (loop.x[curve, k] - loop.x[curve, 0])
    loop.ended = state.direction
    state.fresh = 1.0


@register_jitable
def _turn(state: Any, settings: Any, u: Any) -> None:
    """The way back has become the next leg."""
    leg, back, length = state.leg, state.back, _length(state)
    state.longest = max(state.longest, length)
    # The way back is broken where feedback has gone it in a rest: this leg would have gone on.
    if length > SHORT * state.longest and leg.broken + back.broken == 0.0:
        _end_leg(state, settings)
    if state.longest > 0.0:
        state.longest -= FADES * length * length / state.longest
    state.turns += 1.0
    state.usual = max(leg.taken, SLOWER * state.usual)
    state.last, state.direction, state.furthest, state.far = length, -state.direction, u, 0.0
    leg.turned, leg.width, leg.passed = back.turned, back.width, back.passed
    leg.taken, leg.broken = back.taken, back.broken
    for i in range(BINS):
        leg.count[i], leg.sum_u[i], leg.sum_x[i] = back.count[i], back.sum_u[i], back.sum_x[i]


@register_jitable
def _go_on(state: Any, leg: Any) -> None:
    """Count the samples of a leg; a rest breaks it."""
    leg.taken += state.waits
    state.waits = 0.0
    if state.turns >= SHOWN and leg.taken > BROKEN * state.usual:
        leg.broken = 1.0


@register_jitable
def sample(state: Any, settings: Any, u: Any, x: Any) -> None:
    """What becomes of one sample; x is NaN where there is no reading."""
    way = u - state.furthest
    state.waits += 1.0
    if way == 0.0:
        # A rest is no part of a leg: creep would look like hysteresis.
        return
    if state.direction == 0.0:
        state.direction = np.sign(way)
        _begin_leg(state.leg, state.furthest)
    if way * state.direction > 0.0:
        state.furthest, state.far = u, 0.0
        _go_on(state, state.leg)
        _add(state.leg, u, x)
    elif np.abs(way) > state.far:
        if state.far == 0.0:
            _begin_leg(state.back, state.furthest)
            # A rest at the turn is no part of it.
            state.waits = 1.0
        state.far = np.abs(way)
        _go_on(state, state.back)
        _add(state.back, u, x)
        if state.far > TURN * max(_length(state), state.last):
            _turn(state, settings, u)


@register_jitable
def _is_closed(loop: Any) -> bool:
    """Whether the end of the loop meets its beginning, along a line through the last curve."""
    last = curve_of(loop.ended)
    before, apart = 1 - last, loop.apart[last]
    end, gone = loop.x[last, KNOTS - 1], loop.x[last, KNOTS - 1] - loop.x[last, 0]
    missing = loop.begins[before] - loop.begins[last] - loop.ended * (KNOTS - 1.0) * apart
    at_beginning = end + gone / (loop.ended * (KNOTS - 1.0) * apart) * missing
    return np.abs(loop.x[before, 0] - at_beginning) < CLOSED * np.abs(gone)


@register_jitable
def write_model(state: Any, settings: Any, model: Any) -> float:
    """Hand over the loop if it is new."""
    loop = state.loop
    if state.fresh == 0.0:
        return NO_MODEL
    state.fresh = 0.0
    for curve in range(2):
        model.begins[curve], model.apart[curve] = loop.begins[curve], loop.apart[curve]
        for k in range(KNOTS):
            model.x[curve, k] = loop.x[curve, k]
    model.ended = loop.ended
    return TO_BE_PLACED if _is_closed(loop) else NOT_CLOSED
