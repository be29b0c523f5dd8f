"""How a compiled estimator writes its model into the settings of the model's inverse.

`write_model` of a kernel does so for a controller: it returns `NO_MODEL` where the estimate has no inverse,
`CHANGED`, or `TO_BE_PLACED` where what the inverse remembers of the voltage has to be found again. It
returns `NOT_CLOSED` where the same holds of a loop whose end does not meet its beginning yet.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.compile import local
from piezoest.equations import loop_inverse

NO_MODEL, CHANGED, TO_BE_PLACED, NOT_CLOSED = 0.0, 1.0, 2.0, 3.0


@register_jitable
def write_loop(state: Any, settings: Any, hysteretic: bool, model: Any) -> float:
    """Write what the kernel proposes now, of a loop or of a line, into settings of a loop's inverse."""
    proposed, new = local(4), local(4)
    state.proposed(state, settings, proposed)
    if not loop_inverse.proposed(proposed, hysteretic, new):
        return NO_MODEL
    if not np.abs(new[1] / new[0]) + np.abs(1.0 / new[2]) < loop_inverse.BEYOND:
        return NO_MODEL
    model.a, model.b, model.c, model.offset = new[0], new[1], new[2], new[3]
    return TO_BE_PLACED


@register_jitable
def write_plays(state: Any, settings: Any, model: Any) -> float:
    """Write the model as known now into settings of its inverse."""
    plays, used, unit = state.plays, state.law.used, settings.unit
    columns, n, segments = len(model.bends) + 1, len(model.thresholds), len(model.bends)
    same = True
    for j in range(segments):
        same = same and model.bends[j] == plays.lower[1 + j]
        model.bends[j] = plays.lower[1 + j]
    for i in range(n):
        threshold = plays.reach[(i + 1) * columns]
        same = same and model.thresholds[i] == threshold
        model.thresholds[i] = threshold
        model.weights[i] = used[(i + 1) * columns] * unit
    model.gain = used[0] * unit
    for i in range(n + 1):
        for j in range(segments):
            place = i * columns + j
            model.bend_weights[j * (n + 1) + i] = (used[place + 1] - used[place]) * unit
    for i in range(len(model.creep_gains)):
        model.creep_gains[i] = used[(n + 1) * columns + i]
    model.offset = state.offset
    return CHANGED if same else TO_BE_PLACED
