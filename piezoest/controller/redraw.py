"""When the line is fitted again, and how a change of model is paid.

What changes at one sample would shake the stage: the difference is owed, and paid on the way.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import driving, slots
from piezoest.controller import line as lines
from piezoest.controller.readings import RECENT

# At rest, too, a change of model is paid: this fraction of it in the time of a doubling.
PAID_IN_TIME = 0.25
# Before so many legs were seen the line follows the readings of late.
YOUNG = 2.0
# ... those of this leg so far, and of this fraction of the last one.
LEAST_MEMORY = 0.1
# It follows no faster than so many times the time of a doubling, twice: a resonance, whose peak may be fifty
# times its gain, must not be fed. And not faster than so many times what block and stage are late by.
SLOW, LATE = 2.5, 4.0


@register_jitable
def is_young(state: Any) -> bool:
    """Whether the line rests on too few legs to wait for the next turn."""
    return state.line.legs < YOUNG


@register_jitable
def _slow(state: Any, settings: Any) -> float:
    """Samples in which the line may follow the readings."""
    return max(SLOW * settings.doubling, LATE * (state.block + state.gap + state.start.lag))


@register_jitable
def memory(state: Any, settings: Any) -> float:
    """About how many samples a leg takes, for what readings show of late."""
    reference = state.reference
    if is_young(state):
        return max(reference.count, LEAST_MEMORY * reference.usual, _slow(state, settings) / RECENT)
    return max(reference.usual, state.travel.usual)


@register_jitable
def kept(state: Any, settings: Any, moved: Any, swing: Any) -> float:
    """The fraction of what is owed that is left after a travel of the reference and a sample."""
    left = driving.kept(state.reference, moved, swing) * (1.0 - PAID_IN_TIME / settings.doubling)
    if is_young(state) or state.railed > 0.0:
        left = max(left, 1.0 - 1.0 / _slow(state, settings))
    return left


@register_jitable
def pay(state: Any, settings: Any, moved: Any) -> None:
    """Pay what is owed."""
    left = kept(state, settings, moved, state.reference.swing)
    state.owed *= left
    slots.pay(state.candidates, left)


@register_jitable
def draw(state: Any) -> None:
    """Draw the line anew where the reference has turned; what that changes is owed."""
    line, travel, reference = state.line, state.travel, state.reference
    before = driving.line_z(state)
    if reference.turned_now != 0.0:
        lines.turn(line, -reference.direction, reference.leg)
    elif not lines.grow(line, np.abs(travel.furthest - travel.turned)):
        return
    state.owed += before - driving.line_z(state)


@register_jitable
def follow(state: Any) -> None:
    """Lay the line through the readings of late: two legs are too long to wait for where it is far off."""
    before = driving.line_z(state)
    lines.follow(state.line, state.readings.recent)
    state.owed += before - driving.line_z(state)


@register_jitable
def hold(state: Any) -> None:
    """Go back to the line that was known before the last turn: what came after may be wrong."""
    before = driving.line_z(state)
    lines.hold(state.line)
    state.owed += before - driving.line_z(state)


@register_jitable
def go_on(state: Any, settings: Any) -> None:
    """After a block: whatever it has changed is owed, so that the voltage goes on from where it is."""
    if not settings.minimum < state.u < settings.maximum:
        return
    driving.stand_at_reference(state)
