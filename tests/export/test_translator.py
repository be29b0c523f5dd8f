"""The translator on small functions: what it makes of them, and what it refuses."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest.compile import Record, compiled
from piezoest.equations import least_squares, turning_points
from piezoest.equations.integrators import NODES
from piezoest.estimators.delay_line import delay_line, delayed
from piezoest.export.c_file import File
from piezoest.export.c_translator import translate
from piezoest.export.c_values import (
    Array,
    Known,
    Number,
    Root,
    Struct,
    TranslationError,
    Value,
    literal,
    members,
)
from piezoest.export.compiled import build_shared
from piezoest.layout import ABSENT, COVARIANCE, FIXED, NUMBER, Length, new, numbers, record

LAST, FIRST = 2, 0


def array(name: str, *shape: int) -> Array:
    return Array(name, shape, Root(name))


def struct(layout: Any, name: str = "state", **values: Any) -> Struct:
    return Struct(f"{name}->", layout, new(layout, **values), Root(name), name)


def constants(layout: Any, **values: Any) -> Struct:
    return Struct("", layout, new(layout, **values), Root(""), "settings", constant=True)


def reals(*names: str) -> list[Value]:
    return [Number(name, "real") for name in names]


def text_of(function: Any, *arguments: Value) -> tuple[str, str]:
    """Text of the file, and the name of the function in C."""
    file = File("test", "double")
    made, _ = translate(file, function, list(arguments))
    functions = file.text(f"{made.name}()")
    types = "".join(text for _, text in file.types.values())
    head = functions.replace(f"static void {made.name}", f"void {made.name}")
    head = head.replace(f"static double {made.name}", f"double {made.name}")
    return f"#include <math.h>\n{types}{head}", made.name


def build(folder: Path, function: Any, *arguments: Value) -> Callable[..., Any]:
    text, name = text_of(function, *arguments)
    (folder / "one.c").write_text(text, encoding="utf-8")
    build_shared(folder, ["one.c"], folder / f"{name}.so", "-Wall", "-Wextra", "-Werror")
    made = getattr(ctypes.CDLL(str(folder / f"{name}.so")), name)
    made.restype = ctypes.c_double
    return made


def pointer(values: Any) -> Any:
    return ctypes.c_void_p(values.ctypes.data)


LAW = record(theta=numbers(4), P=numbers(4, 4, kind=COVARIANCE), phi=numbers(4), y=NUMBER, S=NUMBER)
GIVEN = record(forgetting=FIXED, noise=FIXED)


@compiled
def learn(law: Record, settings: Record, z: float) -> float:
    """One sample of recursive least squares."""
    law.y, law.S = least_squares.discrete_update(
        law.theta, law.P, law.phi, z, settings.forgetting, settings.noise, 1e9
    )
    return law.y


def test_update_of_a_record_is_the_same(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    L = rng.normal(size=(4, 4))
    start = {"theta": rng.normal(size=4), "P": L @ L.T, "phi": rng.normal(size=4)}
    given_ = {"forgetting": 0.99, "noise": 0.1}
    ours, theirs, settings = new(LAW, **start), new(LAW, **start), new(GIVEN, **given_)
    function = build(tmp_path, learn, struct(LAW, "law"), constants(GIVEN, **given_), *reals("z"))
    function.argtypes = [ctypes.c_void_p, ctypes.c_double]  # type: ignore[attr-defined]
    for z in rng.normal(size=100).tolist():
        assert function(pointer(theirs), z) == learn.of(LAW, GIVEN)(ours, settings, z)
        assert theirs.tobytes() == ours.tobytes()


LINE, BEGUN = delay_line(2.3)
PATH = record(line=LINE, memory=turning_points.TURNING_POINTS, none=ABSENT)


@compiled
def remember(path: Record, u: float, r: float) -> float:
    """A play behind a delay."""
    turning_points.remember(path.memory, delayed(path.line, delayed(path.none, u)))
    return turning_points.recall(path.memory, r)


def test_branches_loops_and_lengths_are_the_same(tmp_path: Path) -> None:
    assert isinstance(LINE.by_name["voltages"].shape[0], Length)  # type: ignore[union-attr]
    state = new(PATH, line=BEGUN)
    function = build(tmp_path, remember, struct(PATH, "path", line=BEGUN), *reals("u", "r"))
    function.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double]  # type: ignore[attr-defined]
    # What is fixed is no member: the rest stands in the order of C.
    own = np.concatenate([[0.0] * 42, [-1.0], [0.0] * 3])
    assert list(members(PATH)) == ["memory", "line"]
    rng = np.random.default_rng(1)
    for u in np.cumsum(rng.normal(size=2000)).tolist():
        assert function(pointer(own), u, 0.7) == remember.of(PATH)(state, u, 0.7)


# ---------------------------------------------------------------- names


NESTED = record(swing=record(size=NUMBER, turns=numbers(3)), gain=NUMBER)


def misspelt(state: Any) -> Any:
    return state.swing.sise


def test_a_misspelt_field_is_refused() -> None:
    with pytest.raises(TranslationError, match=r"state\.swing has no field sise"):
        text_of(misspelt, struct(NESTED))


# ---------------------------------------------------------------- known values


def choose(x: Any, way: int) -> Any:
    if way == FIRST:
        return x + 1.0
    return x * NODES[LAST]


def test_known_branch_is_all_that_is_left() -> None:
    text, _ = text_of(choose, *reals("x"), Known(1))
    assert "if" not in text
    assert "x * 0.75" in text


def changed(x: Any, way: int) -> Any:
    if x > 0.0:
        way = 4
    return x * way


def test_a_known_number_that_changes_is_a_variable(tmp_path: Path) -> None:
    function = build(tmp_path, changed, *reals("x"), Known(3))
    function.argtypes = [ctypes.c_double, ctypes.c_int]  # type: ignore[attr-defined]
    assert (function(2.0, 3), function(-2.0, 3)) == (8.0, -6.0)


def where_there_is_one(x: Any, line: Any) -> Any:
    if line is not None and x > 0.0:
        x += line.gain
    return x if line is None else 2.0 * x


def test_what_is_not_handed_over_is_left_out() -> None:
    without, _ = text_of(where_there_is_one, *reals("x"), Known(None))
    assert "return x;" in without
    assert "line" not in without
    with_one, _ = text_of(where_there_is_one, *reals("x"), struct(NESTED, "line"))
    assert "line->gain" in with_one
    assert "2.0 * x" in with_one


# ---------------------------------------------------------------- order


def _count(state: Any) -> Any:
    state.gain += 1.0
    return state.gain


def ignores(none: Any, value: Any) -> Any:
    return 1.0 if none is None else value


def does_it_all_the_same(state: Any) -> Any:
    one = ignores(None, _count(state))
    return one + state.gain


def test_a_call_in_an_argument_that_is_not_used_is_made(tmp_path: Path) -> None:
    own = np.array([0.0, 0.0, 0.0, 0.0, 3.0])
    function = build(tmp_path, does_it_all_the_same, struct(NESTED))
    assert function(pointer(own)) == 5.0


def in_order(state: Any) -> Any:
    state.gain = state.gain * 10.0 + _count(state) * _count(state) - state.gain
    return state.gain


def test_operands_come_from_left_to_right(tmp_path: Path) -> None:
    own = np.array([0.0, 0.0, 0.0, 0.0, 3.0])
    function = build(tmp_path, in_order, struct(NESTED))
    assert function(pointer(own)) == 30.0 + 4.0 * 5.0 - 5.0


@pytest.mark.parametrize(
    ("value", "double", "single"),
    [
        (0.1, "0.1", "0.1f"),
        (1e-300, "1e-300", "1.1754944e-38f"),
        (1e300, "1e+300", "3.4028235e+38f"),
        (np.inf, "HUGE_VAL", "HUGE_VALF"),
        (3.0, "3.0", "3.0f"),
        (1e9, "1000000000.0", "1.0e+09f"),
    ],
)
def test_literals(value: float, double: str, single: str) -> None:
    assert literal(value, False) == double
    assert literal(value, True) == single
    assert float(double) == value if np.isfinite(value) else True


# ---------------------------------------------------------------- arithmetic


@compiled
def arithmetic(u: float, x: float) -> float:
    """All at once."""
    total = 0.0
    for i in range(1, 12, 3):
        place, rest = i // 4, i % 4
        total += (u + place) ** 2 - rest * 2.0**x
    inside = -1.0 < u - x <= x < 3.0
    total += max(u, x, 0.5, total) if inside and np.isfinite(u) else min(x, u, -0.5)
    return total


def test_arithmetic_is_the_same(tmp_path: Path) -> None:
    function = build(tmp_path, arithmetic, *reals("u", "x"))
    function.argtypes = [ctypes.c_double] * 2  # type: ignore[attr-defined]
    every = np.array([-np.inf, -2.0, -0.7, 0.0, 0.3, 1.0, 2.9, 3.0, 17.0])
    for u in every.tolist():
        for x in every[1:].tolist():
            np.testing.assert_array_equal(function(u, x), arithmetic(u, x))


# ---------------------------------------------------------------- refusals


def with_a_list(x: Any) -> Any:
    return [x]


def with_a_step(x: Any) -> None:
    for i in range(0, 10, int(x[0])):
        x[i] = 0.0


def with_a_power(x: Any) -> Any:
    return x**3


def with_keywords(x: Any) -> Any:
    return choose(x, way=1)


def with_a_default(x: Any = 1.0) -> Any:
    return x


def with_a_condition_of_a_number(x: Any) -> Any:
    if x:
        return 1.0
    return 0.0


def writes(x: Any) -> Any:
    x[0] = 2.0
    return x[0]


def with_a_slice(x: Any) -> Any:
    return x[1:]


def with_a_hidden_write(x: Any) -> Any:
    return x[0] if x[1] > 0.0 else x[0] + writes(x)


def with_itself(x: Any) -> Any:
    return with_itself(x)


def with_text(x: Any) -> Any:
    return x.title()


@pytest.mark.parametrize(
    ("function", "word"),
    [
        (with_a_list, "List"),
        (with_a_step, "range with a step"),
        (with_a_power, "write x * x"),
        (with_keywords, "positional"),
        (with_a_default, "default"),
        (with_a_slice, "slice"),
        (with_a_hidden_write, "put it into a name first"),
        (with_itself, "calls itself"),
        (with_text, "title"),
    ],
)
def test_what_is_not_in_the_subset_is_refused(function: Any, word: str) -> None:
    arrays = (with_a_step, with_a_slice, with_a_hidden_write)
    argument = array("x", 10) if function in arrays else Number("x", "real")
    with pytest.raises(TranslationError, match=re.escape(word)) as refusal:
        text_of(function, argument)
    assert "test_translator.py:" in str(refusal.value)


def test_a_condition_must_be_one() -> None:
    with pytest.raises(TranslationError, match="comparison"):
        text_of(with_a_condition_of_a_number, *reals("x"))


def test_constant_arrays_cannot_be_written() -> None:
    layout = record(weights=numbers(3, kind=FIXED))
    weights = constants(layout, weights=[1.0, 2.0, 3.0]).field("weights")
    with pytest.raises(TranslationError, match="constant"):
        text_of(writes, weights)
