"""Where the loop is centred, from levels: the mean of x less the model's over whole periods.

The derivative form sees the offset through |du| only, which takes a good sensor; a level needs no derivative.
Over a whole period (two swings of the voltage) what the model misses of the loop's shape cancels.
"""

from typing import Any

from piezoest.compile import inlined
from piezoest.equations import coleman_hodgdon as equations
from piezoest.layout import COUNT, NUMBER, record

SUMS = record(samples=COUNT, x=NUMBER, u=NUMBER, w_h=NUMBER)
# w_h for b = 1 µm/V [V]; turns so far; sums over the swing at hand, over the last one, and over the last two
# that were whole.
LEVEL = record(w_h=NUMBER, turns=COUNT, now=SUMS, last=SUMS, period=SUMS)

# The first way to a turning point is no swing; two whole ones follow it.
ENOUGH_TURNS = 3.0


@inlined
def move(level: Any, du: Any, a: Any) -> None:
    """Follow a change of voltage."""
    level.w_h = equations.hysteresis_step(level.w_h, du, a, 1.0)


@inlined
def measure(level: Any, u: Any, x: Any) -> None:
    """Add a measured displacement to the sums."""
    level.now.samples += 1.0
    level.now.x += x
    level.now.u += u
    level.now.w_h += level.w_h


@inlined
def turn(level: Any) -> None:
    """Say that the voltage has turned: the swing at hand is over."""
    level.turns += 1.0
    now, last, period = level.now, level.last, level.period
    period.samples, period.x = last.samples + now.samples, last.x + now.x
    period.u, period.w_h = last.u + now.u, last.w_h + now.w_h
    last.samples, last.x, last.u, last.w_h = now.samples, now.x, now.u, now.w_h
    now.samples = now.x = now.u = now.w_h = 0.0


@inlined
def is_known(level: Any) -> Any:
    """Whether there was a whole period."""
    return level.turns >= ENOUGH_TURNS and level.period.samples > 0.0


@inlined
def offset(level: Any, b: Any, c: Any) -> Any:
    """Mean of x - (c u + w_h) over the last whole period [µm]."""
    total = level.period.x - c * level.period.u - b * level.period.w_h
    return total / level.period.samples
