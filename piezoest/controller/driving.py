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
# What is owed is paid within this fraction of a swing of the reference; faster, the loop through the models
# would feed a resonance. In the first leg: of the leg so far, at least of LEAST_LEG swings.
PAID, LEAST_LEG = 1.0 / 4.0, 0.1
# Another model drives if its miss is below this fraction of that of the present one, after so many swings.
# The recorded loop may sooner, if no more than so many legs are over and the last two were alike: no other
# model has learnt much by then.
BETTER, ENOUGH = 0.8, 0.25
SOON, FIRST_LEGS = 0.2, 4.0
# The misses of the Duhem model are multiplied by this: it learns anything fast, also what is soon over.
UNPROVEN = 1.5
# Least number of swings between two changes of model. It doubles at each return to the line.
PATIENCE, LONGEST_PATIENCE = 0.25, 128.0
# Swings after which a model that drives is judged; before CALM the miss may still be that of the last one.
SEEN, CALM = 0.6, 0.1
# A model that has driven for SHOWN times the patience halves it; then PROVEN swings count as driven.
SHOWN, PROVEN = 4.0, 1.0
# The line drives at once where the stage misses by so many times the recent miss of the line, unless the line
# would miss by WORSE times as much: small legs make it flat, and then a wide one follows.
TRIP, WORSE = 2.0, 1.5
# No model may miss more than the line has. This bound follows the line down at once, and up by this factor
# each time, because the stage may have changed. It is at least so many swings: hysteresis lets no line be
# better.
SLOWLY_UP, AT_LEAST = 1.05, 0.05
# After so many sudden returns to the line an event is noted. Each long time of good driving takes one back.
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
        # The swing is not known yet: the way from rest may be much longer.
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
    # Not from where the last one stands: the corridor may have held it back.
    stand_at_reference(state)


@register_jitable
def owe(state: Any, more: Any) -> None:
    """Let what drives, a model or the line, owe more."""
    z = slots.stands(state.candidates, state.driving, line_z(state) + state.owed)
    stand_at(state, z + more)


@register_jitable
def _faked(state: Any) -> float:
    """How wrong late readings are, which models learn as if it were hysteresis; most on the fastest edges."""
    reference = state.reference
    fastest = travels.in_swings(reference, reference.fastest)
    # The first leg began before the run and may be short: the second one counts while it goes on.
    leg = max(reference.usual, reference.count if reference.turns == 1.0 else 1.0)
    late = state.start.lag * max(1.0 / leg, fastest)
    return min(late, 1.0) * state.travel.swing


@register_jitable
def begins_to_repeat(state: Any, settings: Any) -> bool:
    """Whether reference and voltage repeat their first legs, and the stage does, or no model drives."""
    if state.driving > 0.0 and not slots.is_closed(state.candidates, settings.recorded):
        return False
    return state.line.legs <= FIRST_LEGS and state.reference.alike * state.travel.alike != 0.0


@register_jitable
def _choose(state: Any, settings: Any) -> float:
    """The model with the smallest recent error, if it is clearly better than the present one.

    Models that learn from late readings predict these, not the stage: the error of late readings is added to
    their misses, and subtracted from that of the line. Where the reference leaves the recorded loop, that
    loop is of no use, however good it was.
    """
    faked = _faked(state)
    line = max(candidate.missed(state.score) - faked, 0.0)
    noise = state.readings.noise / (state.unit * state.unit)
    floor = noise + (ALIKE * state.travel.swing) ** 2
    best, least = 0.0, np.inf
    present = np.inf
    for number in range(slots.MOST + 3):
        enough = SOON if number == settings.recorded and begins_to_repeat(state, settings) else ENOUGH
        miss = slots.missed(state.candidates, number * 1.0, enough, np.inf) + faked if number > 0 else line
        if number == settings.recorded and state.reference.nested == 0.0:
            miss = np.inf
        if number == settings.recorded - 1.0:  # the Duhem model
            miss *= UNPROVEN
        if number == state.driving:
            present = miss
        if miss < least:
            best, least = number * 1.0, miss
    better = least * least + floor < BETTER * BETTER * (present * present + floor)
    free = state.since >= state.patience or present == np.inf
    return best if better and free else state.driving


@register_jitable
def _floor(state: Any) -> float:
    """About what the noise alone misses, as z."""
    return 2.0 * np.sqrt(state.readings.noise) / np.abs(state.unit)


@register_jitable
def _at_most(missed: Any, before: Any) -> float:
    """The miss of the line; what it missed before limits how fast it grows."""
    return min(missed, max(SLOWLY_UP * before, AT_LEAST))


@register_jitable
def _disappoints(state: Any) -> bool:
    """Whether the stage misses the reference by more than the line did when it drove."""
    # A correct model can still shake a resonance, and then all models miss alike.
    if state.since <= SEEN:
        return False
    swing = travels.widest(state.travel)
    missed, peak = candidate.missed(state.score) / swing, state.score.peak / swing
    if state.driving > 0.0:
        # What the line missed at first, or before it was drawn again, would excuse too much.
        missed, peak = _at_most(missed, state.line_missed), _at_most(peak, state.line_peak)
    state.line_missed, state.line_peak = missed, peak
    return state.driving > 0.0 and candidate.missed(state.outcome) > missed * swing + _floor(state)


@register_jitable
def watch(state: Any, off: Any, line_off: Any) -> None:
    """Let the line drive at once where the stage misses by more than the line would, and has."""
    wide = travels.widest(state.travel)
    if state.driving == 0.0 or not wide > 0.0:
        return
    # `line_peak` may be from a quiet time: the line may miss more by now.
    peak = max(state.line_peak, _at_most(state.score.peak / wide, state.line_peak))
    most = TRIP * peak * wide + 3.0 * _floor(state)
    if off > most and line_off < WORSE * off and state.since > CALM:
        _change(state, 0.0)
        state.shaken += 1.0
        if state.shaken == OFTEN:
            faults.notice(state, faults.SHAKEN)


@register_jitable
def _change(state: Any, chosen: Any) -> None:
    """Let another model drive; after each return to the line the models wait longer."""
    if chosen == 0.0:
        state.patience = min(2.0 * state.patience, LONGEST_PATIENCE)
    state.since = 0.0
    candidate.forget(state.outcome)
    drive(state, chosen)


@register_jitable
def reconsider(state: Any, settings: Any) -> None:
    """Let the best model drive."""
    turned = state.travel.turned
    back = (turned - state.u) * np.sign(turned - state.start.origin)
    if state.line.legs < 1.0 and not back > BACK * state.confirmed:
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
