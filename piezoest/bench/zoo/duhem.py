"""An asymmetric Duhem family: the loop goes one way up, another way down.

With rising voltage h tends to top (1 + tilt v) at the rate rate_up, with falling voltage to -bottom (1 -
tilt v) at rate_down, v = (u - centre)/scale; the line is bent by v². Source of the kind: M. Brokate, J.
Sprekels, Hysteresis and Phase Transitions, Springer 1996, ch. 5. Each monotone piece is solved exactly; it
does not wipe out.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba.extending import register_jitable

from piezoest.bench.zoo.loop import Loop
from piezoest.layout import MEASURED, NUMBER, Kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Duhem(Loop):
    """Duhem loop with slopes of its own up and down."""

    scale: float  # half of the voltage's range [V]
    centre: float  # its middle [V]
    rate_up: float  # how fast h tends to its branch up [1/V]
    rate_down: float  # and down
    top: float  # size of the two branches [V]
    bottom: float
    tilt: float = 0.0  # how much the branches grow over the range
    bend: float = 0.0  # change of the line's slope from the middle of the range to its end, relative

    state: ClassVar[dict[str, Kind]] = {"u": MEASURED, "h": NUMBER}  # last voltage and h


@register_jitable
def _towards(h: Any, u_0: Any, u: Any, level: Any, slope: Any, rate: Any) -> Any:
    """Exact h after a monotone change from u_0 to u, for dh/d|u| = rate (level + slope u - h)."""
    behind = (slope if u > u_0 else -slope) / rate
    return level + slope * u - behind + (h - level - slope * u_0 + behind) * np.exp(-rate * abs(u - u_0))


@register_jitable
def deform(own: Any, settings: Any, u: Any) -> Any:
    """Displacement without offset after the next voltage; a loop that lags is subtracted from the line."""
    rises = u > own.u
    if rises or u < own.u:
        size = settings.top if rises else settings.bottom
        slope = size * settings.tilt / settings.scale
        level = (size if rises else -size) - slope * settings.centre
        own.h = _towards(own.h, own.u, u, level, slope, settings.rate_up if rises else settings.rate_down)
    own.u = u
    v = u - settings.centre
    bent = 0.5 * settings.bend / settings.scale * (v * v - settings.centre * settings.centre)
    return settings.gain * (u + bent - settings.share * own.h)
