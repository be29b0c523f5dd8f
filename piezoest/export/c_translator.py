"""Translate the compiled kernels, plain Python on numbers and flat arrays, into C99.

What is known when the code is generated (a configuration, a number of parameters) is put in:
branches that cannot be taken disappear, loops have fixed ends. The subset is that of the
kernels; anything else is refused, so that no construct is translated by guess.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from piezoest.export import c_printer as printer
from piezoest.export.c_source import Source, read
from piezoest.export.c_statements import Body
from piezoest.export.c_values import (
    Array,
    Expr,
    Items,
    Known,
    Root,
    TranslationError,
    Value,
    literal,
)


@dataclass(eq=False)
class Function:
    """A translated function: C's name and signature, and which arrays it writes into."""

    name: str
    source: Source
    parameters: list[tuple[int, str, Any]]  # place among the flattened arguments, name, kind or Root
    returns: tuple[str, ...]  # kinds; more than one go out through pointers
    body: list[printer.Statement]
    impure: bool
    constant: Known | None = None  # what it always returns, if that is known

    def result(self, real: str) -> str:
        """Type of the result in C."""
        return _type(self.returns[0], real) if len(self.returns) == 1 else "void"

    def signature(self, real: str) -> str:
        """Head of its definition."""
        parts = []
        for _, name, kind in self.parameters:
            if isinstance(kind, Root):
                parts.append(f"{'' if kind.written else 'const '}{real} *{name}")
            else:
                parts.append(f"{_type(kind, real)} {name}")
        if len(self.returns) > 1:
            parts += [f"{_type(kind, real)} *result_{i}" for i, kind in enumerate(self.returns)]
        return f"static {self.result(real)} {self.name}({', '.join(parts) or 'void'})"


def _type(kind: str, real: str) -> str:
    return real if kind == "real" else "int"


@dataclass(eq=False)
class Translator:
    """Everything that one C file is made of.

    Parameters
    ----------
    real : str
        Name of the type of real numbers in C.
    single : bool
        Whether it is float.
    unneeded : tuple of callable
        Functions whose calls, as statements, are left out.
    coarser : dict
        Constants, by module and name, that have another value here.
    """

    real: str
    single: bool
    unneeded: tuple[Any, ...] = ()
    coarser: dict[tuple[str, str], float] = field(default_factory=dict)
    functions: list[Function] = field(default_factory=list)
    tables: dict[str, tuple[float, ...]] = field(default_factory=dict)
    positions: dict[str, int] = field(default_factory=dict)
    helpers: set[str] = field(default_factory=set)
    _made: dict[Any, Function] = field(default_factory=dict)
    _in_work: list[Any] = field(default_factory=list)

    def table(self, name: str, values: tuple[float, ...]) -> Array:
        """Array of constants of the file; it comes into being where an entry is read by position."""
        known = tuple(enumerate(float(value) for value in values))
        return Array(name, Root(constant=True), size=len(values), known=known, table=True)

    def function(self, function: Any, arguments: list[Value]) -> tuple[Function, list[Value]]:
        """Translate a function for arguments of these kinds; returns what is left to pass."""
        source = read(function)
        if len(arguments) != len(source.parameters):
            raise TranslationError(
                f"{source.file}:{source.first_line}: {source.tree.name} takes {len(source.parameters)} "
                f"arguments, got {len(arguments)}"
            )
        kept = [self._settle(source, name, a) for name, a in zip(source.parameters, arguments, strict=True)]
        key = (source.function, tuple(_describe(value) for value in kept))
        if key in self._in_work:
            raise source.error(source.tree, f"{source.tree.name} calls itself: write a loop")
        if key not in self._made:
            self._in_work.append(key)
            self._made[key] = self._translate(source, kept)
            self._in_work.pop()
            if self._made[key].constant is None:
                self.functions.append(self._made[key])
        return self._made[key], _flatten(kept)

    def _settle(self, source: Source, name: str, value: Value) -> Value:
        """An argument as the function is specialised for it: known numbers only where they shape code."""
        if isinstance(value, Known) and isinstance(value.value, bool | int | float):
            if name in source.needs_value and source.assigned.get(name, 0) == 0:
                return value
            return self.runtime(value)
        if isinstance(value, Array) and not value.table and name not in source.needs_size:
            return Array(value.base, value.root, value.offset, None, value.known)
        return value

    def runtime(self, value: Known) -> Expr:
        """A known number as C text."""
        number = value.value
        if isinstance(number, bool):
            return Expr(str(int(number)), "bool")
        if isinstance(number, int):
            text = value.text or str(number)
            return Expr(text, "int", 12 if "+" in text or "-" in text or "*" in text else 16)
        return Expr(literal(number, self.single), "real", 15 if number < 0.0 else 16)

    def _translate(self, source: Source, arguments: list[Value]) -> Function:
        body = Body(self, source)
        slots: list[tuple[str, Any]] = []
        for name, value in zip(source.parameters, arguments, strict=True):
            body.bind_parameter(name, value, slots)
        statements = printer.drop_unused(body.run())
        used = printer.used_names(statements)
        parameters = [(i, name, kind) for i, (name, kind) in enumerate(slots) if name in used]
        types = {
            name: f"{'' if kind.written else 'const '}{self.real} *"
            if isinstance(kind, Root)
            else kind
            if kind == "[]"
            else _type(kind, self.real)
            for name, kind in body.locals.items()
        }
        printer.declare(statements, types)
        impure = any(isinstance(kind, Root) and kind.written for _, kind in slots)
        return Function(
            self._name(source), source, parameters, body.returns or (), statements, impure, body.constant
        )

    def _name(self, source: Source) -> str:
        module = source.function.__module__.split(".")
        owner = module[-2] if module[-1] == "base" else module[-1]
        name = f"{owner.lstrip('_')}_{source.tree.name.lstrip('_')}"
        taken = {function.name for function in self._made.values()}
        number = 2
        while name in taken:
            name = f"{owner}_{source.tree.name.lstrip('_')}_{number}"
            number += 1
        return name


def _describe(value: Value) -> Any:
    """What distinguishes one translation of a function from another."""
    if isinstance(value, Known):
        return ("known", type(value.value).__name__, repr(value.value), value.text)
    if isinstance(value, Expr):
        return value.kind
    if isinstance(value, Items):
        return tuple(_describe(item) for item in value.items)
    if value.table:
        offset = value.offset.value if isinstance(value.offset, Known) else value.offset.text
        return ("table", value.base, offset)
    offset_known = value.offset.value if value.known and isinstance(value.offset, Known) else None
    return ("array", value.size, value.known, offset_known)


def _flatten(values: list[Value]) -> list[Value]:
    flat: list[Value] = []
    for value in values:
        flat += _flatten(list(value.items)) if isinstance(value, Items) else [value]
    return flat
