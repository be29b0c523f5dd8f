"""True relays on a grid over the Preisach plane, with a Gaussian density that does not separate into plays.

A relay (i, j) goes up as the voltage comes to level i and down as it falls below level j < i. Relays of
one row i are up below a column m[i], as falling voltage switches whole columns: the state is m alone, and
a sample costs what it switches. Source: I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991,
ch. 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray
from piezoest.bench.zoo.loop import Loop
from piezoest.layout import COUNT, FIXED, NUMBER, Length, Record, numbers, record


@dataclass(frozen=True, slots=True, kw_only=True)
class Relays(Loop):
    """Relays with a Gaussian density over half-width and place."""

    low: float  # lowest level [V]
    high: float  # highest level [V]
    half_width: float  # mean of the relays' half-widths [V]
    half_width_spread: float  # [V]
    place: float  # mean of the middles of the relays [V]
    place_spread: float  # [V]
    levels: int = 500  # grid lines
    weights: FloatArray = field(init=False, repr=False, compare=False)

    wipes_out = True

    def __post_init__(self) -> None:
        v = np.linspace(self.low, self.high, self.levels)
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
        """Numbers by name; `rows` holds, row by row, the sums of the first m weights."""
        rows = np.zeros((self.levels, self.levels + 1))
        np.cumsum(self.weights, axis=1, out=rows[:, 1:])
        spacing = (self.high - self.low) / (self.levels - 1)
        below = int(np.floor(-self.low / spacing)) + 1
        at_rest = sum(rows[i, i] for i in range(min(max(below, 0), self.levels)))
        return {
            "gain": self.gain,
            "share": self.share,
            "low": self.low,
            "spacing": spacing,
            "at_rest": at_rest,
            "rows": rows.ravel(),
        }

    def stage_layouts(self, settings: dict[str, Any]) -> tuple[Record, Record]:
        """Layouts of state, rows that are up to a column, and settings."""
        state = record(
            __name__, level=COUNT, sum=NUMBER, m=numbers(Length("levels", self.levels), kind=COUNT)
        )
        cells = numbers(Length("cells", len(settings["rows"])), kind=FIXED)
        names = {name: FIXED for name in settings if name != "rows"}
        return state, record(**names, rows=cells)


@register_jitable
def _set(own: Any, rows: Any, i: Any, m: Any) -> None:
    """Put the first m relays of row i up, the others down."""
    start = i * (len(own.m) + 1)
    own.sum = own.sum + rows[start + m] - rows[start + int(own.m[i])]
    own.m[i] = m


@register_jitable
def deform(own: Any, settings: Any, u: Any) -> Any:
    """Displacement without offset after the next voltage; zero at rest, having come from below."""
    n, last = len(own.m), int(own.level)
    level = min(max(int(np.floor((u - settings.low) / settings.spacing)) + 1, 0), n)
    rows = settings.rows
    for i in range(last, level):
        _set(own, rows, i, i)
    if level < last:
        for i in range(level + 1, n):
            # Rows further up were up earlier, and have seen lower voltages since.
            if own.m[i] <= level:
                break
            _set(own, rows, i, level)
    own.level = level
    return settings.gain * (u + settings.share * (own.sum - settings.at_rest))
