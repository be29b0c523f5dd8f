"""The voltage that a late reading answers: readings come after what a delay or a lag holds back.

The line through voltages and readings of the same samples would be too flat where readings are late, and
beside its place; from a quarter of a period on it would point the wrong way.
"""

from typing import Any

from numba.extending import register_jitable

from piezoest.layout import MEASURED, numbers, record, whole

# Voltages that are remembered.
MOST = 32
# The last voltages, where the last one stands, and the one that the present reading answers.
LATE = record(u=numbers(MOST, kind=MEASURED), at=whole(0.0, MOST - 1.0), answered=MEASURED)


@register_jitable
def remember(late: Any, start: Any, u: Any) -> None:
    """Remember a voltage that was written, and find the one that is answered, at most the oldest one.

    A stage that was late at the start because it is slow to slew is not late on slower ways.
    """
    late.at = late.at + 1.0 if late.at < MOST - 1.0 else 0.0
    late.u[int(late.at)] = u
    lag = int(min(start.lag, MOST - 1.0) + 0.5) if start.fastest == 0.0 else 0
    place = int(late.at) - lag
    late.answered = late.u[place if place >= 0 else place + MOST]
