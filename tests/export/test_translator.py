"""The translator on small functions: what it makes of them, and what it refuses."""

import ctypes
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest.compile import compiled
from piezoest.export.c_file import File
from piezoest.export.c_translator import translate
from piezoest.export.c_values import Array, Number, Root, Struct, TranslationError, Value
from piezoest.export.compiled import build_shared
from piezoest.layout import NUMBER, new, record

LAYOUT = record(gain=NUMBER)
STATE = Struct("state->", LAYOUT, new(LAYOUT), Root("state"), "state")


def text_of(function: Any, *arguments: Value) -> tuple[str, str]:
    """Text of the file, and the name of the function in C."""
    file = File("test", "double")
    made, _ = translate(file, function, list(arguments))
    text = "".join(text for _, text in file.types.values()) + file.text(f"{made.name}()")
    text = re.sub(rf"static (void|double) {made.name}", rf"\1 {made.name}", text)
    return f"#include <math.h>\n{text}", made.name


def build(folder: Path, function: Any, *arguments: Value) -> Callable[..., Any]:
    text, name = text_of(function, *arguments)
    (folder / "one.c").write_text(text, encoding="utf-8")
    build_shared(folder, ["one.c"], folder / f"{name}.so", "-Wall", "-Wextra", "-Werror")
    made = getattr(ctypes.CDLL(str(folder / f"{name}.so")), name)
    made.restype = ctypes.c_double
    return made


def _count(state: Any) -> Any:
    state.gain += 1.0
    return state.gain


def ignores(none: Any, value: Any) -> Any:
    return 1.0 if none is None else value


def unused_argument(state: Any) -> Any:
    one = ignores(None, _count(state))
    return one + state.gain


def in_order(state: Any) -> Any:
    state.gain = state.gain * 10.0 + _count(state) * _count(state) - state.gain
    return state.gain


@pytest.mark.parametrize(("function", "value"), [(unused_argument, 5.0), (in_order, 30.0 + 4.0 * 5.0 - 5.0)])
def test_calls_are_made_from_left_to_right(tmp_path: Path, function: Any, value: float) -> None:
    own = np.array([3.0])
    assert build(tmp_path, function, STATE)(ctypes.c_void_p(own.ctypes.data)) == value


@compiled
def arithmetic(u: float, x: float) -> float:
    total = 0.0
    for i in range(1, 12, 3):
        place, rest = i // 4, i % 4
        total += (u + place) ** 2 - rest * 2.0**x
    inside = -1.0 < u - x <= x < 3.0
    total += max(u, x, 0.5, total) if inside and np.isfinite(u) else min(x, u, -0.5)
    return total


def test_arithmetic_is_the_same(tmp_path: Path) -> None:
    function = build(tmp_path, arithmetic, Number("u", "real"), Number("x", "real"))
    function.argtypes = [ctypes.c_double] * 2  # type: ignore[attr-defined]
    every = np.array([-np.inf, -2.0, -0.7, 0.0, 0.3, 1.0, 2.9, 3.0, 17.0])
    for u in every.tolist():
        for x in every[1:].tolist():
            np.testing.assert_array_equal(function(u, x), arithmetic(u, x))


def with_a_step(x: Any) -> None:
    for i in range(0, 10, int(x[0])):
        x[i] = 0.0


def writes(x: Any) -> Any:
    x[0] = 2.0
    return x[0]


def with_a_slice(x: Any) -> Any:
    return x[1:]


def with_a_hidden_write(x: Any) -> Any:
    return x[0] if x[1] > 0.0 else x[0] + writes(x)


def with_itself(x: Any) -> Any:
    return with_itself(x)


@pytest.mark.parametrize(
    ("function", "word"),
    [
        (with_a_step, "range with a step"),
        (with_a_slice, "slice"),
        (with_a_hidden_write, "put it into a name first"),
        (with_itself, "calls itself"),
    ],
)
def test_what_is_not_in_the_subset_is_refused(function: Any, word: str) -> None:
    arrays = (with_a_step, with_a_slice, with_a_hidden_write)
    argument = Array("x", (10,), Root("x")) if function in arrays else Number("x", "real")
    with pytest.raises(TranslationError, match=re.escape(word)) as refusal:
        text_of(function, argument)
    assert "test_translator.py:" in str(refusal.value)
