"""What the translator knows of a value while it turns Python into C.

A value says itself what can be done with it: its fields, its entries, how it is handed to a function.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cache
from types import ModuleType
from typing import Any, cast

import numpy as np

from piezoest import layout as named
from piezoest._checks import FloatArray


class Binds(IntEnum):
    """How tightly C's operators bind."""

    TERNARY, OR, AND, EQUAL, LESS, SUM, PRODUCT, UNARY, PRIMARY = 3, 4, 5, 9, 10, 12, 13, 15, 16


class TranslationError(ValueError):
    """A construct that has no translation; names file, line and what to write instead."""


class Refused(Exception):  # noqa: N818
    """What is wrong with an expression, before its place in the file is added."""


@dataclass
class Root:
    """A parameter or local of C: whether anything is written into it, and whether C may see it as const.

    C knows no pointer to constant rows that an ordinary matrix could be handed to.
    """

    name: str
    written: bool = False
    is_const: bool = True

    def hand_over(self, parameter: Root) -> None:
        """Note what a function does with it."""
        self.written = self.written or parameter.written
        self.is_const = self.is_const and parameter.is_const

    def write(self) -> None:
        """Note that something is written into it."""
        self.written, self.is_const = True, False


class Value:
    """What an expression of Python stands for."""

    #: Whether it is known when the code is generated, and then its value.
    is_known = False
    value: Any
    #: Whether it is a single number, and one without a fraction.
    is_number = is_whole = False

    def field(self, name: str) -> Value:
        """``value.name``."""
        raise Refused(f"attribute {name} cannot be translated to C")

    def entry(self, places: tuple[Value, ...], text: str) -> Value:
        """``value[places]``; `text` is what C writes behind the name."""
        raise Refused("only arrays and tuples have entries")

    def length(self) -> int:
        """``len(value)``."""
        raise Refused("the size of this is not known")

    def truth(self) -> Value:
        """As a condition."""
        if self.is_known:
            return Known(bool(self.value))
        if not self.is_whole:
            raise Refused("a condition must be a comparison")
        return self

    def settled(self, single: bool) -> Value:
        """As a function is specialised for it: fractions are handed over when the code runs."""
        return self

    def identity(self) -> Any:
        """What distinguishes one translation of a function from another."""
        raise Refused("give a new array a name of its own")

    def as_parameter(self, name: str) -> tuple[Value, Root | None]:
        """What it is inside a function, and the parameter of C; None if there is nothing to hand over."""
        return self, None


@dataclass(frozen=True)
class Known(Value):
    """A value that is known when the code is generated."""

    value: Any
    is_known = True
    is_whole = property(lambda self: type(self.value) in (int, bool))
    is_number = property(lambda self: type(self.value) in (int, bool, float))

    def field(self, name: str) -> Value:
        if type(self.value) is not ModuleType or not hasattr(self.value, name):
            return super().field(name)
        return Known(getattr(self.value, name))

    def settled(self, single: bool) -> Value:
        """Whole numbers, functions and None shape the code."""
        return number(self, single) if type(self.value) is float else self

    def identity(self) -> Any:
        return "known", type(self.value).__name__, repr(self.value)


@dataclass(frozen=True)
class Number(Value):
    """A number that is known when the code runs; `kind` is "real", "int" or "bool"."""

    text: str
    kind: str
    strength: int = Binds.PRIMARY
    uses: frozenset[str] = frozenset()
    reads: bool = False  # something that a call could change
    impure: bool = False  # holds a call that writes somewhere
    is_number = True
    is_whole = property(lambda self: self.kind != "real")

    def identity(self) -> Any:
        return self.kind

    def as_parameter(self, name: str) -> tuple[Value, Root | None]:
        return Number(name, self.kind, uses=frozenset({name})), Root(name)

    @classmethod
    def joined(cls, text: str, kind: str, strength: int, *parts: Number) -> Number:
        """An expression made of others."""
        uses = frozenset().union(*(part.uses for part in parts))
        reads, impure = any(part.reads for part in parts), any(part.impure for part in parts)
        return cls(text, kind, strength, uses, reads, impure)

    def within(self, least: int) -> str:
        """Its text, in brackets if it binds less tightly than `least`."""
        return self.text if self.strength >= least else f"({self.text})"


@dataclass(frozen=True)
class Array(Value):
    """Array of numbers of known shape: `text` in C, or `values` that are constant."""

    text: str
    shape: tuple[int, ...]
    root: Root
    values: FloatArray | None = None

    def entry(self, places: tuple[Value, ...], text: str) -> Value:
        if len(places) != len(self.shape):
            raise Refused(f"an array of {len(self.shape)} axes has {len(places)} positions")
        if self.values is not None and (self.values.size == 0 or all(place.is_known for place in places)):
            known = tuple(place.value for place in places if place.is_known)
            inside = all(place < count for place, count in zip(known, self.shape, strict=False))
            # Beyond the end stands what no array of this size reaches.
            return Known(float(self.values[known]) if inside and self.values.size else np.nan)
        uses = frozenset().union(*(number(place, False, "int").uses for place in places))
        uses |= frozenset() if self.values is not None else {self.root.name}
        return Number(f"{self.text}{text}", "real", uses=uses, reads=self.values is None)

    def length(self) -> int:
        return self.shape[0]

    def identity(self) -> Any:
        """Its shape; its values, if they are constant."""
        return "array", self.shape, "" if self.values is None else self.text

    def as_parameter(self, name: str) -> tuple[Value, Root | None]:
        """A pointer of that name; constant arrays have a name everywhere."""
        if self.values is not None:
            return self, None
        root = Root(name, is_const=len(self.shape) == 1)
        return Array(name, self.shape, root), root


@dataclass(frozen=True)
class Struct(Value):
    """A record: `text` in C with its operator, ``state->`` or ``state->law.``; numbers that stay as they are.

    All of a record that is `constant` stays as it is; of others, what its layout calls fixed.
    """

    text: str
    layout: named.Record
    values: Any
    root: Root
    path: str
    constant: bool = False

    def field(self, name: str) -> Value:
        """A field, None if it is absent; or a function that goes with the record."""
        if name not in self.layout.by_name:
            function = named.function_of(self.layout.functions, name)
            if function is None:
                raise Refused(f"the record {self.path} has no field {name}")
            return Known(function)
        inner, path = self.layout.by_name[name], f"{self.path}.{name}"
        if inner == named.ABSENT:
            return Known(None)
        text, values = f"{self.text}{name}", self.values[name]
        if name in members(self.layout) and not self.constant:
            if values.dtype.names is not None:
                return Struct(f"{text}.", inner, values, self.root, path)  # type: ignore[arg-type]
            if values.shape:
                return Array(text, values.shape, self.root)
            return Number(text, "real", uses=frozenset({self.root.name}), reads=True)
        if values.dtype.names is not None:
            return Struct("", inner, values, Root(""), path, constant=True)  # type: ignore[arg-type]
        if values.shape:
            return Array(path.replace(".", "_"), values.shape, Root(""), values)
        return Known(float(values))

    def identity(self) -> Any:
        """Its layout, and the numbers that stay as they are."""
        leaves = named.leaves(self.layout, self.values)
        known = [
            (name, numbers[0].tobytes()) for name, kind, numbers in leaves if kind.fixed or self.constant
        ]
        return "record", self.layout, tuple(known), self.path if self.constant else ""

    def as_parameter(self, name: str) -> tuple[Value, Root | None]:
        """A pointer of that name; a record of constants has its name everywhere."""
        if self.constant or not members(self.layout):
            return replace(self, constant=True), None
        root = Root(name)
        return replace(self, text=f"{name}->", root=root), root

    @property
    def address(self) -> str:
        """Pointer to it."""
        return self.text[:-2] if self.text.endswith("->") else f"&{self.text[:-1]}"


@dataclass(frozen=True)
class Room(Value):
    """A new array for the time of a call, which still has no name."""

    shape: tuple[int, ...]


@dataclass(frozen=True)
class Items(Value):
    """A tuple."""

    items: tuple[Any, ...] = field(default_factory=tuple)

    def entry(self, places: tuple[Value, ...], text: str) -> Value:
        if not places[0].is_known:
            raise Refused("a tuple is read at positions that are known")
        return cast(Value, self.items[places[0].value])

    def length(self) -> int:
        return len(self.items)

    def settled(self, single: bool) -> Value:
        return Items(tuple(item.settled(single) for item in self.items))

    def identity(self) -> Any:
        return tuple(item.identity() for item in self.items)


@cache
def members(layout: named.Record) -> dict[str, Any]:
    """Fields of a record that C keeps: numbers that can change."""
    kept = {}
    for name, inner in layout.fields:
        fields = members(inner) if isinstance(inner, named.Record) else None
        empty = fields == {} or 0 in getattr(inner, "counts", ())
        kind: Any = getattr(inner, "kind", inner)
        if not empty and (fields or not kind.fixed):
            kept[name] = inner
    return kept


def number(value: Value, single: bool, kind: str = "") -> Number:
    """A value as a number that C computes: of its own kind, as a "real" number, or as an "int"."""
    if value.is_number and value.is_known:
        known = value.value
        if kind == "int" and float(known).is_integer():
            known = int(known)
        elif kind == "real":
            known = float(known)
        strength = Binds.UNARY if known < 0 else Binds.PRIMARY
        if type(known) is not float:
            value = Number(str(int(known)), "bool" if type(known) is bool else "int", strength)
        else:
            value = Number(literal(known, single), "real", strength)
    if type(value) is not Number:
        raise Refused("a number is needed here")
    if kind == "int" and not value.is_whole:
        raise Refused("a whole number is needed here: wrap it in int(...)")
    if kind == "real" and value.is_whole:
        text = f"({'float' if single else 'double'}){value.within(Binds.UNARY)}"
        return replace(value, text=text, kind="real", strength=Binds.UNARY)
    return value


def literal(value: float, single: bool) -> str:
    """A real number in C, exact for double; a number beyond float's range becomes its nearest."""
    if np.isnan(value):
        return "NAN"
    if np.isinf(value):
        name = "HUGE_VALF" if single else "HUGE_VAL"
        return name if value > 0.0 else f"-{name}"
    if not single:
        return repr(float(value))
    limits = np.finfo(np.float32)
    if value != 0.0 and abs(value) < float(limits.tiny):
        value = np.copysign(float(limits.tiny), value)
    value = float(np.clip(value, float(limits.min), float(limits.max)))
    text = np.format_float_scientific(np.float32(value), unique=True, trim="0")
    if 1e-4 <= abs(value) < 1e6 or value == 0.0:
        text = np.format_float_positional(np.float32(value), unique=True, trim="0")
    return f"{text}f"
