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

    def stage_settings(self) -> dict[str, Any]:
        """Numbers by name; a loop that lags is subtracted from the line."""
        slope_up, slope_down = self.top * self.tilt / self.scale, self.bottom * self.tilt / self.scale
        return {
            "gain": self.gain,
            "share": -self.share,
            "centre": self.centre,
            "half_bend": 0.5 * self.bend / self.scale,
            "rate_up": self.rate_up,
            "rate_down": self.rate_down,
            "top": self.top - slope_up * self.centre,
            "slope_up": slope_up,
            "bottom": -self.bottom - slope_down * self.centre,
            "slope_down": slope_down,
        }


@register_jitable
def _towards(h: Any, u_0: Any, u: Any, level: Any, slope: Any, rate: Any) -> Any:
    """Exact h after a monotone change from u_0 to u, for dh/d|u| = rate (level + slope u - h)."""
    behind = (slope if u > u_0 else -slope) / rate
    return level + slope * u - behind + (h - level - slope * u_0 + behind) * np.exp(-rate * abs(u - u_0))


@register_jitable
def deform(own: Any, settings: Any, u: Any) -> Any:
    """Displacement without offset after the next voltage."""
    if u > own.u:
        own.h = _towards(own.h, own.u, u, settings.top, settings.slope_up, settings.rate_up)
    elif u < own.u:
        own.h = _towards(own.h, own.u, u, settings.bottom, settings.slope_down, settings.rate_down)
    own.u = u
    v = u - settings.centre
    bent = settings.half_bend * (v * v - settings.centre * settings.centre)
    return settings.gain * (u + bent + settings.share * own.h)
