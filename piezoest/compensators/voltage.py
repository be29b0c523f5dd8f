"""What every compensator does with the voltage that its model asks for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.compensators import corridor
from piezoest.compensators.layout import (
    CORRIDOR,
    LARGEST_STEP,
    LIMITED_NOW,
    MAXIMUM,
    MEMORY,
    MINIMUM,
    PATH,
    SATURATED,
    SLEWED,
    VOLTAGE,
)
from piezoest.equations import recent_path
from piezoest.equations.turning_points import remember

# Beyond this a voltage is what the inverse of no stage asks for.
BEYOND = 1e100


@register_jitable
def limited(state: Any, config: Any, r: Any, wanted: Any) -> Any:
    """The voltage wanted, as far as corridor, slew rate and range allow it; a finite one."""
    u = state[VOLTAGE]
    if not np.abs(wanted) < BEYOND:
        wanted = u
    inside = corridor.kept(state, CORRIDOR, r, wanted)
    slewed = min(max(inside, u - config[LARGEST_STEP]), u + config[LARGEST_STEP])
    given = min(max(slewed, config[MINIMUM]), config[MAXIMUM])
    state[SLEWED] += slewed != inside
    state[SATURATED] += given != slewed
    state[LIMITED_NOW] = np.sign(wanted - given)
    corridor.follow(state, CORRIDOR, given, (given != inside) * 1.0)
    return given


@register_jitable
def remember_voltage(state: Any, given: Any) -> None:
    """Take a voltage given out into all that has a memory of it."""
    state[VOLTAGE] = given
    recent_path.follow(state, PATH, given)
    remember(state, MEMORY, given)
