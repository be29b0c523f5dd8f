"""Faults and other events: their numbers in compiled code, their names, and what they mean."""

from typing import Any

from numba.extending import register_jitable

# What each means to the user. The first five and the last are faults, during which nothing is learnt.
MEANINGS = {
    "no response": "the readings do not answer the voltage",
    "reversed": "the readings go the wrong way",
    "scaled": "the readings answer far more or far less than before",
    "saturated": "the readings stand still at a level",
    "zero moved": "the readings have moved by a constant",
    "gain": "the stage answers with {gain_before:.3g} µm/V, not {gain:.3g}: the gain is sought",
    "unknown voltage": "nobody knows what was written, and the line drives until the models have proved "
    "their accuracy again",
    "shaken": "on three occasions the error with a model was suddenly far larger than with the line, as "
    "where a resonance is excited: use a slower or smoother reference",
    "resonance": "the reference, at {frequency:.3g} Hz, is above 5 % of the resonance, where the stage's "
    "dynamics count as much as hysteresis: slow it down, smooth it, or put a LeadFilter before it",
    "lag": "the readings are about {lag:.2g} ms late, which at {frequency:.3g} Hz looks like a loop of "
    "{width:.2g} % of the swing: what is learnt holds at this frequency alone; slow the reference down, or "
    "read sooner",
    "outside": "the reference is at {r} µm and the voltage at {u} V, the model that you gave was learnt from "
    "{displacement} and from {voltage}: the controller learns on, but a model that is to hold there must be "
    "identified from a log that goes as far",
    "out of reach": "the reference asks for {wanted:.4g} µm, and the stage is at {there:.4g} µm with the "
    "voltage at its limit of {limit:.4g} V: keep the reference within what the stage reaches",
    "false start": "the stage does not answer as at the start, where hum or drift looked like an answer: the "
    "gain is sought again, with larger steps",
    "feedback": "it goes back and forth, and its gain is halved: the gain is too large, or the readings hum",
    "no readings": "none has come for {silence:.2g} s: the present model drives on, and nothing is learnt",
}
# Their names by their numbers.
FAULTS = ("", *MEANINGS)
(
    NONE, NO_RESPONSE, REVERSED, SCALED, SATURATED, MOVED,
    OTHER_GAIN, UNKNOWN, SHAKEN, FAST, LATE, OUTSIDE, OUT_OF_REACH, FALSE_START, FEEDBACK,
    NO_READINGS,
) = (float(number) for number in range(len(FAULTS)))  # fmt: skip
# Events that are no faults, but that the user should act on.
WARNINGS = (SHAKEN, FAST, LATE, OUTSIDE, OUT_OF_REACH, FALSE_START, FEEDBACK, NO_READINGS)


@register_jitable
def notice(state: Any, number: Any) -> None:
    """Note a fault, its end (`NONE`), or another event, and what the figures in its text need."""
    state.noticed += 1.0
    state.notice = number
    state.seen.samples, state.seen.r = state.samples, state.r
    state.seen.x, state.seen.u = state.readings.last, state.u
