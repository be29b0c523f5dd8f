"""The voltage and the reference that a late reading answers.

A line through the voltages and late readings of the same samples would be too flat and shifted; from a
quarter of a period on its sign would be wrong. For feedback, the motion of the reference since then would
look like an error.
"""

from typing import Any

from numba.extending import register_jitable

from piezoest.layout import MEASURED, numbers, record, whole

# Samples that are remembered.
MOST = 32
# The last voltages and references, the place of the newest ones, and those that the present reading answers;
# the voltage that the reading before answers, and so about the middle one of three.
LATE = record(
    u=numbers(MOST, kind=MEASURED), r=numbers(MOST, kind=MEASURED), at=whole(0.0, MOST - 1.0),
    answered=MEASURED, answered_r=MEASURED, before=MEASURED,
)  # fmt: skip


@register_jitable
def rest(late: Any, u: Any, r: Any) -> None:
    """Stage and reference have rested for longer than any delay."""
    for i in range(MOST):
        late.u[i], late.r[i] = u, r
    late.before, late.answered, late.answered_r = u, u, r


@register_jitable
def remember(late: Any, start: Any, u: Any, r: Any) -> None:
    """Remember what was written and wanted, and find what is answered, at most the oldest one."""
    late.at = late.at + 1.0 if late.at < MOST - 1.0 else 0.0
    late.u[int(late.at)], late.r[int(late.at)] = u, r
    # If a stage that slews was late at the start, it is not late on slower ways.
    lag = int(min(start.lag, MOST - 1.0) + 0.5) if start.fastest == 0.0 else 0
    place = int(late.at) - lag
    place = place if place >= 0 else place + MOST
    late.before = late.answered
    late.answered, late.answered_r = late.u[place], late.r[place]
