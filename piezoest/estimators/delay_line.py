"""The delay between voltage and measured displacement, undone on the voltage's side."""

from typing import Any

from piezoest._checks import non_negative
from piezoest.compile import inlined
from piezoest.layout import ABSENT, FIXED, MEASURED, Field, Length, numbers, record, whole

# Most samples that a measurement may lag.
LONGEST = 1e6


def delay_line(delay: float) -> tuple[Field, dict[str, float]]:
    """Layout and start of the storage for a delay in samples, whole or fractional; absent without one."""
    if non_negative("delay", delay) > LONGEST:
        raise ValueError(f"delay must be at most {LONGEST:g} samples, got {delay:g}")
    if delay == 0.0:
        return ABSENT, {}
    size = int(delay) + 1
    voltages = numbers(Length("size", size), kind=MEASURED)
    layout = record(position=whole(-1.0, size - 1.0), fraction=FIXED, voltages=voltages)
    return layout, {"position": -1.0, "fraction": delay - int(delay)}


@inlined
def delayed(line: Any, u: Any) -> Any:
    """Voltage as the sensor sees it now, u the newest; before any has passed through, the first one."""
    if line is None:
        return u
    size = len(line.voltages)
    if line.position < 0.0:
        for i in range(size):
            line.voltages[i] = u
        line.position = 0.0
    position = int(line.position)
    following = position + 1
    if following == size:  # a division would take longer than all the rest
        following = 0
    older = line.voltages[position]
    line.voltages[position] = u
    line.position = following
    younger = line.voltages[following]
    return younger + line.fraction * (older - younger)
