"""The recorded loop as a model: the last measured curve for rising and for falling voltage.

If the voltage repeats a loop, the displacement repeats as well, whatever the law of the hysteresis is. After
a turn at another voltage, the curve of the new direction is used from its beginning (Masing's rule). It meets
the last way about where that began, and from there on the way before the last continues. The functions are
those of an inverse, see `piezoest.compensators.inverse_kernel`.

Sources: G. Masing, Proc. 2nd Int. Congr. Appl. Mech., Zürich 1926, 332-335; the wiping-out property,
I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.layout import AMOUNT, MEASURED, SIGN, numbers, record, whole

KNOTS = 33
# Two curves, up and down: voltage where each begins, and displacements from there on, at voltages that are
# `apart` in the direction of travel (zero while nothing is known); direction of the last recorded leg.
LOOP = record(
    begins=numbers(2, kind=MEASURED), apart=numbers(2, kind=AMOUNT), x=numbers(2, KNOTS, kind=MEASURED),
    ended=SIGN,
)  # fmt: skip
WAYS = 7
# The ways from turn to turn that are not wiped out, outermost first: direction, voltage and displacement
# where each began, its slope relative to its curve. Number `present` is the present way; the next one is the
# way back from the furthest voltage, which is not a turn while it is small.
STATE = record(
    __name__, present=whole(0.0, WAYS - 2.0), furthest=MEASURED, direction=numbers(WAYS, kind=SIGN),
    u=numbers(WAYS, kind=MEASURED), x=numbers(WAYS, kind=MEASURED), steeper=numbers(WAYS, kind=AMOUNT),
)  # fmt: skip
LAYOUTS = STATE, LOOP  # of state and settings

# Least slope of a recorded curve. A way is at most STEEPER times as steep or as flat as its curve. A way back
# longer than TURN times the curve of the present direction is a turn.
STEEP, STEEPER, TURN = 0.1, 3.0, 0.01


@register_jitable
def curve_of(direction: Any) -> int:
    """Number of the curve of a direction."""
    return 0 if direction > 0.0 else 1


@register_jitable
def _apart(loop: Any, direction: Any) -> float:
    """Distance between the knots of the curve of a direction [V]."""
    return loop.apart[curve_of(direction)]


@register_jitable
def _gone(loop: Any, direction: Any, far: Any) -> float:
    """Displacement at a distance from the beginning of a curve; beyond its ends its end pieces go on."""
    curve = curve_of(direction)
    place = far / loop.apart[curve]
    i = int(min(max(place, 0.0), KNOTS - 2.0))
    here = loop.x[curve, i]
    return here - loop.x[curve, 0] + (place - i) * (loop.x[curve, i + 1] - here)


@register_jitable
def _at(own: Any, loop: Any, way: Any, u: Any) -> float:
    """Displacement at a voltage of a way; the voltage itself while nothing is known."""
    direction = own.direction[way]
    if direction == 0.0 or _apart(loop, direction) == 0.0:
        return u
    return own.x[way] + own.steeper[way] * _gone(loop, direction, (u - own.u[way]) * direction)


@register_jitable
def _meet(own: Any, loop: Any, way: Any, u: Any, x: Any) -> None:
    """Change the slope of a way so that it leads to a voltage and a displacement."""
    direction, steeper = own.direction[way], 1.0
    if _apart(loop, direction) > 0.0:
        gone = _gone(loop, direction, (u - own.u[way]) * direction)
        if gone != 0.0:
            steeper = min(max((x - own.x[way]) / gone, 1.0 / STEEPER), STEEPER)
    own.steeper[way] = steeper


@register_jitable
def _go(own: Any, loop: Any, u: Any) -> None:
    """Go as far as a voltage; loops that are closed on the way are wiped out."""
    own.furthest, now = u, int(own.present)
    while now > 1 and (u - own.u[now - 1]) * own.direction[now] >= 0.0:
        met = own.u[now - 1]
        own.x[now - 2] += _at(own, loop, now, met) - _at(own, loop, now - 2, met)
        now -= 2
    if now == WAYS - 1:
        # Without room for another turn the innermost loop is forgotten.
        own.direction[now - 2], own.u[now - 2] = own.direction[now], own.u[now]
        own.x[now - 2], own.steeper[now - 2] = own.x[now], own.steeper[now]
        now -= 2
    own.present, back = now, now + 1
    own.direction[back], own.u[back], own.x[back] = -own.direction[now], u, _at(own, loop, now, u)
    _meet(own, loop, back, own.u[now], own.x[now])


@register_jitable
def expected(state: Any, settings: Any) -> float:
    """Displacement at the last voltage."""
    own, u = state.inverse, state.voltage
    now = int(own.present)
    back = (u - own.furthest) * own.direction[now] < 0.0
    return _at(own, settings.inverse, now + 1 if back else now, u)


@register_jitable
def follow(state: Any, settings: Any, wanted: Any, given: Any) -> None:
    """Turn where the voltage does."""
    own, loop = state.inverse, settings.inverse
    now = int(own.present)
    if own.direction[now] == 0.0:
        own.direction[now], own.u[now] = np.sign(given - state.voltage), state.voltage
        own.x[now], own.steeper[now], own.furthest = state.voltage, 1.0, state.voltage
    way = (given - own.furthest) * own.direction[now]
    if way < 0.0:
        small = -way <= TURN * (KNOTS - 1.0) * _apart(loop, own.direction[now])
        if small and (now == 0 or (given - own.u[now]) * own.direction[now] > 0.0):
            # No turn yet, nor does it close the present loop.
            return
        own.present += 1.0
    _go(own, loop, given)


@register_jitable
def place(state: Any, settings: Any) -> None:
    """Go on from where the last recorded leg has ended."""
    own, loop = state.inverse, settings.inverse
    furthest = own.furthest
    if own.direction[int(own.present)] == 0.0:
        return
    own.present, own.direction[0], own.steeper[0] = 0.0, loop.ended, 1.0
    curve = curve_of(loop.ended)
    own.u[0], own.x[0] = loop.begins[curve], loop.x[curve, 0]
    end = own.u[0] + loop.ended * (KNOTS - 1.0) * loop.apart[curve]
    _go(own, loop, end)
    if (furthest - end) * loop.ended <= 0.0:
        _end_as_recorded(own, loop)
        own.present = 1.0
    _go(own, loop, furthest)


@register_jitable
def _end_as_recorded(own: Any, loop: Any) -> None:
    """Let the way back lead to where its own curve ended, if that is near."""
    # At its end the stage may have crept in a rest before the other curve began.
    back, curve = own.direction[1], curve_of(own.direction[1])
    length = (own.u[0] - loop.begins[curve]) * back
    if np.abs(length - (KNOTS - 1.0) * loop.apart[curve]) < loop.apart[curve]:
        own.x[0] = loop.x[curve, 0] + _gone(loop, back, length)
        _meet(own, loop, 1, own.u[0], own.x[0])


@register_jitable
def _solve(own: Any, loop: Any, way: Any, u: Any, r: Any) -> float:
    """Voltage at which the displacement is r, on a way from u on; searched from knot to knot."""
    direction, first = own.direction[way], own.u[way]
    apart, here = _apart(loop, direction), _at(own, loop, way, u)
    passed = int(min(max((u - first) * direction / apart, 0.0), KNOTS - 1.0))
    for knot in range(passed + 1, KNOTS):
        to = first + direction * knot * apart
        there = _at(own, loop, way, to)
        if (there - r) * direction >= 0.0:
            return u + (r - here) / (there - here) * (to - u) if there != here else u
        u, here = to, there
    to = u + direction * apart
    there = _at(own, loop, way, to)
    return u + (r - here) / (there - here) * (to - u) if there != here else u


@register_jitable
def wanted(state: Any, settings: Any, r: Any) -> float:
    """Voltage that moves the displacement to r."""
    own, loop = state.inverse, settings.inverse
    now, u = int(own.present), own.furthest
    direction = own.direction[now]
    if direction == 0.0 or loop.apart[0] == 0.0 or loop.apart[1] == 0.0:
        return r
    if (r - own.x[now + 1]) * direction < 0.0:
        now, direction = now + 1, -direction
    while now > 1:
        # Where the way closes a loop, the one before it goes on.
        met = own.u[now - 1]
        x = _at(own, loop, now, met)
        if (r - x) * direction <= 0.0:
            break
        r += _at(own, loop, now - 2, met) - x
        u, now = met, now - 2
    return _solve(own, loop, now, u, r)
