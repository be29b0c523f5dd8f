"""A Duhem model: the slope of the displacement depends on direction, voltage and displacement.

With rising voltage dx/du = p_0 + p_1 u + p_2 u² + p_3 x, and the same with other p with falling voltage. The
Coleman-Hodgdon model, (1) of the paper, has the same loop both ways: beta, gamma, 0, -alpha up, and beta,
-gamma, 0, alpha down. Here a stage may also drift to its loop over many swings. The functions are those of an
inverse, see `piezoest.compensators.inverse_kernel`.

Source: A. Visintin, Differential Models of Hysteresis, Springer 1994.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.layout import MEASURED, NUMBER, numbers, record

# Terms of the slope in one direction; those up stand before those down.
TERMS = 4
STATE = record(__name__, x=MEASURED)
# Terms, and the displacement from which the model goes on when it is handed over.
MODEL = record(p=numbers(2 * TERMS, kind=NUMBER), x=MEASURED)
LAYOUTS = STATE, MODEL  # of state and settings
LINE = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)

# Least and largest slope. A way longer than STEP is gone in steps, at most MOST + 1 of them.
LEAST, STEEPEST, STEP, MOST = 0.1, 10.0, 0.05, 64.0


@register_jitable
def slope(p: Any, direction: Any, u: Any, x: Any) -> float:
    """Slope at a voltage and a displacement."""
    first = 0 if direction > 0.0 else TERMS
    found = p[first] + (p[first + 1] + p[first + 2] * u) * u + p[first + 3] * x
    return min(max(found, LEAST), STEEPEST)


@register_jitable
def moved(p: Any, x: Any, u: Any, to: Any) -> float:
    """Displacement after a way of the voltage without a turn, by the midpoint rule."""
    steps = int(min(np.abs(to - u) / STEP, MOST)) + 1
    step = (to - u) / steps
    for _ in range(steps):
        middle = x + 0.5 * step * slope(p, step, u, x)
        x += step * slope(p, step, u + 0.5 * step, middle)
        u += step
    return x


@register_jitable
def wanted(state: Any, settings: Any, r: Any) -> float:
    """Voltage that moves the displacement to r, by the midpoint rule."""
    p, x, u = settings.inverse.p, state.inverse.x, state.voltage
    steps = int(min(np.abs(r - x) / STEP, MOST)) + 1
    step = (r - x) / steps
    for _ in range(steps):
        middle = u + 0.5 * step / slope(p, step, u, x)
        u += step / slope(p, step, middle, x + 0.5 * step)
        x += step
    return u


@register_jitable
def follow(state: Any, settings: Any, wanted: Any, given: Any) -> None:
    """Follow the voltage."""
    own = state.inverse
    own.x = moved(settings.inverse.p, own.x, state.voltage, given)


@register_jitable
def expected(state: Any, settings: Any) -> float:
    """Displacement at the last voltage."""
    return state.inverse.x


@register_jitable
def place(state: Any, settings: Any) -> None:
    """Go on from where the model was handed over."""
    state.inverse.x = settings.inverse.x
