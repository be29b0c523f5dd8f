"""The delay between voltage and measured displacement, undone on the voltage's side."""

from __future__ import annotations

from typing import Any

import numpy as np

from piezoest._checks import FloatArray, non_negative
from piezoest._jit import unrolled

# Most samples that a measurement may lag.
LONGEST = 1e6


def delay_line(delay: float) -> tuple[float, FloatArray]:
    """Fraction of a sample and new storage for a delay in samples, whole or fractional."""
    if non_negative("delay", delay) > LONGEST:
        raise ValueError(f"delay must be at most {LONGEST:g} samples, got {delay:g}")
    delay = float(delay)
    storage = np.zeros(int(delay) + 2)
    storage[0] = -1.0
    return delay - int(delay), storage


@unrolled
def delayed(line: Any, fraction: float, u: Any) -> Any:
    """Voltage as the sensor sees it now, u the newest; `line` = (position, storage), from its end.

    Before the first voltages have passed through, the first one counts.
    """
    length = line.size - 1
    if length == 1 and fraction == 0.0:
        return u
    if line[0] < 0.0:
        for i in range(length):
            line[1 + i] = u
        line[0] = 0.0
    position = int(line[0])
    following = position + 1
    if following == length:  # a division would take longer than all the rest
        following = 0
    older = line[1 + position]
    line[1 + position] = u
    line[0] = following
    younger = line[1 + following]
    return younger + fraction * (older - younger)
