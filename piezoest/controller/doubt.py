"""What is known may be wrong now: the line drives until the models have proved their accuracy again."""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import candidate, driving, faults, slots
from piezoest.controller import line as lines
from piezoest.controller import travel as travels

# Whether a voltage was written does not matter for a difference below this fraction of a swing.
NOTHING = 1.0 / 64.0
# A small scan is wide again in a leg so many times as long as those before.
OUTGROWN = 2.0


@register_jitable
def all_models(state: Any) -> None:
    """Let the line drive, and forget how well each model has done."""
    driving.drive(state, 0.0)
    state.since = 0.0
    candidate.forget(state.score)
    candidate.forget(state.outcome)
    slots.forget(state.candidates)


@register_jitable
def matters(state: Any) -> bool:
    """Whether it matters if the planned voltage was written, or the last known one is still there."""
    return np.abs(state.planned - state.u) >= NOTHING * state.travel.swing


@register_jitable
def lose_write(state: Any) -> None:
    """It is unknown whether the voltage was written: it is the planned one, or still the last one."""
    single = state.pending > 0.0
    state.pending = 0.0
    if not matters(state):
        return
    if state.since > 0.0:
        # Once for several in a row.
        faults.notice(state, faults.UNKNOWN)
    all_models(state)
    if single:
        go_on_from_planned(state)


@register_jitable
def go_on_from_planned(state: Any) -> None:
    """Let the line go on from the planned voltage, so that it does not go back to the last known one."""
    state.owed -= state.line.gain * (state.planned - state.u) / state.unit


@register_jitable
def narrow(state: Any) -> None:
    """After a wide way the reference may go on small, where what was learnt on the wide one is of no use."""
    reference, line = state.reference, state.line
    if not travels.is_over(reference, np.sqrt(state.readings.noise)):
        return
    least, waits = max(reference.back, travels.LEAST * reference.swing), reference.waits
    travels.narrow(reference, waits, least)
    travels.narrow(state.travel, waits, least / np.abs(line.gain))
    lines.begin(line, line.gain, state.u, lines.at(line, state.u), least / np.abs(line.gain))
    state.small = 1.0
    all_models(state)


@register_jitable
def widen(state: Any) -> None:
    """A small scan has become wide again: the line has the slope of wide ways."""
    reference, line = state.reference, state.line
    longest = max(line.longest, reference.least)
    if state.small == 0.0 or np.abs(reference.last - reference.turned) < OUTGROWN * longest:
        return
    state.small = 0.0
    if np.abs(line.gain) < np.abs(line.first_gain):
        lines.tilt(line, line.first_gain, state.u)
        lines.forget_legs(line)
