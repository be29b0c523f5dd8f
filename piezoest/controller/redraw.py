"""When the line is drawn again, and how a change of model is paid.

A sudden change would shake the stage: the difference is owed, and paid while the reference travels.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import driving
from piezoest.controller import line as lines
from piezoest.controller import readings as reading

# A change of model is also paid at rest: this fraction of it in the time of a doubling.
PAID_IN_TIME = 0.25
# Before so many legs the line follows the recent readings: at least those of this fraction of the last leg.
YOUNG, LEAST_MEMORY = 2.0, 0.1
# It takes at least so many times the time of a doubling to follow, because the peak of a resonance may be
# fifty times its gain; at least so many times the delay of the stage; and a block, for what was wrong in it
# shows at its end.
SLOW, LATE = 2.5, 4.0


@register_jitable
def is_young(state: Any) -> bool:
    """Whether the line rests on too few legs to wait for the next turn."""
    return state.line.legs < YOUNG


@register_jitable
def _slow(state: Any, settings: Any) -> float:
    """Least number of samples in which the line follows the readings."""
    return max(SLOW * settings.doubling, LATE * (state.gap + state.start.lag), state.block)


@register_jitable
def memory(state: Any, settings: Any) -> float:
    """About how many samples a leg takes: what the recent readings look back over."""
    reference = state.reference
    if is_young(state):
        return max(reference.count, LEAST_MEMORY * reference.usual, _slow(state, settings) / reading.RECENT)
    return max(reference.usual, state.travel.usual)


@register_jitable
def kept(state: Any, settings: Any, moved: Any, swing: Any) -> float:
    """The fraction of what is owed that is left after one more sample of the reference."""
    left = driving.kept(state.reference, moved, swing) * (1.0 - PAID_IN_TIME / settings.doubling)
    if is_young(state) or state.railed > 0.0:
        left = max(left, 1.0 - 1.0 / _slow(state, settings))
    return left


@register_jitable
def draw(state: Any) -> None:
    """Draw the line again where the reference has turned; the change is owed."""
    line, travel, reference = state.line, state.travel, state.reference
    before = driving.line_z(state)
    if reference.turned_now == 0.0:
        lines.grow(line, np.abs(travel.furthest - travel.turned))
    elif state.readings.weak > 0.0 and reading.is_sure(state.readings):
        # The readings may have failed within this leg.
        lines.forget(line.now)
    else:
        lines.turn(line, -reference.direction, reference.leg)
        far = np.abs(state.r - lines.at(line, state.u)) > reference.swing
        if far and state.block > reference.usual:
            # Small legs may be flat, the way that is left is wide, and in a block nothing stops it.
            lines.steepen(line, state.u)
    state.owed += before - driving.line_z(state)


@register_jitable
def lean(state: Any, left: Any) -> None:
    """Let the corridor lean to where the line drifts; slowly, a fraction `left` of the way is left."""
    # Motion that does not repeat moves the line, too.
    drift = state.line.drift if state.reference.alike != 0.0 else 0.0
    state.lean = drift + (state.lean - drift) * left


@register_jitable
def follow(state: Any) -> None:
    """Move a line that is far off to the recent readings, which cannot wait for two legs."""
    before = driving.line_z(state)
    lines.follow(state.line, state.readings.recent)
    state.owed += before - driving.line_z(state)


@register_jitable
def hold(state: Any) -> None:
    """Return to the line before the last two turns: what came after may be wrong."""
    before = driving.line_z(state)
    lines.hold(state.line)
    state.owed += before - driving.line_z(state)


@register_jitable
def go_on(state: Any, settings: Any) -> None:
    """After a block, owe what it has changed, so that the voltage goes on from where it is."""
    if settings.minimum < state.u < settings.maximum:
        driving.stand_at_reference(state)
