"""The inverse of a Coleman-Hodgdon model, or of a line, sample by sample.

Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), (14)-(17), (C7), (C10).
`piezoest.compensators.inverse_kernel` says what each function is for.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.compile import inlined
from piezoest.equations import admissible, recent_path
from piezoest.equations import coleman_hodgdon as equations
from piezoest.equations.integrators import bogacki_shampine
from piezoest.layout import NUMBER, WORK, Record, record

# w_h [µm], and the one that goes with the voltage wanted.
STATE = record(__name__, w_h=NUMBER, following=WORK)
# Of the second form (2)-(4); b = 0 and any a is a line.
SETTINGS = record(a=NUMBER, b=NUMBER, c=NUMBER, offset=NUMBER)

# Beyond this a loop's width or the reciprocal of its slope is no number.
BEYOND = 1e100


def layouts(settings: dict[str, Any]) -> tuple[Record, Record]:
    """Layouts of ``state.inverse`` and ``settings.inverse``."""
    return STATE, SETTINGS


@inlined
def wanted(state: Any, settings: Any, r: Any) -> Any:
    """Voltage that moves the displacement to r."""
    u, own, model = state.voltage, state.inverse, settings.inverse
    a, b, c, w_h = model.a, model.b, model.c, own.w_h
    dr = r - (c * u + w_h + model.offset)
    if settings.integrated != 0.0:
        w_next = bogacki_shampine(equations.inverse_rate, w_h, 1.0, (dr, a, b, c))
        voltage = u + (dr - (w_next - w_h)) / c
    else:
        voltage = u + equations.inverse_increment(w_h, dr, a, b, c)
        w_next = equations.hysteresis_step(w_h, voltage - u, a, b)
    own.following = w_next
    return voltage


@inlined
def follow(state: Any, settings: Any, wanted: Any, given: Any) -> None:
    """Update w_h with the voltage."""
    own, model = state.inverse, settings.inverse
    if given == wanted:
        own.w_h = own.following
    else:
        own.w_h = equations.hysteresis_step(own.w_h, given - state.voltage, model.a, model.b)


@register_jitable
def expected(state: Any, settings: Any) -> Any:
    """Displacement at the last voltage [µm]."""
    return settings.inverse.c * state.voltage + state.inverse.w_h + settings.inverse.offset


@register_jitable
def place(state: Any, settings: Any) -> None:
    """Set w_h from the recent path of the voltage."""
    if settings.inverse.b > 0.0:
        recent_path.use_decay(state.path, settings.inverse.a)
    state.inverse.w_h = settings.inverse.b * recent_path.hysteresis(state.path)


@register_jitable
def change(state: Any, settings: Any, new: Any) -> bool:
    """Use new settings (a, b, c, offset); False if they leave no number."""
    own, model = state.inverse, settings.inverse
    a, b, c = new[0], new[1], new[2]
    limit = b / a
    if not np.abs(limit) + np.abs(1.0 / c) < BEYOND:
        return False
    if settings.by_path != 0.0:
        # What the path does not tell stays: the same model changes nothing.
        untold = 0.0
        if model.b > 0.0:
            untold = own.w_h / model.b - recent_path.hysteresis(state.path)
        if b > 0.0:
            recent_path.use_decay(state.path, a)
        where = a * (recent_path.hysteresis(state.path) + untold)
    else:
        where = own.w_h * model.a / model.b if model.b > 0.0 else 0.0
    own.w_h = min(max(where, -1.0), 1.0) * limit
    model.a, model.b, model.c, model.offset = a, b, c, new[3]
    return True


@register_jitable
def proposed(model: Any, hysteretic: bool, new: Any) -> bool:
    """Settings `new` for what an estimator proposes; False if it has no inverse.

    `model` is (alpha, beta, gamma, offset), moved to the nearest admissible one, or (gain, -, -, offset).
    """
    for i in range(4):
        if not abs(model[i]) < WILDEST:
            return False
    new[3] = model[3]
    if not hysteretic:
        new[0], new[1], new[2] = 1.0, 0.0, model[0]
        return model[0] != 0.0
    found = admissible.has_inverse(model[0], model[1], model[2])
    if not found:
        found = admissible.nearest_admissible(model, admissible.NEAREST_MARGIN)
    new[0], new[1], new[2] = equations.loop_parameters(model[0], model[1], model[2])
    return bool(found)
