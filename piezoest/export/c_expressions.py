"""Expressions of the kernels in C: what is known is computed here, the rest becomes text."""

from __future__ import annotations

import ast
import inspect
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from piezoest.export import c_printer as printer
from piezoest.export.c_source import Source
from piezoest.export.c_values import (
    AND,
    EQUAL,
    LESS,
    OR,
    PRODUCT,
    SUM,
    TERNARY,
    UNARY,
    Array,
    Expr,
    Items,
    Known,
    Value,
    wrap,
)

if TYPE_CHECKING:
    from piezoest.export.c_translator import Translator

_BINARY: dict[type, tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", SUM, operator.add),
    ast.Sub: ("-", SUM, operator.sub),
    ast.Mult: ("*", PRODUCT, operator.mul),
    ast.Div: ("/", PRODUCT, operator.truediv),
    ast.Mod: ("%", PRODUCT, operator.mod),
    ast.FloorDiv: ("//", PRODUCT, operator.floordiv),
    ast.Pow: ("**", PRODUCT, operator.pow),
}
_COMPARE: dict[type, tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("<", LESS, operator.lt),
    ast.LtE: ("<=", LESS, operator.le),
    ast.Gt: (">", LESS, operator.gt),
    ast.GtE: (">=", LESS, operator.ge),
    ast.Eq: ("==", EQUAL, operator.eq),
    ast.NotEq: ("!=", EQUAL, operator.ne),
}
_RESERVED = frozenset(
    """auto break case char const continue default do double else enum extern float for goto if inline
    int long register restrict return short signed sizeof static struct switch typedef union unsigned void
    volatile while
    exp expf sqrt sqrtf fabs fabsf expm1 sign larger smaller larger_number smaller_number exp_minus_one
    gamma y0 y1 yn j0 j1 jn index signal""".split()  # noqa: SIM905
)


_BUILTIN = {function.__name__: function for function in (abs, min, max, int, float, bool, isinstance)}


class Expressions:
    """What a function's names stand for, and expressions of them."""

    def __init__(self, translator: Translator, source: Source) -> None:
        self.translator, self.source = translator, source
        self.names: dict[str, Value] = {}
        self.locals: dict[str, Any] = {}
        self.out: list[printer.Statement] = []

    def safe(self, name: str) -> str:
        """The name in C."""
        name = name.lstrip("_") or "unused"
        return f"{name}_" if name in _RESERVED else name

    # ------------------------------------------------------------ kinds

    def real(self, value: Value, node: ast.AST) -> Expr:
        """As a real number."""
        if isinstance(value, Known) and isinstance(value.value, bool | int | float):
            return self.translator.runtime(Known(float(value.value)))
        if not isinstance(value, Expr):
            raise self.source.error(node, "a number is needed here")
        if value.kind == "real":
            return value
        text = f"({self.translator.real}){wrap(value, UNARY)}"
        return Expr(text, "real", UNARY, value.uses, value.reads, value.impure)

    def whole(self, value: Value, node: ast.AST) -> Expr:
        """As an int."""
        if isinstance(value, Known) and float(value.value).is_integer():
            return self.translator.runtime(Known(int(value.value), value.text))
        if not isinstance(value, Expr) or value.kind == "real":
            raise self.source.error(node, "a whole number is needed here: wrap it in int(...)")
        return value

    def number(self, node: ast.expr, kind: str) -> Expr:
        """Expression as a number of a kind."""
        value = self.value(node)
        return self.whole(value, node) if kind == "int" else self.real(value, node)

    def truth(self, value: Value, node: ast.AST) -> Known | Expr:
        """As a condition."""
        if isinstance(value, Known):
            return Known(bool(value.value))
        if not isinstance(value, Expr) or value.kind == "real":
            raise self.source.error(node, "a condition must be a comparison")
        return value

    # ------------------------------------------------------------ dispatch

    def value(self, node: ast.expr) -> Value:
        """Translate an expression."""
        if isinstance(node, ast.Constant):
            return Known(node.value)
        if isinstance(node, ast.Name):
            return self.name(node)
        if isinstance(node, ast.Attribute):
            return self.attribute(node)
        if isinstance(node, ast.Tuple):
            return Items(tuple(self.value(item) for item in node.elts))
        if isinstance(node, ast.Subscript):
            return self.subscript(node)
        if isinstance(node, ast.BinOp):
            return self.binary(node)
        if isinstance(node, ast.UnaryOp):
            return self.unary(node)
        if isinstance(node, ast.Compare):
            return self.compare(node)
        if isinstance(node, ast.BoolOp):
            return self.boolean(node)
        if isinstance(node, ast.IfExp):
            return self.either(node)
        if isinstance(node, ast.Call):
            return self.call(node)
        raise self.source.error(node, f"{type(node).__name__} cannot be translated to C")

    def name(self, node: ast.Name) -> Value:
        """A local, a parameter, or something of the module."""
        if node.id in self.names:
            return self.names[node.id]
        names = self.source.function.__globals__
        if node.id in names:
            return self.outside(names[node.id], node.id, self.source.function.__module__)
        if node.id in _BUILTIN:
            return Known(_BUILTIN[node.id])
        raise self.source.error(node, f"{node.id} is not known here")

    def outside(self, value: Any, name: str, module: str) -> Known:
        """A constant of a module; whole numbers in capitals are positions and keep their names."""
        if isinstance(value, int) and not isinstance(value, bool) and name.isupper():
            parts = module.split(".")
            owner = parts[-2] if parts[-1] == "base" else parts[-1]
            text = f"{owner.lstrip('_')}_{name.lstrip('_')}".upper()
            self.translator.positions[text] = value
            return Known(value, text)
        return Known(self.translator.coarser.get((module, name), value))

    def attribute(self, node: ast.Attribute) -> Value:
        """An attribute of a module, or the size of an array."""
        owner = self.value(node.value)
        if isinstance(owner, Array) and node.attr in ("size", "shape"):
            if owner.size is None:
                raise self.source.error(node, "the size of this array is not known")
            return Known(owner.size) if node.attr == "size" else Known((owner.size,))
        if isinstance(owner, Known) and inspect.ismodule(owner.value) and hasattr(owner.value, node.attr):
            return self.outside(getattr(owner.value, node.attr), node.attr, owner.value.__name__)
        raise self.source.error(node, f"attribute {node.attr} cannot be translated to C")

    # ------------------------------------------------------------ arrays

    def subscript(self, node: ast.Subscript) -> Value:
        """An entry or a part."""
        owner = self.value(node.value)
        if isinstance(owner, Known) and isinstance(owner.value, tuple):
            position = self.value(node.slice)
            if isinstance(position, Known):
                return Known(owner.value[position.value])
            owner = self.translator.table(self.table_name(node), owner.value)
            return self._entry(owner, position, node)
        if isinstance(owner, Items):
            position = self.value(node.slice)
            if isinstance(position, Known):
                return owner.items[position.value]
        if not isinstance(owner, Array):
            raise self.source.error(node, "only arrays and tuples have entries")
        if isinstance(node.slice, ast.Slice):
            return self.part(owner, node.slice)
        return self._entry(owner, self.value(node.slice), node)

    def table_name(self, node: ast.Subscript) -> str:
        """Name of the table that a tuple of constants becomes."""
        if not isinstance(node.value, ast.Name | ast.Attribute):
            raise self.source.error(node, "a tuple that is read by position needs a name")
        name = node.value.id if isinstance(node.value, ast.Name) else node.value.attr
        return name.lower().lstrip("_")

    def part(self, owner: Array, node: ast.Slice) -> Array:
        """A slice: pointer arithmetic."""
        if node.step is not None:
            raise self.source.error(node, "a slice with a step cannot be translated to C")
        lower = Known(0) if node.lower is None else self.value(node.lower)
        upper = None if node.upper is None else self.value(node.upper)
        size = None
        if isinstance(lower, Known):
            if upper is None:
                size = None if owner.size is None else owner.size - lower.value
            elif isinstance(upper, Known):
                size = upper.value - lower.value
        offset = self.plus(owner.offset, lower, node)
        return Array(owner.base, owner.root, offset, size, owner.known, owner.table)

    def plus(self, left: Known | Expr, right: Value, node: ast.AST) -> Known | Expr:
        """Sum of two positions."""
        if isinstance(left, Known) and left.value == 0 and isinstance(right, Known | Expr):
            return right
        result = self.operate(ast.Add(), left, right, node)
        assert isinstance(result, Known | Expr)
        return result

    def entry(self, node: ast.Subscript, write: bool = False) -> Expr:
        """An entry as text, for writing into it."""
        owner = self.value(node.value)
        if not isinstance(owner, Array):
            raise self.source.error(node, "only an array's entries can be assigned to")
        if owner.root.constant:
            raise self.source.error(node, f"{owner.base} is constant in C: its entries cannot be assigned to")
        if write:
            owner.root.write()
        return self._text(owner, self.value(node.slice), node)

    def _entry(self, owner: Array, position: Value, node: ast.AST) -> Known | Expr:
        if isinstance(position, Known):
            number = owner.entry(position.value)
            if number is not None:
                return Known(number)
        return self._text(owner, position, node)

    def _text(self, owner: Array, position: Value, node: ast.AST) -> Expr:
        place = self.whole(self.plus(owner.offset, position, node), node)
        if owner.table:
            self.translator.tables[owner.base] = tuple(value for _, value in sorted(owner.known))
        uses = place.uses | (frozenset() if owner.table else frozenset({owner.base}))
        return Expr(f"{owner.base}[{place.text}]", "real", uses=uses, reads=not owner.table)

    # ------------------------------------------------------------ operators

    def binary(self, node: ast.BinOp) -> Known | Expr:
        """Arithmetic."""
        return self.operate(node.op, self.value(node.left), self.value(node.right), node)

    def operate(self, op: ast.operator, left: Value, right: Value, node: ast.AST) -> Known | Expr:
        """Arithmetic on two values."""
        if type(op) not in _BINARY or not all(isinstance(side, Known | Expr) for side in (left, right)):
            raise self.source.error(node, f"{type(op).__name__} cannot be translated to C")
        sign, strength, compute = _BINARY[type(op)]
        if isinstance(left, Known) and isinstance(right, Known):
            text = None
            if left.text or right.text:
                texts = [side.text or str(side.value) for side in (left, right)]
                text = f"{texts[0]} {sign} {texts[1]}" if sign in "+-" and " " not in texts[1] else None
                text = text or (f"{texts[0]} + {texts[1]}" if sign == "+" else None)
            return Known(compute(left.value, right.value), text)
        if sign == "**":
            if (
                isinstance(right, Known)
                and right.value == 2
                and isinstance(left, Expr)
                and left.text.isidentifier()
            ):
                return self.operate(ast.Mult(), left, left, node)
            raise self.source.error(node, "a power: write x * x")
        whole = all(
            (isinstance(side, Known) and isinstance(side.value, int))
            or (isinstance(side, Expr) and side.kind != "real")
            for side in (left, right)
        ) and not isinstance(op, ast.Div)
        if sign in ("%", "//") and (not whole or sign == "//"):
            raise self.source.error(node, f"{sign} on numbers that are not whole cannot be translated to C")
        if sign == "%" and isinstance(right, Known) and right.value == 1:
            return Known(0)
        a, b = (self.whole(s, node) if whole else self.real(s, node) for s in (left, right))
        self.check_order(node, a, b)
        text = f"{wrap(a, strength)} {sign} {wrap(b, strength + 1 if sign != '+' or not whole else strength)}"
        return joined(text, "int" if whole else "real", strength, a, b)

    def check_order(self, node: ast.AST, *parts: Expr) -> None:
        """C leaves open which operand comes first: refuse where that could matter."""
        for i, part in enumerate(parts):
            others = [other for j, other in enumerate(parts) if j != i]
            if part.impure and any(other.reads or other.impure for other in others):
                raise self.source.error(
                    node,
                    "a call that writes into an array stands beside a read: put its result into a name first",
                )

    def unary(self, node: ast.UnaryOp) -> Known | Expr:
        """Sign and not."""
        value = self.value(node.operand)
        if isinstance(node.op, ast.Not):
            test = self.truth(value, node)
            if isinstance(test, Known):
                return Known(not test.value)
            return joined(f"!{wrap(test, UNARY)}", "bool", UNARY, test)
        if isinstance(node.op, ast.USub) and isinstance(value, Known):
            return Known(-value.value)
        if isinstance(node.op, ast.USub) and isinstance(value, Expr) and value.kind != "bool":
            return joined(f"-{wrap(value, UNARY + 1)}", value.kind, UNARY, value)
        raise self.source.error(node, f"{type(node.op).__name__} cannot be translated to C")

    def is_none(self, node: ast.Compare) -> bool:
        """Whether what is compared with None is None: known when the code is generated."""
        other = node.comparators[0]
        if not (isinstance(other, ast.Constant) and other.value is None and isinstance(node.left, ast.Name)):
            raise self.source.error(node, "`is` asks for None, of a name")
        value = self.name(node.left)
        return isinstance(value, Known) and value.value is None

    def compare(self, node: ast.Compare) -> Known | Expr:
        """One comparison."""
        if len(node.ops) == 1 and isinstance(node.ops[0], ast.Is | ast.IsNot):
            return Known(self.is_none(node) == isinstance(node.ops[0], ast.Is))
        if len(node.ops) != 1 or type(node.ops[0]) not in _COMPARE:
            raise self.source.error(node, "write one comparison at a time")
        sign, strength, compute = _COMPARE[type(node.ops[0])]
        left, right = self.value(node.left), self.value(node.comparators[0])
        if isinstance(left, Known) and isinstance(right, Known):
            return Known(bool(compute(left.value, right.value)))
        whole = not any(isinstance(s, Expr) and s.kind == "real" for s in (left, right)) and not any(
            isinstance(s, Known) and isinstance(s.value, float) for s in (left, right)
        )
        a, b = (self.whole(s, node) if whole else self.real(s, node) for s in (left, right))
        self.check_order(node, a, b)
        return joined(f"{wrap(a, SUM)} {sign} {wrap(b, SUM)}", "bool", strength, a, b)

    def boolean(self, node: ast.BoolOp) -> Known | Expr:
        """And, or; what is known drops out."""
        stops = isinstance(node.op, ast.Or)
        sign, strength = ("||", OR) if stops else ("&&", AND)
        parts: list[Expr] = []
        for item in node.values:
            test = self.truth(self.value(item), node)
            if isinstance(test, Known):
                if test.value == stops:
                    # Later parts are not looked at.
                    if not parts:
                        return Known(stops)
                    parts.append(Expr(str(int(stops)), "bool"))
                    break
                continue
            parts.append(test)
        if not parts:
            return Known(not stops)
        if len(parts) == 1:
            return parts[0]
        return joined(f" {sign} ".join(wrap(part, EQUAL) for part in parts), "bool", strength, *parts)

    def either(self, node: ast.IfExp) -> Value:
        """A if test else B."""
        test = self.truth(self.value(node.test), node)
        if isinstance(test, Known):
            return self.value(node.body if test.value else node.orelse)
        a, b = self.number(node.body, "real"), self.number(node.orelse, "real")
        text = f"{wrap(test, OR)} ? {wrap(a, OR)} : {wrap(b, OR)}"
        return joined(text, "real", TERNARY, test, a, b)

    def call(self, node: ast.Call) -> Value:
        """A call within an expression."""
        raise NotImplementedError


def joined(text: str, kind: str, strength: int, *parts: Expr) -> Expr:
    """An expression made of others."""
    uses = frozenset().union(*(part.uses for part in parts))
    reads, impure = any(part.reads for part in parts), any(part.impure for part in parts)
    return Expr(text, kind, strength, uses, reads, impure)
