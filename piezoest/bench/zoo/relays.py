"""Preisach relays with a Gaussian density over half-width and place, cut off at the ends of the range.

A relay goes up as the voltage comes to its upper level and down as it falls to its lower one. Between two
turns the relays that switch fill a triangle of the plane, whose weight is taken from sums over a grid, with
linear interpolation. This is the limit of infinitely many relays, which moves without steps. Source: I. D.
Mayergoyz, Mathematical Models of Hysteresis, Springer 1991, ch. 1.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray
from piezoest.bench.zoo.loop import Loop
from piezoest.layout import COUNT, FIXED, MEASURED, NUMBER, Length, Record, numbers, record

MOST = 64  # turns that are remembered


@dataclass(frozen=True, slots=True, kw_only=True)
class Relays(Loop):
    """Relays with a Gaussian density over half-width and place."""

    low: float  # lowest level [V]
    high: float  # highest level [V]
    half_width: float  # mean of the relays' half-widths [V]
    half_width_spread: float  # [V]
    place: float  # mean of the middles of the relays [V]
    place_spread: float  # [V]
    levels: int = 300  # cells of the grid along each side
    weights: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        lines = np.linspace(self.low, self.high, self.levels + 1)
        v = 0.5 * (lines[1:] + lines[:-1])
        up, down = v[:, None], v[None, :]
        half, middle = 0.5 * (up - down), 0.5 * (up + down)
        weights = np.exp(
            -0.5 * ((half - self.half_width) / self.half_width_spread) ** 2
            - 0.5 * ((middle - self.place) / self.place_spread) ** 2
        )
        weights[half <= 0.0] = 0.0
        # All of them up: as much as the line does over the range.
        object.__setattr__(self, "weights", weights * ((self.high - self.low) / weights.sum()))

    def stage_settings(self) -> dict[str, Any]:
        """Numbers by name; `sums` holds, row by row, the weight of all cells below and left of a corner."""
        sums = np.zeros((self.levels + 1, self.levels + 1))
        sums[1:, 1:] = self.weights.cumsum(axis=0).cumsum(axis=1)
        own = {name: getattr(self, name) for name in ("gain", "share", "low", "high", "levels")}
        return {**own, "sums": sums.ravel()}

    def stage_layouts(self, settings: dict[str, Any]) -> tuple[Record, Record]:
        """Layouts of state: turns and the weight that is up at each; and settings."""
        state = record(
            __name__, count=COUNT, at_rest=NUMBER,
            turns=numbers(MOST, kind=MEASURED), up=numbers(MOST, kind=NUMBER),
        )  # fmt: skip
        corners = numbers(Length("corners", len(settings["sums"])), kind=FIXED)
        names = {name: FIXED for name in settings if name != "sums"}
        return state, record(**names, sums=corners)


@register_jitable
def _sum(settings: Any, up: Any, down: Any) -> float:
    """Weight of the relays with levels below these."""
    n, spacing = int(settings.levels), (settings.high - settings.low) / settings.levels
    a, b = (up - settings.low) / spacing, (down - settings.low) / spacing
    i, j = min(max(int(a), 0), n - 1), min(max(int(b), 0), n - 1)
    a, b, corner = a - i, b - j, i * (n + 1) + j
    below = (1.0 - b) * settings.sums[corner] + b * settings.sums[corner + 1]
    above = (1.0 - b) * settings.sums[corner + n + 1] + b * settings.sums[corner + n + 2]
    return (1.0 - a) * below + a * above


@register_jitable
def _between(settings: Any, one: Any, other: Any) -> float:
    """Weight of the relays that switch on the way from one voltage to another; negative on the way down."""
    # Below the diagonal of the square between them there are none.
    square = _sum(settings, one, one) - _sum(settings, one, other)
    square += _sum(settings, other, other) - _sum(settings, other, one)
    return square if other > one else -square


@register_jitable
def deform(own: Any, settings: Any, u: Any) -> Any:
    """Displacement without offset after the next voltage; zero at rest, having come from below."""
    turns, up = own.turns, own.up
    if own.count == 0.0:
        own.at_rest = _between(settings, settings.low, 0.0)
        turns[0], up[0], turns[1], up[1], own.count = settings.low, 0.0, 0.0, own.at_rest, 2.0
    n, v = int(own.count), min(max(u, settings.low), settings.high)
    way = v - turns[n - 1]
    if way != 0.0:
        if n == 1 or way * (turns[n - 1] - turns[n - 2]) < 0.0:
            # Without room the smallest loop is forgotten, with both its ends.
            n = n + 1 if n < MOST else MOST - 1
        # A loop that the voltage has passed is wiped out with both its ends.
        while n >= 3 and way * (v - turns[n - 3]) >= 0.0:
            n -= 2
        turns[n - 1] = v
        up[n - 1] = up[n - 2] + _between(settings, turns[n - 2], v) if n > 1 else 0.0
        own.count = n
    return settings.gain * (u + settings.share * (up[n - 1] - own.at_rest))
