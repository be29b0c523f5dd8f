"""The recorded loop as a model: the last measured curve for rising and for falling voltage.

If the voltage repeats a loop, the displacement repeats as well, whatever the law of the hysteresis is:
repeated motion needs no model. If the voltage turns elsewhere than in the record, the displacement goes
on as it did from the beginning of the curve of the new direction (Masing's rule), and meets the last way
where that began. The functions are those of an inverse, see `piezoest.compensators.inverse_kernel`.

Sources: G. Masing, Proc. 2nd Int. Congr. Appl. Mech., Zürich 1926, 332-335; the wiping-out property,
I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.layout import AMOUNT, COUNT, MEASURED, NUMBER, SIGN, numbers, record, whole

KNOTS = 17
# Displacements at evenly spaced voltages, from the lowest on; `apart` is zero while nothing is known.
CURVE = record(lowest=MEASURED, apart=AMOUNT, x=numbers(KNOTS, kind=MEASURED))
# Both curves, and direction of the last recorded leg.
LOOP = record(up=CURVE, down=CURVE, ended=SIGN)
WAYS = 8
# Ways from turn to turn, not yet wiped out: their directions, voltages and displacements where they began;
# what is added at each knot of the curve from there on, and at how many. After the present way comes the way
# back from where it has led.
STATE = record(
    __name__, present=whole(0.0, WAYS - 2.0), furthest=MEASURED, direction=numbers(WAYS, kind=SIGN),
    u=numbers(WAYS, kind=MEASURED), x=numbers(WAYS, kind=MEASURED), added=numbers(WAYS, kind=NUMBER),
    knots=numbers(WAYS, kind=COUNT),
)  # fmt: skip
LAYOUTS = STATE, LOOP  # of state and settings

# Least slope of a curve, and what is added to it at most: less, so the displacement goes with the voltage.
# A way back longer than this part of a curve is a turn.
STEEP, GENTLE, TURN = 0.1, 0.05, 0.01


@register_jitable
def _gone(curve: Any, direction: Any, far: Any) -> float:
    """Displacement so far from the beginning of a curve; beyond its end as on its last piece."""
    place = far / curve.apart
    i = int(min(place, KNOTS - 2.0))
    if direction > 0.0:
        return curve.x[i] - curve.x[0] + (place - i) * (curve.x[i + 1] - curve.x[i])
    k = KNOTS - 1 - i
    return curve.x[k] - curve.x[KNOTS - 1] - (place - i) * (curve.x[k] - curve.x[k - 1])


@register_jitable
def _on_curve(loop: Any, direction: Any, far: Any) -> float:
    """Displacement so far from the beginning of the curve of a direction."""
    return _gone(loop.up, 1.0, far) if direction > 0.0 else _gone(loop.down, -1.0, far)


@register_jitable
def _apart(loop: Any, direction: Any) -> float:
    """How far apart the knots of the curve of a direction are."""
    return loop.up.apart if direction > 0.0 else loop.down.apart


@register_jitable
def _begins(loop: Any, direction: Any) -> float:
    """Voltage at which the curve of a direction begins."""
    return loop.up.lowest if direction > 0.0 else loop.down.lowest + (KNOTS - 1.0) * loop.down.apart


@register_jitable
def _first(loop: Any, direction: Any) -> float:
    """Displacement at which the curve of a direction begins."""
    return loop.up.x[0] if direction > 0.0 else loop.down.x[KNOTS - 1]


@register_jitable
def _at(own: Any, loop: Any, way: Any, u: Any) -> float:
    """Displacement at a voltage of a way; the voltage itself while nothing is known."""
    direction = own.direction[way]
    apart, far = _apart(loop, direction), np.abs(u - own.u[way])
    if apart == 0.0 or direction == 0.0:
        return u
    return own.x[way] + _on_curve(loop, direction, far) + own.added[way] * min(far / apart, own.knots[way])


@register_jitable
def _meet(own: Any, loop: Any, way: Any, u: Any, x: Any) -> None:
    """Let a way lead to a voltage and a displacement, about."""
    direction = own.direction[way]
    apart, far = _apart(loop, direction), np.abs(u - own.u[way])
    if apart > 0.0:
        own.knots[way] = int(min(max(far / apart + 0.5, 1.0), KNOTS - 1.0)) * 1.0
        missed = (x - own.x[way] - _on_curve(loop, direction, far)) / own.knots[way]
        own.added[way] = min(max(missed, -GENTLE * apart), GENTLE * apart)


@register_jitable
def _go(own: Any, loop: Any, u: Any) -> None:
    """Go as far as a voltage; loops that are passed are wiped out."""
    own.furthest, now = u, int(own.present)
    while now > 1 and (u - own.u[now - 1]) * own.direction[now] > 0.0:
        met = own.u[now - 1]
        own.x[now - 2] += _at(own, loop, now, met) - _at(own, loop, now - 2, met)
        now -= 2
    own.present, back = now, now + 1
    own.direction[back], own.u[back], own.x[back] = -own.direction[now], u, _at(own, loop, now, u)
    _meet(own, loop, back, own.u[now], own.x[now])


@register_jitable
def _turn(own: Any) -> None:
    """Turn at the furthest voltage; without room the widest loop is forgotten."""
    own.present += 1.0
    if own.present > WAYS - 2.0:
        own.present -= 2.0
        for i in range(WAYS - 2):
            own.direction[i], own.u[i], own.x[i] = own.direction[i + 2], own.u[i + 2], own.x[i + 2]
            own.added[i], own.knots[i] = own.added[i + 2], own.knots[i + 2]


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
        own.x[now] = own.furthest = state.voltage
    way = (given - own.furthest) * own.direction[now]
    if way < 0.0:
        if -way <= TURN * (KNOTS - 1.0) * loop.up.apart:
            return
        _turn(own)
    _go(own, loop, given)


@register_jitable
def place(state: Any, settings: Any) -> None:
    """Go on from where the last recorded leg has ended."""
    own, loop = state.inverse, settings.inverse
    now = int(own.present)
    direction, turned, furthest = own.direction[now], own.u[now], own.furthest
    if direction == 0.0:
        return
    own.present = own.added[0] = 0.0
    own.direction[0], own.u[0], own.x[0] = loop.ended, _begins(loop, loop.ended), _first(loop, loop.ended)
    _go(own, loop, own.u[0] + loop.ended * (KNOTS - 1.0) * _apart(loop, loop.ended))
    _end_as_recorded(own, loop)
    _turn(own)
    if direction == loop.ended:
        # It has turned again since, or not at all: by less than the recorder notices, or this here does.
        _go(own, loop, turned)
        _turn(own)
    _go(own, loop, furthest)


@register_jitable
def _end_as_recorded(own: Any, loop: Any) -> None:
    """Let the way back end where its curve does, if that is near: what creeps goes on while a leg begins."""
    back, apart = own.direction[1], _apart(loop, own.direction[1])
    length = (KNOTS - 1.0) * apart
    off = (_begins(loop, back) + back * length - own.u[0]) * back
    if np.abs(off) < apart:
        own.x[0] = _first(loop, back) + _on_curve(loop, back, length - off)
        _meet(own, loop, 1, own.u[0], own.x[0])


@register_jitable
def _solve(own: Any, loop: Any, way: Any, u: Any, r: Any) -> float:
    """Voltage at which the displacement is r, on a way from u on; searched from knot to knot."""
    direction, first = own.direction[way], own.u[way]
    apart, here = _apart(loop, direction), _at(own, loop, way, u)
    for knot in range(int(min(np.abs(u - first) / apart, KNOTS - 1.0)) + 1, KNOTS):
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
    if loop.up.apart == 0.0 or direction == 0.0:
        return r
    if (r - own.x[now + 1]) * direction < 0.0:
        return _solve(own, loop, now + 1, u, r)
    while now > 1:
        # Beyond the loop that the present way closes goes the way before.
        met = own.u[now - 1]
        x = _at(own, loop, now, met)
        if (r - x) * direction <= 0.0:
            break
        r += _at(own, loop, now - 2, met) - x
        u, now = met, now - 2
    return _solve(own, loop, now, u, r)
