"""Expressions of the kernels in C: what is known is computed here, the rest becomes text."""

import ast
import functools
import inspect
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from piezoest.compile import like, local, local_rows
from piezoest.export.c_file import File
from piezoest.export.c_printer import Statement
from piezoest.export.c_source import Source
from piezoest.export.c_values import Array, Binds, Items, Known, Number, Refused, Room, Root, Value, number

_ARITHMETIC: dict[type, tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", Binds.SUM, operator.add),
    ast.Sub: ("-", Binds.SUM, operator.sub),
    ast.Mult: ("*", Binds.PRODUCT, operator.mul),
    ast.Div: ("/", Binds.PRODUCT, operator.truediv),
    ast.Mod: ("%", Binds.PRODUCT, operator.mod),
    ast.Pow: ("**", Binds.PRODUCT, operator.pow),
    ast.FloorDiv: ("//", Binds.PRODUCT, operator.floordiv),
}
_COMPARISONS: dict[type, tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("<", Binds.LESS, operator.lt),
    ast.LtE: ("<=", Binds.LESS, operator.le),
    ast.Gt: (">", Binds.LESS, operator.gt),
    ast.GtE: (">=", Binds.LESS, operator.ge),
    ast.Eq: ("==", Binds.EQUAL, operator.eq),
    ast.NotEq: ("!=", Binds.EQUAL, operator.ne),
}
_RESERVED = frozenset(
    """auto break case char const continue default do double else enum extern float for goto if inline
    int long register restrict return short signed sizeof static struct switch typedef union unsigned void
    volatile while
    exp expf log logf sqrt sqrtf fabs fabsf pow powf expm1 isfinite
    sign larger smaller larger_number smaller_number exp_minus_one squared
    gamma y0 y1 yn j0 j1 jn index signal""".split()  # noqa: SIM905
)
_BUILTIN = {made.__name__: made for made in (abs, min, max, int, float, bool, len, isinstance)}

# Function to its name in C, and to what gives its value here: the C library's, which compiled code calls.
_MATHEMATICS: dict[Any, tuple[str, Callable[..., float]]] = {
    abs: ("fabs", abs), np.abs: ("fabs", abs), math.fabs: ("fabs", abs),
    np.exp: ("exp", math.exp), math.exp: ("exp", math.exp),
    np.log: ("log", math.log), math.log: ("log", math.log),
    np.sqrt: ("sqrt", math.sqrt), math.sqrt: ("sqrt", math.sqrt),
    np.expm1: ("exp_minus_one", math.expm1), math.expm1: ("exp_minus_one", math.expm1),
    np.sign: ("sign", np.sign), max: ("larger", max), min: ("smaller", min),
    np.fmax: ("larger_number", np.fmax), np.fmin: ("smaller_number", np.fmin),
}  # fmt: skip
_LIBRARY = ("fabs", "exp", "log", "sqrt", "pow")


class Expressions(ast.NodeVisitor):
    """What a function's names stand for, and expressions of them."""

    def __init__(self, file: File, source: Source) -> None:
        self.file, self.source = file, source
        self.names: dict[str, Value] = {}
        self.locals: dict[str, str] = {}
        self.out: list[Statement] = []
        self.single = file.single
        self.wanted: list[str] = []  # locals that the results of the call at hand go to
        self._held = 0

    def safe(self, name: str) -> str:
        """The name in C."""
        name = name.lstrip("_") or "unused"
        return f"{name}_" if name in _RESERVED else name

    def visit(self, node: ast.AST) -> Any:
        """Translate an expression or a statement."""
        try:
            return super().visit(node)
        except Refused as problem:
            raise self.source.error(node, str(problem)) from None

    def generic_visit(self, node: ast.AST) -> None:
        """Refuse what is not in the subset."""
        raise Refused(f"{type(node).__name__} cannot be translated to C")

    def value(self, node: ast.expr) -> Value:
        return self.visit(node)

    def number(self, value: Value, kind: str = "") -> Number:
        return number(value, self.single, kind)

    # ------------------------------------------------------------ names, fields, entries

    def visit_Constant(self, node: ast.Constant) -> Value:
        return Known(node.value)

    def visit_Name(self, node: ast.Name) -> Value:
        """A local, a parameter, or something of the module."""
        if node.id in self.names:
            return self.names[node.id]
        outside = self.source.function.__globals__
        if node.id in outside:
            return self.outside(Known(outside[node.id]), node.id, self.source.function.__module__)
        if node.id in _BUILTIN:
            return Known(_BUILTIN[node.id])
        raise Refused(f"{node.id} is not known here")

    def outside(self, value: Value, name: str, module: str) -> Value:
        """Something of a module; for float some constants are others, and tuples of numbers are tables."""
        if not value.is_known:
            return value
        content = value.value
        if type(content) is tuple and content and all(type(each) is float for each in content):
            table = f"{self.source.owner}_{name.lower().lstrip('_')}"
            return Array(table, (len(content),), Root(""), np.array(content))
        return Known(self.file.coarser.get((module, name), content))

    def visit_Attribute(self, node: ast.Attribute) -> Value:
        """A field of a record, or something of a module."""
        owner = self.value(node.value)
        module = getattr(getattr(owner, "value", None), "__name__", "")
        return self.outside(owner.field(node.attr), node.attr, module)

    def visit_Subscript(self, node: ast.Subscript) -> Value:
        owner = self.value(node.value)
        nodes = node.slice.elts if type(node.slice) is ast.Tuple else [node.slice]
        if any(type(place) is ast.Slice for place in nodes):
            raise Refused("a slice cannot be translated to C: hand over the array, and where to begin")
        places = tuple(self.value(place) for place in nodes)
        if type(owner) is Items:
            return owner.entry(places, "")
        found = owner.entry(places, "".join(f"[{self.number(place, 'int').text}]" for place in places))
        if type(owner) is Array and owner.values is not None and not found.is_known:
            self.file.tables[owner.text] = owner.values
        return found

    def visit_Tuple(self, node: ast.Tuple) -> Value:
        return Items(tuple(self.arguments(node.elts)))

    def arguments(self, nodes: list[ast.expr]) -> list[Value]:
        """Values of several expressions, from left to right: C leaves open which comes first.

        What is read before a call that writes is held, and so is such a call's result before more is read.
        """
        values: list[Any] = []
        for node in nodes:
            before = len(self.out)
            value: Any = self.value(node.value if type(node) is ast.Starred else node)
            writes = len(self.out) > before or getattr(value, "impure", False)
            reads = getattr(value, "reads", False)
            for i, earlier in enumerate(values):
                if type(earlier) is Number and (
                    (writes and earlier.reads) or ((writes or reads) and earlier.impure)
                ):
                    values[i] = self.hold(earlier, before)
                    before += 1
            spread = range(value.length()) if type(node) is ast.Starred else None
            values += [value] if spread is None else [value.entry((Known(i),), "") for i in spread]
        return values

    def hold(self, value: Number, place: int | None = None) -> Number:
        """Put a value into a local of its own, by a statement at a place in the block."""
        self._held += 1
        name = f"held_{self._held}"
        self.locals[name] = value.kind
        line = Statement(f"{name} = {value.text};", value.uses, name, not value.impure)
        self.out.insert(len(self.out) if place is None else place, line)
        return Number(name, value.kind, uses=frozenset({name}))

    # ------------------------------------------------------------ operators

    def visit_BinOp(self, node: ast.BinOp) -> Value:
        return self.operate(node.op, *self.arguments([node.left, node.right]))

    def operate(self, op: ast.operator, left: Value, right: Value) -> Value:
        if type(op) not in _ARITHMETIC:
            raise Refused(f"{type(op).__name__} cannot be translated to C")
        sign, strength, compute = _ARITHMETIC[type(op)]
        if left.is_number and left.is_known and right.is_number and right.is_known:
            return Known(compute(left.value, right.value))
        if sign == "**":
            return self.power(left, right)
        kind, a, b = self.alike(left, right, "real" if sign == "/" else "int")
        if sign in ("//", "%") and kind == "real":
            raise Refused(f"{sign} on numbers that are not whole cannot be translated to C")
        text = f"{a.within(strength)} {sign[:1]} {b.within(strength + 1)}"
        return Number.joined(text, kind, strength, a, b)

    def power(self, base: Value, exponent: Value) -> Value:
        """A square, or a power of a real exponent; others have no product that is known to be Numba's."""
        if not exponent.is_whole:
            return self.applied("pow", [base, exponent])
        if not exponent.is_known or exponent.value != 2 or base.is_whole:
            raise Refused("a power: write x * x")
        return self.applied("squared", [base])

    def alike(self, left: Value, right: Value, kind: str = "int") -> tuple[str, Number, Number]:
        """Two values as numbers of one kind: whole, if both are and `kind` is, or else real."""
        kind = kind if left.is_whole and right.is_whole else "real"
        return kind, self.number(left, kind), self.number(right, kind)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:
        value = self.value(node.operand)
        if type(node.op) is ast.Not:
            test = value.truth()
            if test.is_known:
                return Known(not test.value)
            return negated(self.number(test))
        if type(node.op) is not ast.USub or not value.is_number:
            raise Refused(f"{type(node.op).__name__} cannot be translated to C")
        if value.is_known:
            return Known(-value.value)
        number = self.number(value)
        return Number.joined(
            f"-{number.within(Binds.PRIMARY)}", "int" if number.is_whole else "real", Binds.UNARY, number
        )

    def visit_Compare(self, node: ast.Compare) -> Value:
        """A comparison; several in a row are joined by `and`."""
        if len(node.ops) == 1:
            return self.compare(node.ops[0], *self.arguments([node.left, node.comparators[0]]))
        before = len(self.out)
        values = self.arguments([node.left, *node.comparators])
        if len(self.out) > before or any(getattr(value, "impure", False) for value in values):
            raise Refused("a call between several comparisons that writes: put it into a name first")
        return self.joined(ast.And(), [
            functools.partial(self.compare, op, values[i], values[i + 1]) for i, op in enumerate(node.ops)
        ])  # fmt: skip

    def compare(self, op: ast.cmpop, left: Value, right: Value) -> Value:
        if type(op) in (ast.Is, ast.IsNot):
            if not right.is_known or right.value is not None:
                raise Refused("`is` compares with None only")
            absent = left.is_known and left.value is None
            return Known(absent == (type(op) is ast.Is))
        if type(op) not in _COMPARISONS:
            raise Refused(f"{type(op).__name__} cannot be translated to C")
        sign, strength, compute = _COMPARISONS[type(op)]
        if left.is_known and right.is_known:
            return Known(bool(compute(left.value, right.value)))
        _, a, b = self.alike(left, right)
        return Number.joined(f"{a.within(Binds.SUM)} {sign} {b.within(Binds.SUM)}", "bool", strength, a, b)

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:
        return self.joined(node.op, [functools.partial(self.value, item) for item in node.values])

    def joined(self, op: ast.boolop, items: list[Callable[[], Value]]) -> Value:
        """Conditions joined; what is known drops out, and what stands behind it is not looked at."""
        stops = type(op) is ast.Or
        sign, strength = ("||", Binds.OR) if stops else ("&&", Binds.AND)
        parts: list[Number] = []
        for item in items:
            before = len(self.out)
            test = item().truth()
            if parts and len(self.out) > before:
                raise Refused("a call behind `and` or `or` that needs statements: put it into a name first")
            if test.is_known and test.value != stops:
                continue
            if test.is_known and not any(part.impure for part in parts):
                return test
            parts.append(self.number(test))
            if test.is_known:
                break
        if not parts:
            return Known(not stops)
        if len(parts) == 1:
            return parts[0]
        return Number.joined(
            f" {sign} ".join(part.within(Binds.EQUAL) for part in parts), "bool", strength, *parts
        )

    def visit_IfExp(self, node: ast.IfExp) -> Value:
        test = self.value(node.test).truth()
        if test.is_known:
            return self.value(node.body if test.value else node.orelse)
        before = len(self.out)
        left, right = self.value(node.body), self.value(node.orelse)
        if len(self.out) > before:
            raise Refused("a call within `if` and `else` of an expression: put it into a name first")
        kind, a, b = self.alike(left, right)
        number = self.number(test)
        text = f"{number.within(Binds.OR)} ? {a.within(Binds.OR)} : {b.within(Binds.OR)}"
        return Number.joined(text, kind, Binds.TERNARY, number, a, b)

    # ------------------------------------------------------------ calls

    def visit_Call(self, node: ast.Call) -> Value:
        called = self.called(node)
        wanted, self.wanted = self.wanted, []
        arguments = self.arguments(node.args)
        if called in _MATHEMATICS:
            return self.mathematics(called, arguments)
        special = _SPECIAL.get(called)
        if special is not None:
            return special(self, *arguments)
        if not inspect.isfunction(called):
            raise Refused(f"{called!r} cannot be called in C")
        return self.invoke(called, arguments, wanted)

    def called(self, node: ast.Call) -> Any:
        value = self.value(node.func)
        if not value.is_known or node.keywords:
            raise Refused("call a function by its name, with positional arguments")
        return value.value

    def mathematics(self, called: Any, arguments: list[Value]) -> Value:
        """A function of math.h, or a helper beside it."""
        name, compute = _MATHEMATICS[called]
        while len(arguments) > 2:  # min and max: from left to right
            arguments = [self.mathematics(called, arguments[:2]), *arguments[2:]]
        if all(argument.is_known for argument in arguments):
            return Known(float(compute(*(a.value for a in arguments))))
        return self.applied(name, arguments)

    def applied(self, name: str, arguments: list[Value]) -> Number:
        """Call of a function of math.h or of a helper by its name."""
        numbers = [self.number(argument, "real") for argument in arguments]
        if name in _LIBRARY:
            name = f"{name}f" if self.single else name
        else:
            self.file.helpers.add(name)
        return Number.joined(
            f"{name}({', '.join(number.text for number in numbers)})", "real", Binds.PRIMARY, *numbers
        )

    def finite(self, value: Value) -> Value:
        number = self.number(value, "real")
        return Number.joined(f"isfinite({number.text})", "bool", Binds.PRIMARY, number)

    def converted(self, value: Value) -> Value:
        if value.is_known:
            return Known(int(value.value))
        if value.is_whole:
            return value
        number = self.number(value, "real")
        return Number.joined(f"(int){number.within(Binds.UNARY)}", "int", Binds.UNARY, number)

    def invoke(self, called: Any, arguments: list[Value], wanted: list[str]) -> Value:
        """A call of a translated function, whose results are wanted in locals of these names."""
        raise NotImplementedError


_SPECIAL: dict[Any, Callable[..., Value]] = {
    len: lambda body, value: Known(value.length()),
    isinstance: lambda body, value, kind: Known(value.is_number),  # what is calculated with is a number
    bool: lambda body, value: value.truth(),
    int: Expressions.converted,
    np.isfinite: Expressions.finite,
    float: lambda body, value: Known(float(value.value)) if value.is_known else body.number(value, "real"),
    like: lambda body, value: Room(value.shape),
    local: lambda body, size: Room((size.value,)),
    local_rows: lambda body, rows, columns: Room((rows.value, columns.value)),
}


def negated(number: Number) -> Number:
    """Not that."""
    return Number.joined(f"!{number.within(Binds.UNARY)}", "bool", Binds.UNARY, number)


def as_load(target: Any) -> ast.expr:
    """The same name, field or entry, read."""
    node: Any = type(target)(**{**dict(ast.iter_fields(target)), "ctx": ast.Load()})
    return ast.copy_location(node, target)
