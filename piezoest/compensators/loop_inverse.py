"""The compiled inverse of a Coleman-Hodgdon model, or of a line, sample by sample."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest._jit import UNCOUNTED, compiled
from piezoest.compensators import corridor
from piezoest.compensators.layout import (
    BY_PATH,
    CORRIDOR,
    DECAY,
    INTEGRATED,
    MISSED,
    OFFSET,
    OWED,
    PATH,
    SAMPLES,
    VOLTAGE,
    W_H,
    A,
    B,
    C,
)
from piezoest.compensators.voltage import BEYOND, limited, remember_voltage
from piezoest.equations import coleman_hodgdon as equations
from piezoest.equations import recent_path
from piezoest.equations.integrators import bogacki_shampine


@register_jitable
def voltage(state: Any, config: Any, r: Any) -> Any:
    """Voltage for the next reference sample; the state follows the voltage really given out."""
    state[SAMPLES] += 1.0
    u = state[VOLTAGE]
    if not np.abs(r) < WILDEST:
        state[MISSED] += 1.0
        return u
    a, b, c = config[A], config[B], config[C]
    w_h = state[W_H]
    state[OWED] *= config[DECAY]
    dr = r - state[OWED] - (c * u + w_h + config[OFFSET])
    if config[INTEGRATED] != 0.0:
        w_next = bogacki_shampine(equations.inverse_rate, w_h, 1.0, (dr, a, b, c))
        wanted = u + (dr - (w_next - w_h)) / c
    else:
        wanted = u + equations.inverse_increment(w_h, dr, a, b, c)
        w_next = equations.hysteresis_step(w_h, wanted - u, a, b)
    given = limited(state, config, r, wanted)
    if given != wanted:
        w_next = equations.hysteresis_step(w_h, given - u, a, b)
    state[W_H] = w_next
    remember_voltage(state, given)
    return given


@register_jitable
def change_model(state: Any, config: Any, a: Any, b: Any, c: Any, offset: Any) -> None:
    """Take another model without a bump: its w_h is found, the difference owed.

    A model that leaves no number there is not taken.
    """
    limit = b / a
    if not np.abs(limit) + np.abs(1.0 / c) < BEYOND:
        return
    expected = config[C] * state[VOLTAGE] + state[W_H] + config[OFFSET] + state[OWED]
    if config[BY_PATH] != 0.0:
        # What the path does not tell stays: the same model changes nothing.
        untold = 0.0
        if config[B] > 0.0:
            untold = state[W_H] / config[B] - recent_path.hysteresis(state, PATH)
        if b > 0.0:
            recent_path.take_up(state, PATH, a)
        place = a * (recent_path.hysteresis(state, PATH) + untold)
    else:
        place = state[W_H] * config[A] / config[B] if config[B] > 0.0 else 0.0
    place = min(max(place, -1.0), 1.0)
    config[A] = a
    config[B] = b
    config[C] = c
    config[OFFSET] = offset
    state[W_H] = place * limit
    state[OWED] = expected - (c * state[VOLTAGE] + state[W_H] + offset)
    corridor.hand_over(state, CORRIDOR)


@compiled("f8(f8[::1], f8[::1], f8)", **UNCOUNTED)
def step(state: Any, config: Any, r: float) -> Any:
    """Voltage for one sample of the reference."""
    return voltage(state, config, r)


@compiled("void(f8[::1], f8[::1], f8[::1], f8[::1])", **UNCOUNTED)
def run(state: Any, config: Any, r: Any, u: Any) -> None:
    """Voltages `u` for a whole reference `r`."""
    for k in range(r.size):
        u[k] = voltage(state, config, r[k])


@compiled("void(f8[::1], f8[::1], f8, f8, f8, f8)")
def change(state: Any, config: Any, a: float, b: float, c: float, offset: float) -> None:
    """Compiled `change_model`."""
    change_model(state, config, a, b, c, offset)
