"""The compiled inside of `AdaptiveFeedforward`: what it remembers, and what Python calls.

`plan` changes nothing that hysteresis remembers: `take` does, by the voltage that was written.
"""

from typing import Any

import numpy as np

from piezoest._checks import WILDEST
from piezoest.compile import Record, Vector, compiled
from piezoest.controller import candidate, doubt, feedback, homing, late, outside, redraw, silence, slots
from piezoest.controller import line as lines
from piezoest.controller import pace as paces
from piezoest.controller import readings as reading
from piezoest.controller import start as starts
from piezoest.controller import still as stills
from piezoest.controller import travel as travels
from piezoest.controller.beginning import go_on_at_rest
from piezoest.controller.learning import take
from piezoest.controller.voltage import HOME, RUN, SEEK, plan, written
from piezoest.layout import AMOUNT, COUNT, FIXED, FLAG, MEASURED, NUMBER, Field, record, whole
from piezoest.layout import Record as Layout

# Half-width of the corridor without drift, as a fraction of half the widest swing of the reference of late.
WIDTH = 0.4


def layouts(candidates: Field, candidate_settings: Field) -> tuple[Layout, Layout]:
    """Layouts of state and settings."""
    state = record(
        samples=COUNT, missing=COUNT, saturated=COUNT, slewed=COUNT,
        # Phase; voltages planned since the last one was written; samples that wait for the end of a block.
        stage=whole(0.0, 3.0), pending=COUNT, block=AMOUNT,
        # Reference of the last plan, whether there was one; voltage planned, voltage written; samples without
        # a reading, now and in the longest recent gap.
        r=MEASURED, asked=FLAG, planned=MEASURED, u=MEASURED, silent=COUNT, gap=AMOUNT,
        # Farthest way from the beginning that was answered; travel of the reference with the voltage at a
        # limit, and with a voltage that stood still; samples with the reference out of reach.
        confirmed=AMOUNT, railed=AMOUNT, frozen=AMOUNT, beyond=COUNT,
        # The model that drives, 0 for the line; what the line owes; drift to which the corridor leans [µm];
        # swings since the last change of model, least number before the next one, changes so far.
        driving=whole(0.0, slots.MOST + 2.0), owed=NUMBER, lean=NUMBER, since=AMOUNT, patience=AMOUNT,
        switches=COUNT,
        # Candidates get z = (x - zero)/unit; half the swing that they began with, zero before [V].
        unit=NUMBER, zero=MEASURED, scale=AMOUNT,
        # Whether the reference goes on small after a wide way; whether it is noted that reference or voltage
        # were outside of what the user's model was learnt on.
        small=FLAG, outside=FLAG,
        # Correction of the reference by feedback [µm]: now, and of the last plan.
        feedback=NUMBER, back=NUMBER, rest=feedback.REST, shaking=feedback.SHAKING,
        # Travel of the voltage since the last believed reading, and since models were handed over.
        gone=AMOUNT, handed=AMOUNT,
        # Number of events, what the last one was; sudden returns to the line, see `driving.OFTEN`.
        noticed=COUNT, notice=whole(0.0, 15.0), shaken=COUNT,
        # Sample, reference, reading and voltage of the last event.
        seen=record(samples=COUNT, r=MEASURED, x=MEASURED, u=MEASURED),
        # What the line misses, its largest recent miss, bounds for models in swings; what the stage misses of
        # the reference.
        score=candidate.SCORE, widest=AMOUNT, line_missed=AMOUNT, line_peak=AMOUNT, outcome=candidate.SCORE,
        travel=travels.TRAVEL, reference=travels.TRAVEL, line=lines.LINE, readings=reading.READINGS,
        start=starts.START, still=stills.STILL, homing=homing.HOMING, pace=paces.PACE, late=late.LATE,
        candidates=candidates,
    )  # fmt: skip
    settings = record(
        minimum=FIXED, maximum=FIXED, largest_step=FIXED, doubling=FIXED, corridor=FIXED, feedback=FIXED,
        # Samples of the shortest period that is far from the resonance, zero if that is unknown.
        shortest=FIXED, allowed=outside.ALLOWED,
        # Number of the recorded loop among the candidates, behind the Duhem model; -1 without any.
        recorded=FIXED,
        start=starts.SETTINGS, candidates=candidate_settings,
    )  # fmt: skip
    return state, settings


@compiled
def step(state: Record, settings: Record, r: float) -> Any:
    """Voltage for one sample of the reference."""
    return plan(state, settings, r)


@compiled
def learn(state: Record, settings: Record, u: float, x: float) -> None:
    """Learn from one sample, of the reference planned for last."""
    take(state, settings, np.nan, written(state, settings, u), x)


@compiled
def run(state: Record, settings: Record, r: Vector, u: Vector) -> None:
    """Voltages `u` for a reference `r`, were each written as planned; for a copy of the state."""
    state.start.ahead = len(r) - 1.0
    for k in range(len(r)):
        u[k] = plan(state, settings, r[k])
        take(state, settings, np.nan, u[k], np.nan)


@compiled
def learn_all(state: Record, settings: Record, r: Vector, u: Vector, x: Vector) -> None:
    """Learn from samples that were planned together."""
    state.block = max(0.9 * state.block, len(r) - 1.0)
    last = len(r) - 1
    for k in range(len(r)):
        # Only the last planned voltage of a block is known.
        take(state, settings, r[k], written(state, settings, u[k]) if k == last else u[k], x[k])
    if state.stage == RUN and len(r) > 1:
        redraw.go_on(state, settings)
        if state.driving == 0.0 and not np.abs(u[last]) < WILDEST:
            doubt.go_on_from_planned(state)


@compiled
def begin(state: Record, settings: Record, u: float) -> None:
    """Begin with a state of zeros, at rest at a voltage."""
    state.u = state.planned = u
    starts.begin(state.start, u)
    state.start.given = 1.0 if settings.start.gain != 0.0 else 0.0


@compiled
def resume(state: Record, settings: Record, u: float, x: float) -> Any:
    """Go on at rest at a voltage where the sensor reads x, with what is known so far; whether it can."""
    if not (settings.minimum <= u <= settings.maximum and np.abs(x) < WILDEST):
        return False
    state.u = state.planned = u
    state.pending = state.asked = state.frozen = state.silent = 0.0
    if state.unit != 0.0 and state.stage != SEEK:
        go_on_at_rest(state, settings, u, x)
        return True
    state.stage = SEEK
    # A way that was interrupted shows nothing.
    state.pace.count = 0.0
    starts.begin(state.start, u)
    # A gain that was refuted is not tried again.
    starts.rest_at(state.start, settings, u, x, state.start.given * settings.start.gain)
    state.start.told = 1.0
    return True


@compiled
def fault(state: Record, settings: Record) -> Any:
    """Number of the readings' fault, as in `faults.FAULTS`."""
    return silence.fault(state, settings)


@compiled
def home(state: Record, settings: Record, amplitude: float, turn: float, cycles: float) -> Any:
    """Begin a decaying sweep, `turn` of a cycle each sample; whether it can be."""
    if not homing.begin(state.homing, settings, state.u, amplitude, turn, cycles):
        return False
    if state.unit != 0.0:
        doubt.all_models(state)
    state.stage = HOME
    feedback.forget(state)
    reading.forget(state.readings)
    return True
