"""Integral feedback around the feed-forward: what no model knows, creep and drift, is taken back slowly.

The reference of the feed-forward is r + i, with di/dt = gain (r - x). Source: K. J. Åström, R. M. Murray,
Feedback Systems, Princeton 2008, sec. 10.4.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller.voltage import is_held

# No sample corrects more than this fraction of an error, of one that is answered late less.
FASTEST = 0.25


@register_jitable
def follow(state: Any, settings: Any, x: Any) -> None:
    """Take a believed reading; a sensor that lies can drive it no farther than the corridor."""
    share = min(settings.feedback, FASTEST / (1.0 + state.block + state.start.lag))
    growth = share * (state.r - x)
    if is_held(settings, state.u, growth * state.line.gain):
        # At a limit it would only wind up.
        return
    room = settings.corridor * 0.5 * state.reference.swing + 3.0 * np.sqrt(state.readings.noise)
    state.feedback = min(max(state.feedback + growth, -room), room)
