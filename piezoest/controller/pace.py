"""Whether the reference is too fast: near the resonance, or so fast that lag looks like width of the loop.

The start shows how late the readings are. The area between the way of the voltage and the answer, both
divided by their final values, is the time between them, for a lag and for a delay; ringing cancels. Voltage
and reading are of the same sample, so blocks do not count.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.controller import faults
from piezoest.controller import readings as reading
from piezoest.controller import start as starts
from piezoest.layout import AMOUNT, COUNT, DISTANCE, FLAG, MEASURED, NUMBER, record

PACE = record(
    # A way of the start: samples, where it began, sums of the way and of the answer, in all, in its third
    # quarter and in its last one; how late the readings were on the last two ways [samples].
    count=COUNT, from_u=MEASURED, from_x=MEASURED, gone=NUMBER, answered=NUMBER, gone_third=NUMBER,
    answered_third=NUMBER, gone_last=NUMBER, answered_last=NUMBER, before=AMOUNT, now=AMOUNT,
    # Length of the reference's last leg, and of its longest one; samples of a period; sample of the last
    # warning; which warnings have been given.
    length=DISTANCE, widest=DISTANCE, period=AMOUNT, told=COUNT, fast=FLAG, late=FLAG,
)  # fmt: skip

# A reference is fast above this fraction of the resonance, or with this phase of the lag [rad], which is
# about the width of the loop relative to the swing.
FAST, LATE = 0.05, 0.05
WAVE = 2.0 * np.pi
# Creep and the bend of the way look like this fraction of the samples. The delays on two ways agree within
# the factor ALIKE: an amplifier that slews is later on the last, longer one, and hum changes the first.
CREEP, ALIKE = 0.007, 1.8
# How far the voltage is after half of the time of a way, and after three quarters.
HALF, THIRD = 0.5, 0.84375
# The end of the way shows backlash if it has less than this part of the lag, and the way so many samples.
SHARP, SHOWN = 0.5, 12.0
# Legs below this fraction of the longest are noise of a reference that rests; so many legs must be over.
LEAST, FIRST_LEGS = 0.05, 3.0


@register_jitable
def _end(pace: Any, start: Any, settings: Any, u: Any) -> None:
    """A way is over: how late the readings were. The median of three has added one sample."""
    way, answer = u - pace.from_u, start.mean - pace.from_x
    if pace.count == 0.0 or way * answer == 0.0:
        return
    area = pace.gone / way - pace.answered / answer - 1.0
    # Backlash lets the answer begin late, but end with the way: v less answer is about lag v' + c (1 - v) in
    # its second half, where v goes from 0 to 1; both sums give the lag.
    third = pace.gone_third / way - pace.answered_third / answer - (THIRD - HALF)
    last = pace.gone_last / way - pace.answered_last / answer - (1.0 - THIRD)
    sharp = 10.25 * last - 1.75 * third
    # A longer one goes on after the way.
    backlash = settings.ramp > max(SHOWN, area) and sharp < SHARP * area
    late = (sharp if backlash else area) - CREEP * pace.count
    pace.before, pace.now = pace.now, max(late, 0.0)


@register_jitable
def follow(pace: Any, start: Any, settings: Any, u: Any, x: Any) -> None:
    """Take a sample of the start, before the start does."""
    if u == start.from_u or start.stage == starts.REST:
        _end(pace, start, settings, u)
        pace.count = pace.gone = pace.answered = 0.0
        pace.gone_third = pace.answered_third = pace.gone_last = pace.answered_last = 0.0
        pace.from_u, pace.from_x = u, start.from_x
    elif np.abs(x) < WILDEST:
        pace.count += 1.0
        pace.gone += u - pace.from_u
        answer = reading.median(x, start.last, start.before) - pace.from_x
        pace.answered += answer
        gone, way = np.abs(u - pace.from_u), np.abs(start.target - pace.from_u)
        if THIRD * way < gone < way:
            pace.gone_last += u - pace.from_u
            pace.answered_last += answer
        elif HALF * way < gone < way:
            pace.gone_third += u - pace.from_u
            pace.answered_third += answer


@register_jitable
def conclude(pace: Any, start: Any, settings: Any, u: Any) -> None:
    """Note how late the readings are; if two ways disagree the smaller delay counts, without a warning."""
    _end(pace, start, settings, u)
    alike = start.ways == 0.0 or (pace.now < ALIKE * pace.before and pace.before < ALIKE * pace.now)
    start.lag = pace.now if alike else min(pace.now, pace.before)
    pace.late = pace.late if alike else 1.0


@register_jitable
def watch(state: Any, settings: Any) -> None:
    """At a turn: warn once if the reference is too fast."""
    pace, reference = state.pace, state.reference
    pace.widest = max(pace.widest, reference.leg) if reference.turns > 1.0 else 0.0
    wide = min(pace.length, reference.leg) > LEAST * pace.widest
    pace.period, pace.length = reference.past + reference.usual, reference.leg
    # A block keeps one event: of two warnings in it the first would be lost.
    if reference.turns < FIRST_LEGS or not wide or state.samples <= pace.told + state.block:
        return
    if pace.fast == 0.0 and pace.period < settings.shortest:
        pace.fast, pace.told = 1.0, state.samples
        faults.notice(state, faults.FAST)
    elif pace.late == 0.0 and WAVE * state.start.lag > LATE * pace.period:
        pace.late, pace.told = 1.0, state.samples
        faults.notice(state, faults.LATE)
