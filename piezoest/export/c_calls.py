"""Calls in C: of math.h, of helpers, and of other translated functions."""

from __future__ import annotations

import ast
import inspect
import math
from typing import Any

import numpy as np

from piezoest.export import c_printer as printer
from piezoest.export.c_expressions import Expressions, joined
from piezoest.export.c_source import plain, read
from piezoest.export.c_values import UNARY, Array, Expr, Items, Known, Root, TranslationError, Value, wrap

# Function to its name in C; names without a dot are helpers of the generated file.
_INTRINSICS: dict[Any, str] = {
    abs: "fabs", np.abs: "fabs", math.fabs: "fabs",
    np.exp: "exp", math.exp: "exp", np.sqrt: "sqrt", math.sqrt: "sqrt",
    np.expm1: "exp_minus_one", math.expm1: "exp_minus_one", np.sign: "sign",
    max: "larger", min: "smaller", np.fmax: "larger_number", np.fmin: "smaller_number",
}  # fmt: skip
_LIBRARY = {"fabs", "exp", "sqrt"}


class Calls(Expressions):
    """Expressions with calls in them."""

    def call(self, node: ast.Call) -> Value:
        """A call within an expression."""
        called, arguments = self.called(node), self.arguments(node)
        if called in (np.empty, np.zeros):
            raise self.source.error(node, "give a new array a name of its own")
        if called is isinstance:  # what is calculated with in C is a number
            return Known(not isinstance(arguments[0], Array))
        if called is bool:
            return self.truth(arguments[0], node)
        if called in (int, float):
            return self.convert(called, arguments[0], node)
        if called in _INTRINSICS:
            return self.intrinsic(_INTRINSICS[called], called, arguments, node)
        if not inspect.isfunction(plain(called)):
            raise self.source.error(node, f"{called!r} cannot be called in C")
        if all(isinstance(argument, Known) for argument in arguments):
            return Known(plain(called)(*(a.value for a in arguments if isinstance(a, Known))))
        parts = self.parts_of(plain(called), arguments)
        return parts if parts is not None else self.invoke(plain(called), arguments, node)

    def called(self, node: ast.Call) -> Any:
        """The function that is called."""
        value = self.value(node.func)
        if not isinstance(value, Known) or node.keywords:
            raise self.source.error(node, "call a function by its name, with positional arguments")
        return value.value

    def arguments(self, node: ast.Call) -> list[Value]:
        """Values of the arguments; a starred tuple is spread."""
        values: list[Value] = []
        for argument in node.args:
            if isinstance(argument, ast.Starred):
                spread = self.value(argument.value)
                if not isinstance(spread, Items):
                    raise self.source.error(node, "* needs a tuple")
                values += spread.items
            else:
                values.append(self.value(argument))
        return values

    def convert(self, called: Any, value: Value, node: ast.AST) -> Known | Expr:
        """Int or float of a number."""
        if isinstance(value, Known):
            return Known(called(value.value), value.text if called is int else None)
        if called is float or not isinstance(value, Expr) or value.kind != "real":
            return self.real(value, node) if called is float else self.whole(value, node)
        return joined(f"(int){wrap(value, UNARY)}", "int", UNARY, value)

    def intrinsic(self, name: str, called: Any, arguments: list[Value], node: ast.AST) -> Known | Expr:
        """A function of math.h, or a helper beside it."""
        if all(isinstance(argument, Known) for argument in arguments):
            return Known(float(called(*(a.value for a in arguments if isinstance(a, Known)))))
        numbers = [self.real(argument, node) for argument in arguments]
        if len(numbers) == 3 and name in ("larger", "smaller"):
            raise self.source.error(node, "min and max take two numbers")
        self.check_order(node, *numbers)
        if name in _LIBRARY:
            name = f"{name}f" if self.translator.single else name
        else:
            self.translator.helpers.add(name)
        text = f"{name}({', '.join(number.text for number in numbers)})"
        return joined(text, "real", 16, *numbers)

    def parts_of(self, called: Any, arguments: list[Value]) -> Items | None:
        """Result of a function that only names parts of its arrays; None if it does more."""
        source = read(called)
        inner = Calls(self.translator, source)
        inner.names.update(zip(source.parameters, arguments, strict=True))
        for node in source.tree.body:
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                continue
            try:
                if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                    inner.names[node.targets[0].id] = inner.value(node.value)
                elif isinstance(node, ast.Return) and isinstance(node.value, ast.Tuple):
                    items = inner.value(node.value)
                    found = isinstance(items, Items) and any(isinstance(i, Array) for i in items.items)
                    return items if found and isinstance(items, Items) else None
                else:
                    return None
            except TranslationError:
                return None
        return None

    def invoke(self, called: Any, arguments: list[Value], node: ast.AST) -> Value:
        """A call of a translated function; several results arrive in locals."""
        function, flat = self.translator.function(called, arguments)
        if function.constant is not None:
            return function.constant
        texts: list[str] = []
        uses: frozenset[str] = frozenset()
        scalars: list[Expr] = []
        for place, _, kind in function.parameters:
            value = flat[place]
            if isinstance(kind, Root):
                assert isinstance(value, Array)
                if kind.written:
                    if value.root.constant:
                        raise self.source.error(
                            node, f"{value.base} is constant in C and would be written into"
                        )
                    value.root.write()
                offset = self.whole(value.offset, node)
                texts.append(value.base if offset.text == "0" else f"{value.base} + {offset.text}")
                uses |= value.uses
                continue
            assert isinstance(value, Expr)
            scalars.append(value)
            texts.append(value.text)
            uses |= value.uses
        self.check_order(node, *scalars)
        reads = any(scalar.reads for scalar in scalars) or any(
            isinstance(kind, Root) for _, _, kind in function.parameters
        )
        if len(function.returns) <= 1:
            text = f"{function.name}({', '.join(texts)})"
            kind = function.returns[0] if function.returns else "none"
            return Expr(text, kind, uses=uses, reads=reads, impure=function.impure)
        results: list[Expr] = []
        for kind in function.returns:
            name = f"{function.source.tree.name.strip('_')}_{len(results)}"
            while name in self.locals:
                name += "_"
            self.locals[name] = kind
            texts.append(f"&{name}")
            uses |= {name}
            results.append(Expr(name, kind, uses=frozenset({name})))
        self.out.append(printer.Line(f"{function.name}({', '.join(texts)});", uses))
        return Items(tuple(results))

    def call_statement(self, node: ast.expr) -> None:
        """A call whose result is not used."""
        if not isinstance(node, ast.Call):
            raise self.source.error(node, "a statement that does nothing")
        if plain(self.called(node)) in self.translator.unneeded:
            return
        value = self.call(node)
        if isinstance(value, Expr):
            self.out.append(printer.Line(f"{value.text};", value.uses))
