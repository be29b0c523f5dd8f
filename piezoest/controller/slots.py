"""The candidates of a controller beside the line: estimators, Duhem model, recorded loop.

They are a chain: a ``model`` with its estimator, see `piezoest.controller.candidate`, and the ``others``,
which are None after the last. Functions that do something for all of them are here. After the end of the
chain nothing is compiled: Numba drops a branch whose test is ``slots is not None`` alone, so this test is
never joined with others.
"""

from collections.abc import Iterator, Sequence
from typing import Any

from numba.extending import register_jitable

from piezoest.controller import candidate
from piezoest.layout import ABSENT, Field, Record, record

# Most estimators.
MOST = 4


def layout(fields: Sequence[Field]) -> Field:
    """Layout of candidates, states or settings."""
    chain: Field = ABSENT
    for field in reversed(fields):
        chain = record(model=field, others=chain)
    return chain


def values(each: list[dict[str, Any]]) -> dict[str, Any]:
    """Values of candidates for such a layout."""
    chain: dict[str, Any] = {}
    for own in reversed(each):
        chain = {"model": own, "others": chain}
    return chain


def layouts_in(chain: Field) -> Iterator[Any]:
    """Layouts of the candidates in that of all."""
    while isinstance(chain, Record):
        yield chain.by_name["model"]
        chain = chain.by_name["others"]


def every(chain: Any) -> Iterator[Any]:
    """Candidates in a structured array of all."""
    while chain.dtype.names is not None:
        yield chain["model"]
        chain = chain["others"]


@register_jitable
def begin(slots: Any, settings: Any, u: Any, centre: Any, scale: Any) -> None:
    """Begin at rest at a voltage; the swing has a centre, and `scale` is half of it."""
    if slots is not None:
        candidate.begin(slots.model, settings.model, u, centre, scale)
        begin(slots.others, settings.others, u, centre, scale)


@register_jitable
def shift(slots: Any, settings: Any, z: Any) -> None:
    """Let all models stand at z."""
    if slots is not None:
        candidate.shift(slots.model, settings.model, z)
        shift(slots.others, settings.others, z)


@register_jitable
def advance(slots: Any, settings: Any, u: Any) -> None:
    """Let all models follow the voltage that was written."""
    if slots is not None:
        candidate.advance(slots.model, settings.model, u)
        advance(slots.others, settings.others, u)


@register_jitable
def learn(slots: Any, settings: Any, u: Any, z: Any) -> None:
    """Give all estimators a sample."""
    if slots is not None:
        candidate.learn(slots.model, settings.model, u, z)
        learn(slots.others, settings.others, u, z)


@register_jitable
def hand_over(slots: Any, settings: Any) -> None:
    """Use the estimators' models of now."""
    if slots is not None:
        candidate.hand_over(slots.model, settings.model)
        hand_over(slots.others, settings.others)


@register_jitable
def judge(slots: Any, z: Any, bound: Any, swings: Any) -> None:
    """Count what each model misses of a reading, see `candidate.judge`."""
    if slots is not None:
        score = slots.model.score
        candidate.judge(score, z - score.z - score.owed, bound, swings)
        judge(slots.others, z, bound, swings)


@register_jitable
def forget(slots: Any) -> None:
    """Forget what each model has missed."""
    if slots is not None:
        candidate.forget(slots.model.score)
        forget(slots.others)


@register_jitable
def pay(slots: Any, left: Any) -> None:
    """Pay what is owed, but for a fraction that is left."""
    if slots is not None:
        slots.model.score.owed *= left
        pay(slots.others, left)


# ---------------------------------------------------------------- one of them, by its number: 0 is the line


@register_jitable
def owe(slots: Any, number: Any, z: Any) -> None:
    """Let the model of a number owe what it takes to stand at z."""
    if slots is not None:
        if number == 1.0:
            slots.model.score.owed = z - slots.model.score.z
        owe(slots.others, number - 1.0, z)


@register_jitable
def forget_one(slots: Any, number: Any, left: Any) -> None:
    """Forget what the model of a number has missed, and what it owes but for a fraction that is left."""
    if slots is not None:
        if number == 1.0:
            candidate.forget(slots.model.score)
            slots.model.score.owed *= left
        forget_one(slots.others, number - 1.0, left)


@register_jitable
def owed(slots: Any, number: Any, otherwise: Any) -> float:
    """What the model of a number owes; `otherwise` for the line."""
    if slots is not None:
        if number == 1.0:
            return slots.model.score.owed
        return owed(slots.others, number - 1.0, otherwise)
    return otherwise


@register_jitable
def is_closed(slots: Any, number: Any) -> bool:
    """Whether the loop of the model of a number is closed, as far as is known."""
    if slots is not None:
        if number == 1.0:
            return slots.model.closed != 0.0
        return is_closed(slots.others, number - 1.0)
    return True


@register_jitable
def stands(slots: Any, number: Any, otherwise: Any) -> float:
    """Where the reference stands for the model of a number: where it does, and what it owes."""
    if slots is not None:
        if number == 1.0:
            return slots.model.score.z + slots.model.score.owed
        return stands(slots.others, number - 1.0, otherwise)
    return otherwise


@register_jitable
def missed(slots: Any, number: Any, least: Any, otherwise: Any) -> float:
    """What the model of a number has missed in at least so many swings; `otherwise` if there is none."""
    if slots is not None:
        if number == 1.0 and slots.model.usable != 0.0 and slots.model.score.weight >= least:
            return candidate.missed(slots.model.score)
        return missed(slots.others, number - 1.0, least, otherwise)
    return otherwise


@register_jitable
def voltage(slots: Any, settings: Any, number: Any, z: Any, otherwise: Any) -> float:
    """Voltage at which the model of a number stands at z; `otherwise` for the line."""
    if slots is not None:
        if number == 1.0:
            return candidate.voltage(slots.model, settings.model, z)
        return voltage(slots.others, settings.others, number - 1.0, z, otherwise)
    return otherwise
