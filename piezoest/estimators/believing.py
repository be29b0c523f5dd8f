"""Which readings a stage can have made: no spikes, no jumps of the sensor, no reading that stands still."""

from __future__ import annotations

from typing import Any

from piezoest._jit import unrolled

# Flat memory: readings seen since what is usual was learnt anew, their usual change [µm], how far the
# voltage has travelled since the reading last changed [V].
SEEN, USUAL_STEP, SAME, STATE = range(4)

# A change is believed up to so many usual ones, plus what so many times the slope explains.
BELIEVED_STEPS, BELIEVED_SLOPES = 20.0, 3.0
# A reading that is the same to the last bit is believed for this part of a swing: coarse converters
# repeat themselves, saturated and dead ones do not stop.
STANDS_STILL = 5e-3


@unrolled
def stands_still(memory: Any, dx: Any, travel: Any, swing: Any) -> Any:
    """Whether the reading has not changed by a bit while the voltage travelled too far for that."""
    return dx == 0.0 and memory[SAME] + travel > STANDS_STILL * swing


@unrolled
def believable(memory: Any, dx: Any, slope: Any, travel: Any, warm_up: Any) -> Any:
    """Whether a change `dx` over a `travel` is one that the stage can make; learns from what is."""
    limit = BELIEVED_STEPS * memory[USUAL_STEP] + BELIEVED_SLOPES * slope * travel
    if abs(dx) > limit and memory[SEEN] >= warm_up:
        return False
    memory[SAME] = (memory[SAME] + travel) * (dx == 0.0)
    memory[SEEN] += 1.0
    memory[USUAL_STEP] += (abs(dx) - memory[USUAL_STEP]) / min(memory[SEEN], warm_up)
    return True
