"""A decaying sweep of the voltage, which erases what hysteresis remembers.

The voltage goes from one extreme to the other, each time a little less far, until nothing is left.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import start as starts
from piezoest.layout import AMOUNT, COUNT, MEASURED, NUMBER, record

# Middle and signed amplitude of the sweep; its legs, and the present one (0: the way to the sweep); samples
# of a leg, samples so far; both ends of the leg.
HOMING = record(
    middle=MEASURED, amplitude=NUMBER, legs=AMOUNT, leg=COUNT, length=AMOUNT, gone=COUNT,
    from_u=MEASURED, target=MEASURED,
)  # fmt: skip

# Largest fraction of a cycle in a sample; most cycles; the fraction of the slew rate that is used.
FASTEST, MOST, SLEW = 1.0 / 16.0, 1e4, 0.9
# The steepest slope of a smooth way, relative to a straight one; a voltage that lags moves at most so many
# times as fast.
STEEPEST, CATCH_UP = 1.5, 2.0


@register_jitable
def begin(homing: Any, settings: Any, u: Any, amplitude: Any, turn: Any, cycles: Any) -> bool:
    """Begin at a voltage, `turn` of a cycle each sample; False, and nothing is changed, if it cannot be."""
    low, high = settings.minimum, settings.maximum
    if not (0.0 < amplitude <= 0.5 * (high - low) and 0.0 < turn <= FASTEST and 1.0 <= cycles <= MOST):
        return False
    rest = min(max(0.0, low), high)
    has_room = low <= rest - amplitude and rest + amplitude <= high
    homing.middle = rest if has_room else 0.5 * (low + high)
    homing.amplitude = amplitude if u >= homing.middle else -amplitude
    homing.legs = 2.0 * cycles
    least = 2.0 * amplitude * STEEPEST / (SLEW * settings.largest_step)
    homing.length = max(0.5 / turn, least)
    homing.from_u, homing.target = u, homing.middle + homing.amplitude
    # The way to the sweep is no faster than the sweep.
    homing.length *= max(1.0, np.abs(homing.target - u) / (2.0 * amplitude))
    homing.leg = homing.gone = 0.0
    return True


@register_jitable
def voltage(homing: Any, u: Any) -> float:
    """The next voltage, after one that was written."""
    wanted = starts.smooth(homing.from_u, homing.target, (homing.gone + 1.0) / homing.length)
    most = CATCH_UP * STEEPEST * np.abs(homing.target - homing.from_u) / homing.length
    return min(max(wanted, u - most), u + most)


@register_jitable
def follow(homing: Any) -> bool:
    """A voltage was written; whether it was the last one."""
    homing.gone += 1.0
    if homing.gone < homing.length:
        return False
    if homing.leg == 0.0:
        homing.length /= max(1.0, np.abs(homing.target - homing.from_u) / (2.0 * np.abs(homing.amplitude)))
    homing.leg += 1.0
    homing.gone = 0.0
    homing.from_u = homing.target
    homing.amplitude = -homing.amplitude
    homing.target = homing.middle + homing.amplitude * max(0.0, 1.0 - homing.leg / homing.legs)
    return homing.leg >= homing.legs + 1.0
