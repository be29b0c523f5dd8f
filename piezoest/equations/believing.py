"""Plausible readings: no spikes, no jumps of the sensor, no readings that stand still.

Rules of this library: a voltage explains a change of its travel times the slope of (2) or (12).
"""

from typing import Any

from piezoest.compile import inlined
from piezoest.layout import AMOUNT, COUNT, DISTANCE, record

# Readings seen, their usual change [µm], the voltage's travel since the reading last changed [V].
BELIEF = record(seen=COUNT, usual_step=DISTANCE, same=AMOUNT)

# A change is believed up to so many usual ones, plus what so many times the slope explains.
BELIEVED_STEPS, BELIEVED_SLOPES = 20.0, 3.0
# A reading that is the same to the last bit is believed for this fraction of a swing: coarse converters
# repeat themselves, saturated and dead ones do not stop.
STANDS_STILL = 5e-3


@inlined
def stands_still(belief: Any, dx: Any, travel: Any, swing: Any) -> Any:
    """Whether the reading is exactly constant although the voltage has travelled far."""
    return dx == 0.0 and belief.same + travel > STANDS_STILL * swing


@inlined
def believable(belief: Any, dx: Any, slope: Any, travel: Any, warm_up: Any) -> Any:
    """Whether a change `dx` over a `travel` is plausible; learns from plausible changes."""
    limit = BELIEVED_STEPS * belief.usual_step + BELIEVED_SLOPES * slope * travel
    if abs(dx) > limit and belief.seen >= warm_up:
        return False
    believe(belief, dx, travel, warm_up)
    return True


@inlined
def believe(belief: Any, dx: Any, travel: Any, warm_up: Any) -> None:
    """Learn from a change that is plausible, or that lasts: a single one makes no other of its size usual."""
    belief.same = (belief.same + travel) * (dx == 0.0)
    belief.seen += 1.0
    belief.usual_step += (abs(dx) - belief.usual_step) / min(belief.seen, warm_up)
