"""What the translator knows of a value while it turns Python into C."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

# How tightly C's operators bind.
TERNARY, OR, AND, EQUAL, LESS, SUM, PRODUCT, UNARY, PRIMARY = 3, 4, 5, 9, 10, 12, 13, 15, 16


class TranslationError(ValueError):
    """A construct that has no translation; names file, line and what to write instead."""


@dataclass(frozen=True)
class Known:
    """A value that is known when the code is generated.

    `text` is its name in C, if it has one: a position in a flat array.
    """

    value: Any
    text: str | None = None


@dataclass(frozen=True)
class Expr:
    """A number that is known when the code runs; `kind` is "real", "int" or "bool"."""

    text: str
    kind: str
    strength: int = PRIMARY
    uses: frozenset[str] = frozenset()
    reads: bool = False  # an array's entry
    impure: bool = False  # holds a call that writes into an array


@dataclass
class Root:
    """Where an array lives: whether anything is written into it."""

    parent: Root | None = None
    constant: bool = False
    written: bool = False

    def write(self) -> None:
        """Note a write, here and in what this is a part of."""
        root: Root | None = self
        while root is not None:
            root.written = True
            root = root.parent


@dataclass(frozen=True)
class Array:
    """A part of a flat array: `base` in C, `offset` from it, entries that are known."""

    base: str
    root: Root
    offset: Known | Expr = field(default_factory=lambda: Known(0))
    size: int | None = None
    known: tuple[tuple[int, float], ...] = ()
    table: bool = False  # a constant table of the file, not a parameter or local

    def entry(self, i: int) -> float | None:
        """Value of an entry, if known."""
        if not isinstance(self.offset, Known):
            return None
        return dict(self.known).get(self.offset.value + i)

    @property
    def uses(self) -> frozenset[str]:
        """Local names in it."""
        inner = self.offset.uses if isinstance(self.offset, Expr) else frozenset()
        return inner if self.table else inner | {self.base}


@dataclass(frozen=True)
class Items:
    """A tuple."""

    items: tuple[Any, ...]


Value = Known | Expr | Array | Items


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


def wrap(value: Expr, least: int) -> str:
    """Its text, in brackets if it binds less tightly than `least`."""
    return value.text if value.strength >= least else f"({value.text})"
