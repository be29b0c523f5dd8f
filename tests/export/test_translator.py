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


def build(folder: Path, function: Any, *arguments: Value) -> Callable[..., Any]:
    file = File("test", "double")
    name = translate(file, function, list(arguments))[0].name
    text = "".join(text for _, text in file.types.values()) + file.text(f"{name}()")
    text = re.sub(rf"static (void|double) {name}", rf"\1 {name}", text)
    (folder / "one.c").write_text(f"#include <math.h>\n{text}", encoding="utf-8")
    build_shared(folder, ["one.c"], folder / "one.so", "-Wall", "-Wextra", "-Werror")
    made = getattr(ctypes.CDLL(str(folder / "one.so")), name)
    made.restype = ctypes.c_double
    return made


def _count(state: Any) -> Any:
    state.gain += 1.0
    return state.gain


def _ignores(none: Any, value: Any) -> Any:
    return 1.0 if none is None else value


def in_order(state: Any) -> Any:
    one = _ignores(None, _count(state))
    state.gain = state.gain * 10.0 + _count(state) * _count(state) - state.gain
    return one + state.gain


def test_calls_are_made_from_left_to_right(tmp_path: Path) -> None:
    own = np.array([3.0])
    expected = 1.0 + 40.0 + 5.0 * 6.0 - 6.0
    assert build(tmp_path, in_order, STATE)(ctypes.c_void_p(own.ctypes.data)) == expected


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


def _writes(x: Any) -> Any:
    x[0] = 2.0
    return x[0]


def with_a_hidden_write(x: Any) -> Any:
    return x[0] if x[1] > 0.0 else x[0] + _writes(x)


def test_what_cannot_be_translated_is_refused_with_its_line() -> None:
    with pytest.raises(TranslationError, match=r"test_translator\.py:\d+: .*put it into a name first"):
        translate(File("test", "double"), with_a_hidden_write, [Array("x", (10,), Root("x"))])
