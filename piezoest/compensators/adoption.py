"""A model as an estimator proposes it, handed to a compensator within a compiled loop."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.equations import admissible
from piezoest.equations import coleman_hodgdon as equations


@register_jitable
def adopt(compensator: Any, settings: Any, model: Any, hysteretic: bool, change: Any) -> bool:
    """Hand (alpha, beta, gamma, offset) or (gain, -, -, offset) to the compensator; False if it cannot be."""
    for i in range(4):
        if not abs(model[i]) < WILDEST:
            return False
    if not hysteretic:
        if model[0] == 0.0:
            return False
        # No hysteresis: b = 0, and any a.
        change(compensator, settings, 1.0, 0.0, model[0], model[3])
        return True
    if not admissible.has_inverse(model[0], model[1], model[2]):
        work = np.empty(9)
        if not admissible.nearest_admissible(model, work, admissible.NEAREST_MARGIN):
            return False
    a, b, c = equations.loop_parameters(model[0], model[1], model[2])
    change(compensator, settings, a, b, c, model[3])
    return True
