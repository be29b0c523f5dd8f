"""Where the loop is centred, from levels: the mean of x less the model's over whole periods.

The derivative form sees the offset through |du| only, which takes a good sensor; a level needs no
derivative. Over a whole period (two swings of the voltage) what the model misses of the loop's
shape cancels.
"""

from __future__ import annotations

from typing import Any

from piezoest._jit import unrolled
from piezoest.equations import coleman_hodgdon as equations

# Flat state: w_h for b = 1 µm/V [V]; turns so far; sums over the swing at hand, over the last one, and
# over the last two that were whole, each of: samples, x, u, w_h.
PLACE, TURNS, NOW, LAST, PERIOD, STATE = 0, 1, 2, 6, 10, 14

# The first way to a turning point is no swing; two whole ones follow it.
ENOUGH_TURNS = 3.0


@unrolled
def move(level: Any, du: Any, a: Any) -> None:
    """Take a change of voltage; `level` is updated in place, as by all below."""
    level[PLACE] = equations.hysteresis_step(level[PLACE], du, a, 1.0)


@unrolled
def measure(level: Any, u: Any, x: Any) -> None:
    """Take a measured displacement."""
    level[NOW] += 1.0
    level[NOW + 1] += x
    level[NOW + 2] += u
    level[NOW + 3] += level[PLACE]


@unrolled
def turn(level: Any) -> None:
    """Say that the voltage has turned: the swing at hand is over."""
    level[TURNS] += 1.0
    for i in range(4):
        level[PERIOD + i] = level[LAST + i] + level[NOW + i]
        level[LAST + i] = level[NOW + i]
        level[NOW + i] = 0.0


@unrolled
def is_known(level: Any) -> Any:
    """Whether there was a whole period."""
    return level[TURNS] >= ENOUGH_TURNS and level[PERIOD] > 0.0


@unrolled
def offset(level: Any, b: Any, c: Any) -> Any:
    """Mean of x - (c u + w_h) over the last whole period [µm]."""
    total = level[PERIOD + 1] - c * level[PERIOD + 2] - b * level[PERIOD + 3]
    return total / level[PERIOD]
