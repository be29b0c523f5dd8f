"""Which model drives, the line or a candidate, by their recent errors.

The voltage changes gradually from one to the next; `piezoest.controller.candidate` says what a model *owes*.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.controller import candidate, faults, slots
from piezoest.controller import line as lines
from piezoest.controller import travel as travels

# The line alone drives until it has seen a leg, or the voltage has come back this fraction of its first way.
BACK = 0.5
# What a model owes is paid within this fraction of a swing of the reference. If it were paid faster, a loop
# through the models would feed a resonance.
PAID = 1.0 / 4.0
# ... of the leg so far, which counts for at least this fraction of the swing.
LEAST_LEG = 0.1
# Another model drives if it has missed less than this fraction of what the present one has.
BETTER = 0.8
# Swings between two changes of the model that drives; after a fall back to the line twice as many each time.
PATIENCE, LONGEST_PATIENCE = 0.25, 128.0
# Swings after which a model that drives has shown what it does; before which the miss may be the last one's.
SEEN, CALM = 0.6, 0.1
# A model that has driven for so many times the patience halves it; swings that count for it from then on.
SHOWN, PROVEN = 4.0, 1.0
# A model that drives falls back at once where the stage misses by so many times what the line has missed.
TRIP = 2.0
# ... unless the line would miss by so many times more: small legs make it flat, and a wide one follows.
WORSE = 1.5
# No model may miss more than the line has. That bound follows the line down at once, and up by this factor
# each time, for the stage may have changed. It is at least so many swings: hysteresis lets no line be better.
SLOWLY_UP, AT_LEAST = 1.05, 0.05
# After so many of these sudden falls an event says so, once: so many are no chance, unless models drive well
# for long between them.
OFTEN = 3.0
# Misses below this fraction of a swing are all alike.
ALIKE = 5e-4


@register_jitable
def line_z(state: Any) -> float:
    """Where the line stands at the voltage written."""
    return (lines.at(state.line, state.u) - state.zero) / state.unit


@register_jitable
def kept(reference: Any, travelled: Any, swing: Any) -> float:
    """The fraction of what is owed that is left after a travel of the reference."""
    if reference.turns <= 1.0:
        # Nobody knows the swing yet: the way from rest may be much longer.
        paid = PAID * max(np.abs(reference.last - reference.turned), LEAST_LEG * swing)
    else:
        paid = PAID * swing
    return max(0.0, 1.0 - travelled / paid) if paid > 0.0 else 1.0


@register_jitable
def stand_at(state: Any, z: Any) -> None:
    """Let what drives, a model or the line, owe what it takes to stand at z."""
    if state.driving > 0.0:
        slots.owe(state.candidates, state.driving, z)
    else:
        state.owed = z - line_z(state)


@register_jitable
def stand_at_reference(state: Any) -> None:
    """Let what drives, a model or the line, go on from the reference at the voltage written."""
    stand_at(state, (state.r + state.feedback - state.zero) / state.unit)


@register_jitable
def drive(state: Any, number: Any) -> None:
    """Let another model drive, without a bump."""
    state.switches += number != state.driving
    state.driving = number
    # Where the corridor held the last one back it stood elsewhere.
    stand_at_reference(state)


@register_jitable
def owe(state: Any, more: Any) -> None:
    """Let what drives, a model or the line, owe more."""
    z = slots.stands(state.candidates, state.driving, line_z(state) + state.owed)
    stand_at(state, z + more)


@register_jitable
def _faked(state: Any) -> float:
    """By how much late readings miss what is true: models learn it as if it were hysteresis.

    It is most where the reference is fastest, as on edges between rests.
    """
    reference = state.reference
    fastest = travels.in_swings(reference, reference.fastest)
    # What the start has left of the first leg may be short: the second one counts as it goes on.
    leg = max(reference.usual, reference.count if reference.turns == 1.0 else 1.0)
    late = state.start.lag * max(1.0 / leg, fastest)
    return min(late, 1.0) * state.travel.swing


@register_jitable
def _choose(state: Any, settings: Any) -> float:
    """The model with the smallest recent error, if it is clearly better than the present one.

    Models that learn from late readings predict these well, but not the stage: what is faked by that is added
    to their misses, and taken off the line's. The recorded loop is of no use where the reference leaves it,
    however good it was before.
    """
    faked = _faked(state)
    line = max(candidate.missed(state.score) - faked, 0.0)
    noise = state.readings.noise / (state.unit * state.unit)
    floor = noise + (ALIKE * state.travel.swing) ** 2
    best, least = 0.0, np.inf
    present = np.inf
    for number in range(slots.MOST + 2):
        miss = slots.missed(state.candidates, number * 1.0, np.inf) + faked if number > 0 else line
        if number == settings.recorded and state.reference.nested == 0.0:
            miss = np.inf
        if number == state.driving:
            present = miss
        if miss < least:
            best, least = number * 1.0, miss
    better = least * least + floor < BETTER * BETTER * (present * present + floor)
    free = state.since >= state.patience or present == np.inf
    return best if better and free else state.driving


@register_jitable
def _floor(state: Any) -> float:
    """What the noise alone misses, about, in volts."""
    return 2.0 * np.sqrt(state.readings.noise) / np.abs(state.unit)


@register_jitable
def _at_most(missed: Any, before: Any) -> float:
    """What the line misses now, as far as it exceeds what it missed before by no more than allowed."""
    return min(missed, max(SLOWLY_UP * before, AT_LEAST))


@register_jitable
def _disappoints(state: Any) -> bool:
    """Whether the stage misses the reference by more than the line did when it drove.

    A model can be right and still shake a resonance, which every model then misses alike.
    """
    if state.since <= SEEN:
        return False
    swing = travels.widest(state.travel)
    missed, peak = candidate.missed(state.score) / swing, state.score.peak / swing
    if state.driving > 0.0:
        # What it missed on the first way, or before it was drawn anew, would excuse too much.
        missed, peak = _at_most(missed, state.line_missed), _at_most(peak, state.line_peak)
    state.line_missed, state.line_peak = missed, peak
    return state.driving > 0.0 and candidate.missed(state.outcome) > missed * swing + _floor(state)


@register_jitable
def watch(state: Any, off: Any, line_off: Any) -> None:
    """Fall back to the line at once where the stage is farther off than the line would be, and has been."""
    wide = travels.widest(state.travel)
    if state.driving == 0.0 or not wide > 0.0:
        return
    # The bound of the last change of model may come from a quiet stretch: the line misses more by now.
    peak = max(state.line_peak, _at_most(state.score.peak / wide, state.line_peak))
    most = TRIP * peak * wide + 3.0 * _floor(state)
    if off > most and line_off < WORSE * off and state.since > CALM:
        _change(state, 0.0)
        state.shaken += 1.0
        if state.shaken == OFTEN:
            faults.notice(state, faults.SHAKEN)


@register_jitable
def _change(state: Any, chosen: Any) -> None:
    """Let another model drive; after each fall back to the line the models have to wait longer."""
    if chosen == 0.0:
        state.patience = min(2.0 * state.patience, LONGEST_PATIENCE)
    state.since = 0.0
    candidate.forget(state.outcome)
    drive(state, chosen)


@register_jitable
def _has_come_back(state: Any) -> bool:
    """Whether the voltage has come back some of its way from the start."""
    turned, origin = state.travel.turned, state.start.origin
    return (turned - state.u) * np.sign(turned - origin) > BACK * state.confirmed


@register_jitable
def reconsider(state: Any, settings: Any) -> None:
    """Let the best model drive."""
    if state.line.legs < 1.0 and not _has_come_back(state):
        return
    chosen = 0.0 if _disappoints(state) else _choose(state, settings)
    if chosen != state.driving:
        _change(state, chosen)
    elif chosen > 0.0 and state.since > SHOWN * state.patience:
        # It has driven well for long.
        state.patience = max(0.5 * state.patience, PATIENCE)
        if 0.0 < state.shaken < OFTEN:
            state.shaken -= 1.0
        state.since = PROVEN
