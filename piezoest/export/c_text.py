"""The text of a generated header and source, around what the translator made."""

from __future__ import annotations

import inspect
import math
import re
from typing import TYPE_CHECKING, Any

from piezoest.compensators import base
from piezoest.export import c_printer as printer
from piezoest.export import ring
from piezoest.export.c_translator import Function, Translator
from piezoest.export.c_values import literal

if TYPE_CHECKING:
    from piezoest.export.c_code import _Generator

LICENCE = """Copyright (c) The piezoest developers. MIT licence: permission is granted, free of charge, to
use, copy, modify, merge, publish, distribute, sublicense and sell this code, provided that this notice
stays in it. It comes as is, without warranty of any kind."""

_CHANGE = """
/* Use another model, without a bump; freeze before, or the next one learnt replaces it. An inadmissible
 * model is replaced by its nearest admissible one; returns 0, and changes nothing, if there is none. */
""".strip()
_NO_CHANGE = "/* The model of this controller is fixed: returns 0, and changes nothing. */"

_HELPERS = {
    "sign": "return (real)((x > 0) - (x < 0));",
    "larger": "return b > a ? b : a;",
    "smaller": "return b < a ? b : a;",
    "larger_number": "return a >= b || b != b ? a : b;",
    "smaller_number": "return a <= b || b != b ? a : b;",
}
# exp(x) - 1 loses its digits near zero. In double it is math.h's expm1, the one that the library runs:
# with exponential forgetting the ring makes 1e-10 of a difference in the last digit. In float a power
# series does, and is several times faster on a small target; from the end on nothing is left of exp(-x).
_SERIES_LIMIT, _SERIES_TERMS, _SERIES_END = 0.35, 7, 20.0


def header(made: _Generator) -> str:
    """Text of the header."""
    name, real = made.name, made.precision
    guard = f"{name.upper()}_H"
    kind = "alpha [1/V], beta [um/V], gamma [um/V^2]" if made.hysteretic else "gain [um/V], 0, 0"
    change = _CHANGE if made.change is not None else _NO_CHANGE
    members = "\n".join(
        f"    {real} {member}[{values.size}]; /* {meaning} */" for member, values, meaning in made.members
    )
    return f"""{_head(made)}
#ifndef {guard}
#define {guard}

#ifdef __cplusplus
extern "C" {{
#endif

/* All that changes while the controller runs. */
typedef struct {{
{members}
}} {name}_state;

/* Start, or start anew: before the first step. */
void {name}_init({name}_state *state);

/* One sample: the next reference r [um] and the displacement x [um] measured after the previous voltage.
 * Returns the voltage [V], within the limits. NaN or infinity in r holds the voltage, in x it is a missing
 * measurement; the first x is not looked at. */
{real} {name}_step({name}_state *state, {real} r, {real} x);

/* Hold the model (1) or learn on (0). */
void {name}_freeze({name}_state *state, int frozen);

/* Voltage given out last [V]. */
{real} {name}_get_voltage(const {name}_state *state);

/* Model in use: {kind}, offset [um]. */
void {name}_get_parameters(const {name}_state *state, {real} parameters[4]);

{change}
int {name}_set_parameters({name}_state *state, const {real} parameters[4]);

/* Limits of the voltage [V]. */
void {name}_get_limits(const {name}_state *state, {real} *minimum, {real} *maximum);

/* Returns 0, and changes nothing, unless minimum < maximum. */
int {name}_set_limits({name}_state *state, {real} minimum, {real} maximum);

#ifdef __cplusplus
}}
#endif

#endif
"""


def source(made: _Generator, entries: dict[str, str]) -> str:
    """Text of the source."""
    name, real, translator = made.name, made.precision, made.translator
    zero, one = literal(0.0, translator.single), literal(1.0, translator.single)
    functions = "\n".join(_function(function, translator) for function in translator.functions)
    learn = "    (void)x;\n"
    if "learn" in entries:
        learn = f"    if (state->ring[RING_STARTED] != {zero}) {{\n        {entries['learn']};\n    }}\n"
    starts = "\n".join(
        f"static const {real} start_{member}[{values.size}] = {_numbers(values, translator.single)};"
        for member, values, _ in made.members
    )
    copies = "\n".join(
        f"    for (int i = 0; i < {values.size}; ++i) {{\n"
        f"        state->{member}[i] = start_{member}[i];\n    }}"
        for member, values, _ in made.members
    )
    around = {f"RING_{key}": getattr(ring, key) for key in ("PREVIOUS", "STARTED", "FROZEN", "MODEL")}
    around |= {f"COMPENSATORS_{key}": getattr(base, key) for key in ("MINIMUM", "MAXIMUM")}
    words = set(re.findall(r"[A-Z][A-Z_0-9]+", functions))
    positions = around | {key: value for key, value in translator.positions.items() if key in words}
    return f"""{_head(made)}
#include "{name}.h"

#include <math.h>

{_enum(positions)}
{_tables(translator)}/* State at the start. */
{starts}

{_helpers(translator)}
{functions}
void {name}_init({name}_state *state)
{{
{copies}
}}

{real} {name}_step({name}_state *state, {real} r, {real} x)
{{
{learn}    return {entries["give"]};
}}

void {name}_freeze({name}_state *state, int frozen)
{{
    state->ring[RING_FROZEN] = frozen != 0 ? {one} : {zero};
}}

{real} {name}_get_voltage(const {name}_state *state)
{{
    return state->ring[RING_PREVIOUS];
}}

void {name}_get_parameters(const {name}_state *state, {real} parameters[4])
{{
    for (int i = 0; i < 4; ++i) {{
        parameters[i] = state->ring[RING_MODEL + i];
    }}
}}

int {name}_set_parameters({name}_state *state, const {real} parameters[4])
{{
{_set_parameters(real, entries.get("adopt"))}}}

void {name}_get_limits(const {name}_state *state, {real} *minimum, {real} *maximum)
{{
    *minimum = state->settings[COMPENSATORS_MINIMUM];
    *maximum = state->settings[COMPENSATORS_MAXIMUM];
}}

int {name}_set_limits({name}_state *state, {real} minimum, {real} maximum)
{{
    if (!(minimum < maximum)) {{
        return 0;
    }}
    state->settings[COMPENSATORS_MINIMUM] = minimum;
    state->settings[COMPENSATORS_MAXIMUM] = maximum;
    return 1;
}}
"""


def _set_parameters(real: str, adopt: str | None) -> str:
    """Body of the function of that name."""
    if adopt is None:
        return "    (void)state;\n    (void)parameters;\n    return 0;\n"
    return f"""    {real} model[4];

    for (int i = 0; i < 4; ++i) {{
        model[i] = parameters[i];
    }}
    if (!{adopt}) {{
        return 0;
    }}
    for (int i = 0; i < 4; ++i) {{
        state->ring[RING_MODEL + i] = model[i];
    }}
    return 1;
"""


def _head(made: _Generator) -> str:
    lines = [*made.provenance, "", *LICENCE.splitlines()]
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in lines), " */"])


def _enum(positions: dict[str, int]) -> str:
    rows = sorted(positions.items(), key=lambda item: (item[0].rsplit("_", 1)[0], item[1], item[0]))
    body = ",\n".join(f"    {name} = {value}" for name, value in rows)
    return f"/* Positions in the arrays. */\nenum {{\n{body}\n}};\n"


def _tables(translator: Translator) -> str:
    return "".join(
        f"static const {translator.real} {name}[{len(values)}] = {_numbers(values, translator.single)};\n"
        for name, values in sorted(translator.tables.items())
    )


def _numbers(values: Any, single: bool) -> str:
    texts = [literal(float(value), single) for value in values]
    rows = [", ".join(texts[i : i + 6]) for i in range(0, len(texts), 6)]
    inner = ",\n    ".join(rows)
    return f"{{\n    {inner}\n}}"


def _helpers(translator: Translator) -> str:
    real = translator.real
    found = []
    for name in sorted(translator.helpers):
        if name == "exp_minus_one":
            found.append(_exp_minus_one(translator))
            continue
        arguments = f"{real} x" if name == "sign" else f"{real} a, {real} b"
        body = _HELPERS[name].replace("(real)", f"({real})")
        found.append(f"static {real} {name}({arguments})\n{{\n    {body}\n}}\n")
    return "\n".join(found)


def _exp_minus_one(translator: Translator) -> str:
    if not translator.single:
        return """/* exp(x) - 1, exact near zero. */
static double exp_minus_one(double x)
{
    return expm1(x);
}
"""
    return f"""/* exp(x) - 1: by the power series of a half, a quarter, ... of x, doubled as often. */
static float exp_minus_one(float x)
{{
    if (!(fabsf(x) < {_SERIES_END}f)) {{
        return expf(x) - 1.0f;
    }}
    int halved = 0;
    while (fabsf(x) > {_SERIES_LIMIT}f) {{
        x *= 0.5f;
        ++halved;
    }}
    float found = x * {_series()};
    while (halved > 0) {{
        found *= 2.0f + found;
        --halved;
    }}
    return found;
}}
"""


def _series() -> str:
    """Horner's form of (exp(x) - 1) / x."""
    text = literal(1.0 / math.factorial(_SERIES_TERMS), True)
    for n in range(_SERIES_TERMS - 1, 0, -1):
        text = f"({literal(1.0 / math.factorial(n), True)} + x * {text})"
    return text


def _function(function: Function, translator: Translator) -> str:
    docstring = inspect.getdoc(function.source.function) or ""
    first = docstring.split("\n\n")[0].split("\n")
    where = f"({function.source.file})"
    comment = [line.replace("*/", "* /") for line in first if line.strip()] + [where]
    opening = "\n".join([f"/* {comment[0]}", *(f" * {line}" for line in comment[1:])]) + " */"
    body = "\n".join(printer.print_statements(function.body, 1))
    return f"{opening}\n{function.signature(translator.real)}\n{{\n{body}\n}}\n"
