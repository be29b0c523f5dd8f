"""The zero of the readings has moved, as after a reset of the gauge: when that is followed."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import faults
from piezoest.controller import line as lines
from piezoest.controller import readings as reading

# Swings after which a moved zero is considered; is named, because late readings come back after a turn; and
# is followed if the reference has not moved with it.
OFF_FOR, MOVED_FOR, HELD_FOR = 0.3, 0.5, 24.0
# Readings with a moved zero have at least this slope relative to the line. If the reference has moved too,
# they are within so many swings of it, or closer to it than the line by this factor.
LEAST_SLOPE, NEAR_IT, NEARER = 0.2, 0.6, 0.5


@register_jitable
def follow(state: Any) -> None:
    """Follow a zero that has moved: at once if the reference has moved too, or the line is not sure."""
    readings, line = state.readings, state.line
    if readings.off < OFF_FOR:
        return
    recent = readings.recent
    jump = recent.mean_x - lines.at(line, recent.mean_u)
    slope = lines.slope(recent) / line.gain
    plain = 0.5 < slope < 2.0 and lines.explained(recent) > lines.EXPLAINED
    sure = reading.is_sure(readings)
    known = readings.fault == faults.NONE or readings.fault == faults.MOVED
    if not plain and (sure or not known or slope < LEAST_SLOPE):
        return
    miss = np.abs(readings.last - state.r)
    near = miss < NEAR_IT * np.abs(line.gain) * state.travel.swing
    # A reference to which the readings are closer than the line has moved with them.
    near = near or miss < NEARER * np.abs(lines.at(line, state.u) - state.r)
    # Otherwise the line stays for long, because the gauge may come back. Then the gauge is believed.
    if sure and not near and readings.off < HELD_FOR:
        if known and readings.off > MOVED_FOR:
            readings.fault = faults.MOVED
        return
    if plain and sure:
        state.zero += jump
        faults.notice(state, faults.MOVED)
    lines.forget(line.now)
    lines.forget_legs(line)
    line.centre += jump
    line.last_centre += jump
    line.held_centre += jump
    state.owed -= jump / state.unit
    readings.off = readings.spikes = 0.0
    if readings.fault == faults.MOVED:
        readings.fault = faults.NONE
