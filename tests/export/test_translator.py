"""The translator on small functions: what it makes of them, and what it refuses."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezoest.equations import admissible, coleman_hodgdon, least_squares, play
from piezoest.equations.integrators import NODES, bogacki_shampine
from piezoest.export import c_text
from piezoest.export.c_translator import Translator
from piezoest.export.c_values import Array, Expr, Known, Root, TranslationError, literal
from piezoest.export.compiled import build_shared

STATE, LAST, FIRST = 3, 2, 0


def array(name: str, size: int | None = None) -> Array:
    return Array(name, Root(), size=size)


def translate(function: Any, *arguments: Any) -> tuple[str, Translator, str]:
    """Text of the file, the translator, and the name of the function in C."""
    translator = Translator(real="double", single=False)
    made, _ = translator.function(function, list(arguments))
    functions = "\n".join(c_text._function(f, translator) for f in translator.functions)
    positions = c_text._enum(translator.positions) if translator.positions else ""
    text = (
        f"#include <math.h>\n{positions}{c_text._tables(translator)}{c_text._helpers(translator)}{functions}"
    )
    return (
        text.replace(f"static void {made.name}", f"void {made.name}").replace(
            f"static double {made.name}", f"double {made.name}"
        ),
        translator,
        made.name,
    )


def build(folder: Path, function: Any, *arguments: Any) -> Callable[..., Any]:
    text, _, name = translate(function, *arguments)
    (folder / "one.c").write_text(text, encoding="utf-8")
    build_shared(folder, ["one.c"], folder / f"{name}.so")
    return getattr(ctypes.CDLL(str(folder / f"{name}.so")), name)


def pointer(values: Any) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


REAL = [Expr(name, "real") for name in "abcde"]


@pytest.fixture(scope="module")
def inverse_increment(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    function = build(tmp_path_factory.mktemp("c"), coleman_hodgdon.inverse_increment, *REAL)
    function.argtypes, function.restype = [ctypes.c_double] * 5, ctypes.c_double  # type: ignore[attr-defined]
    return function


@given(st.floats(-1.0, 1.0), st.floats(-50.0, 50.0), st.floats(0.5, 1.0))
def test_inverse_increment_is_the_same(
    inverse_increment: Callable[..., Any], place: float, dr: float, part: float
) -> None:
    a, c = 0.02, 0.18
    b = 0.5 * part * c
    arguments = place * b / a, dr, a, b, c
    # NumPy's expm1 may differ from the C library's by one unit in the last place.
    assert inverse_increment(*arguments) == pytest.approx(
        float(coleman_hodgdon.inverse_increment(*arguments)), rel=1e-14, abs=1e-300
    )


def test_update_in_place_is_the_same(tmp_path: Path) -> None:
    n = 4
    rng = np.random.default_rng(0)
    L = rng.normal(size=(n, n))
    theta, P, phi, work = rng.normal(size=n), (L @ L.T).ravel(), rng.normal(size=n), np.zeros(n)
    arrays = [theta, P, phi]
    function = build(
        tmp_path, least_squares.discrete_update, array("theta"), array("P"), array("phi"), Expr("z", "real"),
        Known(n), *(Expr(name, "real") for name in ("forgetting", "R", "bound", "enable")), array("work"),
    )  # fmt: skip
    ours: Any = [values.copy() for values in arrays]
    update: Any = least_squares.discrete_update
    y, S = update(*ours, 1.5, n, 0.99, 0.1, 1e9, 1.0, work.copy())
    results = np.zeros(1), np.zeros(1)
    function.argtypes = [*[type(pointer(theta))] * 3, *[ctypes.c_double] * 5, *[type(pointer(theta))] * 3]  # type: ignore[attr-defined]
    function(*map(pointer, arrays), 1.5, 0.99, 0.1, 1e9, 1.0, pointer(work), *map(pointer, results))
    for mine, theirs in zip(arrays, ours, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert (results[0][0], results[1][0]) == (y, S)


def test_prandtl_ishlinskii_is_the_same(tmp_path: Path) -> None:
    n = 12
    thresholds, weights = np.linspace(0.5, 30.0, n), np.full(n, 0.01)
    tables = [array("y", n), Expr("w", "real"), Expr("gain", "real"), array("thresholds"), array("weights")]
    function = build(tmp_path, play.prandtl_ishlinskii_inverse_step, *tables)
    y, own = np.zeros(n), np.zeros(n)
    kind = type(pointer(y))
    function.argtypes = [kind, ctypes.c_double, ctypes.c_double, kind, kind]  # type: ignore[attr-defined]
    function.restype = ctypes.c_double  # type: ignore[attr-defined]
    for w in 5.0 * np.sin(np.linspace(0.0, 20.0, 500)):
        theirs = play.prandtl_ishlinskii_inverse_step(y, float(w), 0.1, thresholds, weights)
        assert function(pointer(own), w, 0.1, pointer(thresholds), pointer(weights)) == theirs


# ---------------------------------------------------------------- known values


def choose(x: Any, way: int) -> Any:
    if way == FIRST:
        return x + 1.0
    return x * NODES[LAST]


def test_known_branch_is_all_that_is_left() -> None:
    text, _, _ = translate(choose, Expr("x", "real"), Known(1))
    assert "if" not in text
    assert "x * 0.75" in text


def part_of(state: Any, i: int) -> Any:
    inner = state[STATE:]
    inner[i] += 1.0
    return inner[LAST] * inner.size


def test_positions_keep_their_names_and_unused_parameters_go() -> None:
    text, translator, _ = translate(part_of, array("state", 8), Expr("i", "int"))
    assert "double *inner = state + TEST_TRANSLATOR_STATE;" in text
    assert "inner[TEST_TRANSLATOR_LAST] * 5.0" in text
    assert translator.positions == {"TEST_TRANSLATOR_STATE": 3, "TEST_TRANSLATOR_LAST": 2}


def read_only(state: Any, unused: Any) -> Any:
    return state[0] + state[1]


def test_what_is_not_written_is_const() -> None:
    text, _, _ = translate(read_only, array("state"), Expr("x", "real"))
    assert "(const double *state)" in text


def integrate(x: Any, a: Any) -> Any:
    return bogacki_shampine(coleman_hodgdon.inverse_rate, x, 1.0, (0.1, a, 0.05, 0.2))


def test_functions_and_tuples_are_passed_through() -> None:
    text, _, _ = translate(integrate, Expr("x", "real"), Expr("a", "real"))
    assert text.count("coleman_hodgdon_inverse_rate(") == 4


def where_there_is_one(x: Any, line: Any) -> Any:
    if line is not None and x > 0.0:
        x += line[0]
    return x if line is None else 2.0 * x


def test_what_is_not_handed_over_is_left_out() -> None:
    without, _, _ = translate(where_there_is_one, Expr("x", "real"), Known(None))
    assert "return x;" in without
    assert "line" not in without
    with_one, _, _ = translate(where_there_is_one, Expr("x", "real"), array("line"))
    assert "line[0]" in with_one
    assert "2.0 * x" in with_one


def test_same_function_is_translated_once_for_each_size() -> None:
    translator = Translator(real="double", single=False)
    for n in (3, 4, 3):
        translator.function(least_squares.trace, [array("P"), Known(n)])
    assert [f.name for f in translator.functions] == ["least_squares_trace", "least_squares_trace_2"]


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


# ---------------------------------------------------------------- refusals


def with_a_list(x: Any) -> Any:
    return [x]


def with_a_step(x: Any) -> None:
    for i in range(0, 10, 2):
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


def with_an_open_order(x: Any) -> Any:
    return x[0] + writes(x)


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
        (with_an_open_order, "put its result into a name first"),
        (with_itself, "calls itself"),
        (with_text, "title"),
    ],
)
def test_what_is_not_in_the_subset_is_refused(function: Any, word: str) -> None:
    arrays = (with_a_step, with_an_open_order)
    argument = array("x", 10) if function in arrays else Expr("x", "real")
    with pytest.raises(TranslationError, match=re.escape(word)) as refusal:
        translate(function, argument)
    assert "test_translator.py:" in str(refusal.value)


def test_a_condition_must_be_one() -> None:
    with pytest.raises(TranslationError, match="comparison"):
        translate(with_a_condition_of_a_number, Expr("x", "real"))


def test_constant_arrays_cannot_be_written() -> None:
    translator = Translator(real="double", single=False)
    with pytest.raises(TranslationError, match="constant"):
        translator.function(writes, [translator.table("numbers", (1.0, 2.0))])


@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_nearest_admissible_has_an_inverse(factors: list[float]) -> None:
    theta = np.array([0.02, 0.12, 0.0036]) * factors
    admissible.nearest_admissible(theta, np.empty(9), admissible.NEAREST_MARGIN)
    assert admissible.has_inverse(*theta)
