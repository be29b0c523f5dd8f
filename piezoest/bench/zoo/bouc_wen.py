"""The Bouc-Wen family: dh = du (1 - |h/width|^power (gamma + beta sign(h du))).

Y. K. Wen, Method for random vibration of hysteretic systems, J. Eng. Mech. Div. 102 (1976) 249-263; of
piezos: T. S. Low, W. Guo, J. Microelectromech. Syst. 4 (1995) 230-237. With beta + gamma = 1 the loop
saturates at `width`. It depends on the voltage alone, not on time; it does not wipe out.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba.extending import register_jitable

from piezoest.bench.zoo.loop import Loop
from piezoest.layout import MEASURED, NUMBER, Kind

# Longest step of the integration, relative to the width: the fourth order leaves 1e-7 of the loop.
LONGEST = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class BoucWen(Loop):
    """Bouc-Wen loop, with beta = (1 + fullness)/2 and gamma = (1 - fullness)/2."""

    width: float  # where h saturates [V]
    power: float = 1.0  # how sharp the knee is, 1 or more
    fullness: float = 0.5  # how round the loop is, within [-1, 1]

    state: ClassVar[dict[str, Kind]] = {"u": MEASURED, "q": NUMBER}  # last voltage and h/width


@register_jitable
def _slope(p: Any, settings: Any) -> Any:
    """Slope of p = h sign(du)/width over the travel."""
    sign = 1.0 if p > 0.0 else -1.0
    beta, gamma = 0.5 * (1.0 + settings.fullness), 0.5 * (1.0 - settings.fullness)
    return 1.0 - abs(p) ** settings.power * (beta * sign + gamma)


@register_jitable
def deform(own: Any, settings: Any, u: Any) -> Any:
    """Displacement without offset after the next voltage; a loop that lags is subtracted from the line."""
    travel = abs(u - own.u) / settings.width
    if travel > 0.0:
        sign = 1.0 if u > own.u else -1.0
        p = own.q * sign
        steps = int(np.ceil(travel / LONGEST))
        d = travel / steps
        for _ in range(steps):
            k_1 = _slope(p, settings)
            k_2 = _slope(p + 0.5 * d * k_1, settings)
            k_3 = _slope(p + 0.5 * d * k_2, settings)
            k_4 = _slope(p + d * k_3, settings)
            p = p + d * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4) / 6.0
        own.q = p * sign
        own.u = u
    return settings.gain * (u - settings.share * settings.width * own.q)
