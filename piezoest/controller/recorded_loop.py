"""The recorded loop as a model: the last measured curve for rising and for falling voltage.

If the voltage repeats a loop, the displacement repeats as well, whatever the law of the hysteresis is:
repeated motion needs no model. If the voltage turns elsewhere than in the record, the displacement there is
not on the curve of the new direction. This difference decreases linearly with the voltage, down to zero at
the end of that curve, where all loops meet. The functions are those of an inverse, see
`piezoest.compensators.inverse_kernel`.

Source: the wiping-out property, I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.layout import AMOUNT, MEASURED, NUMBER, SIGN, numbers, record

KNOTS = 17
# Displacements at evenly spaced voltages, from the lowest on; `apart` is zero while nothing is known.
CURVE = record(lowest=MEASURED, apart=AMOUNT, x=numbers(KNOTS, kind=MEASURED))
# Both curves; direction of the last recorded leg, voltage and displacement where it ended.
LOOP = record(up=CURVE, down=CURVE, ended=SIGN, end_u=MEASURED, end_x=MEASURED)
# Direction of travel, voltage of the last turn, and how far the displacement was from the curve there.
STATE = record(__name__, direction=SIGN, turned=MEASURED, off=NUMBER)
LAYOUTS = STATE, LOOP  # of state and settings

# Least slope of a curve. The difference `off` is lost over a way of at least GENTLE times itself, and of at
# least this part of the curve; 1/GENTLE is less than STEEP, so the displacement always goes with the voltage.
STEEP, GENTLE, SHORTEST = 0.1, 20.0, 0.25


@register_jitable
def _on_curve(curve: Any, u: Any) -> float:
    """Displacement on a curve, and beyond its ends on its first or last piece."""
    if curve.apart == 0.0:
        return u
    place = (u - curve.lowest) / curve.apart
    i = int(min(max(place, 0.0), KNOTS - 2.0))
    return curve.x[i] + (place - i) * (curve.x[i + 1] - curve.x[i])


@register_jitable
def _at(curve: Any, direction: Any, turned: Any, off: Any, u: Any) -> float:
    """Displacement on the way from a turn to the end of a curve."""
    length = (KNOTS - 1.0) * curve.apart
    end = curve.lowest + length if direction > 0.0 else curve.lowest
    way = max((end - turned) * direction, GENTLE * np.abs(off), SHORTEST * length)
    left = max(1.0 - np.abs(u - turned) / way, 0.0) if way > 0.0 else 0.0
    return _on_curve(curve, u) + off * left


@register_jitable
def _stands(own: Any, loop: Any, u: Any) -> float:
    """Displacement at a voltage of the present way."""
    if own.direction > 0.0:
        return _at(loop.up, 1.0, own.turned, own.off, u)
    return _at(loop.down, -1.0, own.turned, own.off, u)


@register_jitable
def expected(state: Any, settings: Any) -> float:
    """Displacement at the last voltage."""
    return _stands(state.inverse, settings.inverse, state.voltage)


@register_jitable
def _off(loop: Any, direction: Any, u: Any, x: Any) -> float:
    """How far a turn at u, where the displacement is x, is from the curve that follows."""
    return x - (_on_curve(loop.up, u) if direction > 0.0 else _on_curve(loop.down, u))


@register_jitable
def _turn(own: Any, loop: Any, direction: Any, u: Any) -> None:
    """Turn at a voltage."""
    here = _stands(own, loop, u)
    own.direction, own.turned, own.off = direction, u, _off(loop, direction, u, here)


@register_jitable
def follow(state: Any, settings: Any, wanted: Any, given: Any) -> None:
    """Turn where the voltage does."""
    way = given - state.voltage
    if way != 0.0 and way * state.inverse.direction <= 0.0:
        _turn(state.inverse, settings.inverse, np.sign(way), state.voltage)


@register_jitable
def place(state: Any, settings: Any) -> None:
    """Go on from where the last recorded leg has ended."""
    own, loop = state.inverse, settings.inverse
    direction, turned = own.direction, own.turned
    if direction == 0.0:
        return
    own.direction, own.turned = -loop.ended, loop.end_u
    own.off = _off(loop, own.direction, loop.end_u, loop.end_x)
    if direction == loop.ended:
        # It has turned again since, by less than the recorder notices.
        _turn(own, loop, direction, turned)


@register_jitable
def _solve(curve: Any, direction: Any, turned: Any, off: Any, u: Any, r: Any) -> float:
    """Voltage at which the displacement is r, in a direction from u; searched from knot to knot."""
    here = _at(curve, direction, turned, off, u)
    if curve.apart == 0.0:
        return u + r - here
    first = curve.lowest if direction > 0.0 else curve.lowest + (KNOTS - 1.0) * curve.apart
    passed = int(min(max((u - first) * direction / curve.apart, 0.0), KNOTS - 1.0))
    for knot in range(passed + 1, KNOTS + 1):
        inside = knot < KNOTS - 1
        to = first + direction * knot * curve.apart if inside else u + direction * KNOTS * curve.apart
        there = _at(curve, direction, turned, off, to)
        if not inside or (there - r) * direction >= 0.0:
            return u + (r - here) / (there - here) * (to - u) if there != here else u
        u, here = to, there
    return u + (r - here)


@register_jitable
def wanted(state: Any, settings: Any, r: Any) -> float:
    """Voltage that moves the displacement to r."""
    own, loop, u = state.inverse, settings.inverse, state.voltage
    here = expected(state, settings)
    direction = 1.0 if r >= here else -1.0
    turned, off = own.turned, own.off
    if direction != own.direction:
        turned, off = u, _off(loop, direction, u, here)
    if direction > 0.0:
        return _solve(loop.up, 1.0, turned, off, u, r)
    return _solve(loop.down, -1.0, turned, off, u, r)
