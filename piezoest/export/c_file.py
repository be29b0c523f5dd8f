"""What one file of C is made of: types, constant tables, helpers and functions."""

from __future__ import annotations

import inspect
import math
from dataclasses import dataclass, field
from typing import Any

from piezoest import layout as named
from piezoest._checks import FloatArray
from piezoest.export.c_printer import Statement, comment, print_statements
from piezoest.export.c_source import Source
from piezoest.export.c_values import Known, Root, literal, members

_HELPERS = {
    "sign": "return (real)((x > 0) - (x < 0));",
    "larger": "return b > a ? b : a;",
    "smaller": "return b < a ? b : a;",
    "larger_number": "return a >= b || b != b ? a : b;",
    "smaller_number": "return a <= b || b != b ? a : b;",
    "exp_minus_one": "return expm1(x);",
    "squared": "return x * x;",
}
# exp(x) - 1 loses its digits near zero. In double it is math.h's expm1, the one that the library runs:
# with exponential forgetting the loop makes 1e-10 of a difference in the last digit. In float a power
# series does, and is several times faster on a small target; from the end on nothing is left of exp(-x).
_SERIES_LIMIT, _SERIES_TERMS, _SERIES_END = 0.35, 7, 20.0
_SERIES = f"""/* By the power series of a half, a quarter, ... of x, doubled as often. */
    if (!(fabsf(x) < {_SERIES_END}f)) {{
        return expf(x) - 1.0f;
    }}
    int halved = 0;
    while (fabsf(x) > {_SERIES_LIMIT}f) {{
        x *= 0.5f;
        ++halved;
    }}
    float found = x * @series@;
    while (halved > 0) {{
        found *= 2.0f + found;
        --halved;
    }}
    return found;"""


@dataclass(eq=False)
class Function:
    """A translated function: C's name and signature, and what it writes into."""

    name: str
    source: Source
    parameters: list[tuple[int, Root, str]]  # place among the flattened arguments, and its declaration
    returns: tuple[str, ...]  # kinds; more than one go out through pointers
    body: list[Statement]
    impure: bool
    constant: Known | None = None  # what it always returns, if that is known

    def text(self, file: File) -> str:
        """Its definition."""
        parts = [declaration for _, _, declaration in self.parameters]
        if len(self.returns) > 1:
            parts += [f"{file.type_of(kind)} *result_{i}" for i, kind in enumerate(self.returns)]
        result = file.type_of(self.returns[0]) if len(self.returns) == 1 else "void"
        docstring = inspect.getdoc(self.source.function) or ""
        first = [line.replace("*/", "* /") for line in docstring.split("\n\n")[0].split("\n") if line]
        opening = "\n".join(comment([*first, f"({self.source.file})"]))
        body = "\n".join(print_statements(self.body, 1))
        return f"{opening}\nstatic {result} {self.name}({', '.join(parts) or 'void'})\n{{\n{body}\n}}\n"


@dataclass(eq=False)
class File:
    """Everything that one C file is made of."""

    prefix: str  # what the names of its types begin with
    real: str  # name of the type of real numbers in C, ``"double"`` or ``"float"``
    unneeded: tuple[Any, ...] = ()  # functions whose calls, as statements, are left out
    # Constants, by module and name, that have another value here.
    coarser: dict[tuple[str, str], float] = field(default_factory=dict)
    functions: dict[Any, Function] = field(default_factory=dict)
    in_work: list[Any] = field(default_factory=list)
    tables: dict[str, FloatArray] = field(default_factory=dict)
    helpers: set[str] = field(default_factory=set)
    types: dict[named.Record, tuple[str, str]] = field(default_factory=dict)

    @property
    def single(self) -> bool:
        """Whether real numbers are float."""
        return self.real == "float"

    def type_of(self, kind: str) -> str:
        """C's type of a number."""
        return self.real if kind == "real" else "int"

    def struct(self, layout: named.Record, path: str) -> str:
        """Name of the type of a record, which is made with those inside it; `path` says where it stands."""
        if layout not in self.types:
            names = path.split(".")
            others = {name for name, _ in self.types.values()}
            short = f"{self.prefix}_{names[-1]}"
            name = self.unused(
                short if short not in others else f"{self.prefix}_{'_'.join(names[1:])}", others
            )
            self.types[layout] = name, ""  # taken, while those inside get theirs, which stand before it
            rows = [self._member(member, inner, path) for member, inner in members(layout).items()]
            del self.types[layout]
            text = f"/* {path} */\ntypedef struct {{\n{''.join(rows)}}} {name};\n"
            self.types[layout] = name, text
        return self.types[layout][0]

    def _member(self, name: str, field: Any, path: str) -> str:
        shape = "".join(f"[{count}]" for count in getattr(field, "counts", ()))
        if isinstance(field, named.Record):
            return f"    {self.struct(field, f'{path}.{name}')} {name};\n"
        meaning = _meaning(getattr(field, "kind", field))
        return f"    {self.real} {name}{shape};{meaning and f' /* {meaning} */'}\n"

    def unused(self, name: str, others: set[str]) -> str:
        """The name, with a number if there are others of it."""
        number, found = 2, name
        while found in others:
            found, number = f"{name}_{number}", number + 1
        return found

    def start(self, layout: named.Record, values: Any, indent: int = 0) -> str:
        """Initialiser of a record."""
        pad = "    " * (indent + 1)
        rows = []
        for member, inner in members(layout).items():
            if hasattr(inner, "by_name"):
                text = self.start(inner, values[member], indent + 1)
            else:
                text = self.numbers(values[member], pad)
            rows.append(f"{pad}.{member} = {text}")
        return "{\n" + ",\n".join(rows) + f"\n{pad[4:]}}}"

    def numbers(self, values: Any, pad: str = "") -> str:
        """Initialiser of an array, or a number."""
        if values.ndim == 0:
            return literal(float(values), self.single)
        if values.ndim > 1:
            inner = [self.numbers(row, f"{pad}    ") for row in values]
            return "{\n" + ",\n".join(f"{pad}    {row}" for row in inner) + f"\n{pad}}}"
        texts = ["0"] if not values.any() else [literal(float(value), self.single) for value in values]
        if len(texts) <= 6:
            return f"{{{', '.join(texts)}}}"
        rows = [", ".join(texts[i : i + 6]) for i in range(0, len(texts), 6)]
        return "{\n" + ",\n".join(f"{pad}    {row}" for row in rows) + f"\n{pad}}}"

    def text(self, calls: str) -> str:
        """Tables, helpers and functions that the calls need, in the order in which C needs them."""
        functions: list[str] = []
        for function in reversed(self.functions.values()):
            if any(f"{function.name}(" in text for text in (calls, *functions)):
                functions.insert(0, function.text(self))
        body = "\n".join(functions)
        tables = [
            f"static const {self.real} {name}{''.join(f'[{n}]' for n in values.shape)} = "
            f"{self.numbers(values)};\n"
            for name, values in sorted(self.tables.items())
            if f"{name}[" in body
        ]
        helpers = [self._helper(name) for name in sorted(self.helpers) if f"{name}(" in body]
        return "\n".join(["".join(tables), *helpers, body])

    def _helper(self, name: str) -> str:
        body = _HELPERS[name].replace("(real)", f"({self.real})")
        if name == "exp_minus_one" and self.single:
            body = _SERIES.replace("@series@", _series())
        arguments = f"{self.real} x" if "x" in body.replace("exp", "") else f"{self.real} a, {self.real} b"
        return f"static {self.real} {name}({arguments})\n{{\n    {body}\n}}\n"


def _series() -> str:
    """Horner's form of (exp(x) - 1) / x."""
    text = literal(1.0 / math.factorial(_SERIES_TERMS), True)
    for n in range(_SERIES_TERMS - 1, 0, -1):
        text = f"({literal(1.0 / math.factorial(n), True)} + x * {text})"
    return text


def _meaning(kind: named.Kind) -> str:
    """What a number can be, in words; none for a number of any kind."""
    if kind.whole:
        return "count" if kind.high == named.MOST else f"whole, {kind.low:g} to {kind.high:g}"
    return "covariance" if kind.square else "work space" if kind.idle else ""
