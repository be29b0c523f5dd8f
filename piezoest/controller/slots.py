"""The candidates of a controller: up to four beside the straight line, whatever estimators they hold.

What compiled code does for all of them stands here; an empty slot is None, and nothing is compiled for it: a
test for that stands alone, as no other would be seen through.
"""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from piezoest.controller import candidate
from piezoest.layout import ABSENT, Field, Record, record

NAMES = ("first", "second", "third", "fourth")


def layout(fields: list[Field]) -> Record:
    """Layout of up to four candidates, states or settings."""
    return record(**dict(zip(NAMES, [*fields, *[ABSENT] * (len(NAMES) - len(fields))], strict=True)))


@register_jitable
def _advance(slot: Any, settings: Any, u: Any) -> None:
    if slot is not None:
        candidate.advance(slot, settings, u)


@register_jitable
def advance(slots: Any, settings: Any, u: Any) -> None:
    """Let all models follow the voltage that was written."""
    _advance(slots.first, settings.first, u)
    _advance(slots.second, settings.second, u)
    _advance(slots.third, settings.third, u)
    _advance(slots.fourth, settings.fourth, u)


@register_jitable
def _learn(slot: Any, settings: Any, u: Any, z: Any) -> None:
    if slot is not None:
        candidate.learn(slot, settings, u, z)


@register_jitable
def learn(slots: Any, settings: Any, u: Any, z: Any) -> None:
    """Give all estimators a sample."""
    _learn(slots.first, settings.first, u, z)
    _learn(slots.second, settings.second, u, z)
    _learn(slots.third, settings.third, u, z)
    _learn(slots.fourth, settings.fourth, u, z)


@register_jitable
def _judge(slot: Any, z: Any, swings: Any, bound: Any) -> None:
    if slot is not None:
        miss = z - slot.score.z - slot.score.owed
        candidate.judge(slot.score, min(max(miss, -bound), bound), swings)


@register_jitable
def judge(slots: Any, z: Any, swings: Any, bound: Any) -> None:
    """Count what each model misses of a reading."""
    _judge(slots.first, z, swings, bound)
    _judge(slots.second, z, swings, bound)
    _judge(slots.third, z, swings, bound)
    _judge(slots.fourth, z, swings, bound)


@register_jitable
def _forget(slot: Any) -> None:
    if slot is not None:
        slot.score.weight = 0.0


@register_jitable
def forget(slots: Any) -> None:
    """Forget what each model has missed."""
    _forget(slots.first)
    _forget(slots.second)
    _forget(slots.third)
    _forget(slots.fourth)


@register_jitable
def _pay(slot: Any, kept: Any) -> None:
    if slot is not None:
        slot.score.owed *= kept


@register_jitable
def pay(slots: Any, kept: Any) -> None:
    """Keep a fraction of what is owed."""
    _pay(slots.first, kept)
    _pay(slots.second, kept)
    _pay(slots.third, kept)
    _pay(slots.fourth, kept)


@register_jitable
def _owe(slot: Any, number: Any, wanted: Any, z: Any) -> None:
    if slot is not None:  # noqa: SIM102
        if wanted == number:
            slot.score.owed = z - slot.score.z


@register_jitable
def owe(slots: Any, number: Any, z: Any) -> None:
    """Let the model of a number owe what it takes to stand at z."""
    _owe(slots.first, 1.0, number, z)
    _owe(slots.second, 2.0, number, z)
    _owe(slots.third, 3.0, number, z)
    _owe(slots.fourth, 4.0, number, z)


@register_jitable
def _owed(slot: Any, wanted: Any, number: Any, otherwise: Any) -> float:
    if slot is not None:  # noqa: SIM102
        if wanted == number:
            return slot.score.owed
    return otherwise


@register_jitable
def owed(slots: Any, number: Any, otherwise: Any) -> float:
    """What the model of a number owes; `otherwise` for the line, number 0."""
    z = _owed(slots.first, 1.0, number, otherwise)
    z = _owed(slots.second, 2.0, number, z)
    z = _owed(slots.third, 3.0, number, z)
    return _owed(slots.fourth, 4.0, number, z)


@register_jitable
def _hand_over(slot: Any, settings: Any) -> None:
    if slot is not None:
        candidate.hand_over(slot, settings)


@register_jitable
def hand_over(slots: Any, settings: Any) -> None:
    """Use the estimators' models of now."""
    _hand_over(slots.first, settings.first)
    _hand_over(slots.second, settings.second)
    _hand_over(slots.third, settings.third)
    _hand_over(slots.fourth, settings.fourth)


@register_jitable
def _begin(slot: Any, settings: Any, u: Any, centre: Any, scale: Any) -> None:
    if slot is not None:
        candidate.begin(slot, settings, u, centre, scale)


@register_jitable
def begin(slots: Any, settings: Any, u: Any, centre: Any, scale: Any) -> None:
    """Begin at rest at a voltage; the swing has a centre, and `scale` is half of it."""
    _begin(slots.first, settings.first, u, centre, scale)
    _begin(slots.second, settings.second, u, centre, scale)
    _begin(slots.third, settings.third, u, centre, scale)
    _begin(slots.fourth, settings.fourth, u, centre, scale)


@register_jitable
def _shift(slot: Any, settings: Any, z: Any) -> None:
    if slot is not None:
        candidate.shift(slot, settings, z)


@register_jitable
def shift(slots: Any, settings: Any, z: Any) -> None:
    """Let all models stand at z."""
    _shift(slots.first, settings.first, z)
    _shift(slots.second, settings.second, z)
    _shift(slots.third, settings.third, z)
    _shift(slots.fourth, settings.fourth, z)


@register_jitable
def _expected(slot: Any, wanted: Any, number: Any, otherwise: Any) -> float:
    if slot is not None:  # noqa: SIM102
        if wanted == number:
            return slot.score.z
    return otherwise


@register_jitable
def expected(slots: Any, number: Any, otherwise: Any) -> float:
    """Where the model of a number stands; `otherwise` for the line, number 0."""
    z = _expected(slots.first, 1.0, number, otherwise)
    z = _expected(slots.second, 2.0, number, z)
    z = _expected(slots.third, 3.0, number, z)
    return _expected(slots.fourth, 4.0, number, z)


@register_jitable
def _missed(slot: Any, wanted: Any, number: Any, otherwise: Any) -> float:
    if slot is not None:  # noqa: SIM102
        if wanted == number and slot.usable != 0.0 and slot.score.weight >= 0.25:
            return candidate.missed(slot.score)
    return otherwise


@register_jitable
def missed(slots: Any, number: Any, otherwise: Any) -> float:
    """What the model of a number has missed; `otherwise` if there is none."""
    z = _missed(slots.first, 1.0, number, otherwise)
    z = _missed(slots.second, 2.0, number, z)
    z = _missed(slots.third, 3.0, number, z)
    return _missed(slots.fourth, 4.0, number, z)


@register_jitable
def _voltage(slot: Any, settings: Any, wanted: Any, number: Any, z: Any, otherwise: Any) -> float:
    if slot is not None:  # noqa: SIM102
        if wanted == number:
            return candidate.voltage(slot, settings, z)
    return otherwise


@register_jitable
def voltage(slots: Any, settings: Any, number: Any, z: Any, otherwise: Any) -> float:
    """Voltage at which the model of a number stands at z; `otherwise` for the line, number 0."""
    u = _voltage(slots.first, settings.first, 1.0, number, z, otherwise)
    u = _voltage(slots.second, settings.second, 2.0, number, z, u)
    u = _voltage(slots.third, settings.third, 3.0, number, z, u)
    return _voltage(slots.fourth, settings.fourth, 4.0, number, z, u)
