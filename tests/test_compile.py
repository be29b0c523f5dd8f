"""Compiled functions on named numbers: machine code and Python do the same, and nothing else compiles."""

import itertools
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import TypingError, njit
from numba.core.errors import LoweringError
from numba.extending import register_jitable

from piezoest.compile import Record, compiled, inlined, like, local, local_rows
from piezoest.compiled_records import record_type
from piezoest.layout import ABSENT, COUNT, FIXED, NUMBER, Length, Named, new, numbers, record
from piezoest.layout import Record as Layout

INNER = record(count=COUNT, theta=numbers(3), P=numbers(2, 3))


def layout_of(plays: int | None = 4, places: int = 2) -> Layout:
    """Records in records, arrays, and sizes that users choose; without `plays` they are absent."""
    memory = ABSENT if plays is None else record(
        u=numbers(Length("plays", plays)), thetas=numbers(Length("places", places), 3), last=NUMBER
    )  # fmt: skip
    return record(total=NUMBER, law=INNER, memory=memory, tail=numbers(2), rates=ABSENT)


GAIN = record(gain=FIXED, scale=numbers(3, kind=FIXED))
GAINS: dict[str, Any] = {"gain": 0.5, "scale": [1.0, 2.0, 3.0]}


@inlined
def remember(memory: Any, x: Any) -> Any:
    if memory is None:
        return x
    for i in range(len(memory.u)):
        memory.u[i] += x + i
    for i in range(len(memory.thetas)):
        for j in range(3):
            memory.thetas[i, j] += 10.0 * i + j * x
    memory.last = x
    return 2.0 * x


@register_jitable
def squares(theta: Any, P: Any) -> Any:
    """Room on the stack: of the size of an array, and of sizes written out."""
    copy, row, rows = like(theta), local(3), local_rows(2, 3)
    total = 0.0
    for i in range(len(theta)):
        copy[i] = theta[i] * theta[i]
        row[i] = P[0, i] + P[1, i]
    for i in range(2):
        for j in range(3):
            rows[i, j] = copy[j] + row[j]
            total += rows[i, j]
    return total


@register_jitable
def sample(state: Any, given: Any, x: Any) -> None:
    law = state.law
    law.count += 1.0
    for i in range(len(law.theta)):
        law.theta[i] += given.gain * given.scale[i] * x
        for j in range(len(law.P)):
            law.P[j, i] = law.theta[i] - j
    state.tail[1] = remember(state.memory, x)
    state.total += squares(law.theta, law.P) + state.tail[1]


@compiled
def step(state: Record, given: Record, x: float) -> float:
    sample(state, given, x)
    return state.total


@compiled
def misspelt(state: Record) -> None:
    state.law.thetta[0] = 1.0


@compiled
def stack_of_unknown_size(state: Record) -> None:
    room = like(state.memory.u)
    room[0] = 1.0


def test_unknown_names_are_refused() -> None:
    with pytest.raises(KeyError, match="thetta"):
        new(INNER, thetta=[1.0, 2.0, 3.0])
    with pytest.raises(KeyError, match="cuont"):
        new(layout_of(2), law={"cuont": 1.0})
    with pytest.raises(ValueError, match=r"\['plays'\] are names of fields and of lengths"):
        record(plays=COUNT, u=numbers(Length("plays", 3)))


@settings(max_examples=25)
@given(plays=st.one_of(st.integers(0, 9), st.none()), places=st.integers(0, 9), x=st.floats(-1e3, 1e3))
def test_machine_code_does_what_python_does_at_any_length(plays: int | None, places: int, x: float) -> None:
    layout = layout_of(plays, places)
    machine, plain, given = new(layout), new(layout), new(GAIN, **GAINS)
    for each in (x, -0.5 * x):
        total = step.of(layout, GAIN)(machine, given, each)
        assert total == step.function(Named(plain, layout), Named(given, GAIN), each)
    assert machine.tobytes() == plain.tobytes()
    assert step.of(layout, GAIN) is step.of(layout_of(None if plays is None else 4), GAIN)


@pytest.mark.parametrize(("function", "words"), [(misspelt, "thetta"), (stack_of_unknown_size, "like")])
def test_does_not_compile(function: Any, words: str) -> None:
    with pytest.raises((TypingError, LoweringError), match=words):
        function.of(layout_of())


def several() -> list[Layout]:
    """Layouts that differ in one name, size, place or presence."""
    fields = dict(INNER.fields)
    return [
        INNER,
        record(**{**fields, "counts": NUMBER}),
        record(**{("counted" if name == "count" else name): field for name, field in INNER.fields}),
        record(**{**fields, "theta": numbers(4)}),
        record(**{**fields, "P": numbers(3, 2)}),
        record(**{**fields, "P": numbers(6)}),
        record(**{**fields, "theta": numbers(Length("n", 3))}),
        record(**{**fields, "theta": ABSENT}),
        record(**{**fields, "count": record(count=COUNT)}),
        record(**dict(reversed(INNER.fields))),
        Layout(INNER.fields, "math"),
    ]


def test_no_two_layouts_share_machine_code() -> None:
    for one, other in itertools.combinations(several(), 2):
        assert record_type(one) != record_type(other)
        nested = (record(law=one, tail=NUMBER), record(law=other, tail=NUMBER))
        assert record_type(nested[0]) != record_type(nested[1])


@register_jitable
def third(x: float) -> float:
    return x / 3.0


@register_jitable
def plus_a_third(x: float) -> float:
    return x + third(x)


@compiled
def four_thirds(x: float) -> float:
    return plus_a_third(x)


@njit(_nrt=False, error_model="numpy", nogil=True)
def elsewhere(x: float) -> float:
    return plus_a_third(x)


def test_a_part_of_a_loop_can_be_part_of_a_function_that_numba_compiles_alone() -> None:
    assert four_thirds(1.5) == plus_a_third(1.5) == elsewhere(1.5)
