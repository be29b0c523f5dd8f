"""Statements of the kernels in C."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Any

import numpy as np

from piezoest.export import c_printer as printer
from piezoest.export.c_calls import Calls
from piezoest.export.c_source import Source, resolve
from piezoest.export.c_values import Array, Expr, Items, Known, Root, Value

if TYPE_CHECKING:
    from piezoest.export.c_translator import Translator


class Body(Calls):
    """Statements of one function."""

    def __init__(self, translator: Translator, source: Source) -> None:
        super().__init__(translator, source)
        self.returns: tuple[str, ...] | None = None
        self.inside = 0  # branches and loops around the statement at hand
        self.constant: Known | None = None
        self._temporaries = 0

    def bind_parameter(self, name: str, value: Value, slots: list[tuple[str, Any]]) -> None:
        """Give a parameter its value or its name in C."""
        if isinstance(value, Items):
            inner = []
            for i, item in enumerate(value.items):
                self.bind_parameter(f"{name}_{i}", item, slots)
                inner.append(self.names[f"{name}_{i}"])
            self.names[name] = Items(tuple(inner))
            return
        safe = self.safe(name)
        if isinstance(value, Array) and not value.table:
            root = Root()
            # The pointer passed points at the part: known entries are counted from there.
            shift = value.offset.value if isinstance(value.offset, Known) else 0
            known = tuple((i - shift, number) for i, number in value.known)
            self.names[name] = Array(safe, root, size=value.size, known=known)
            slots.append((safe, root))
        elif isinstance(value, Expr):
            self.names[name] = Expr(safe, value.kind, uses=frozenset({safe}))
            slots.append((safe, value.kind))
        else:
            self.names[name] = value
            slots.append((f"{safe} (known)", None))

    def run(self) -> list[printer.Statement]:
        """Translate the function's body."""
        return self.block(self.source.tree.body)

    def block(self, nodes: list[ast.stmt]) -> list[printer.Statement]:
        """Translate statements; those after a return are left out."""
        outer, self.out = self.out, []
        for node in nodes:
            before = len(self.out)
            ended = self.statement(node)
            comment = self.source.comments.get(node.lineno)
            if comment and len(self.out) > before:
                self.out[before].comment = comment
            if ended:
                break
        done, self.out = self.out, outer
        return done

    def statement(self, node: ast.stmt) -> bool:
        """Translate one statement; True if nothing after it is reached."""
        if isinstance(node, ast.Expr):
            if not isinstance(node.value, ast.Constant):
                self.call_statement(node.value)
        elif isinstance(node, ast.Assign):
            self.assign(node, node.targets, node.value)
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            self.assign(node, [node.target], node.value)
        elif isinstance(node, ast.AugAssign):
            self.change(node)
        elif isinstance(node, ast.Return):
            self.give_back(node)
            return True
        elif isinstance(node, ast.If):
            return self.branch(node)
        elif isinstance(node, ast.For):
            self.loop(node)
        elif isinstance(node, ast.While) and not node.orelse:
            test = self.truth(self.value(node.test), node)
            if isinstance(test, Known):
                raise self.source.error(node, "while needs a condition that changes")
            head, body = f"while ({test.text})", self.block(node.body)
            self.out.append(printer.Block(head, test.uses, body, loop=True))
        elif isinstance(node, ast.Break | ast.Continue):
            self.out.append(printer.Line("break;" if isinstance(node, ast.Break) else "continue;"))
            return True
        elif not isinstance(node, ast.Pass):
            raise self.source.error(node, f"{type(node).__name__} cannot be translated to C")
        return False

    def branch(self, node: ast.If) -> bool:
        """An if; without C where the condition is known."""
        test = self.truth(self.value(node.test), node)
        if isinstance(test, Known):
            return any(self.statement(inner) for inner in (node.body if test.value else node.orelse))
        self.inside += 1
        body, orelse = self.block(node.body), self.block(node.orelse)
        self.inside -= 1
        self.out.append(printer.Block(f"if ({test.text})", test.uses, body, orelse))
        return False

    def loop(self, node: ast.For) -> None:
        """For over a range with a fixed step."""
        called = node.iter
        if not (
            isinstance(called, ast.Call) and isinstance(called.func, ast.Name) and called.func.id == "range"
        ):
            raise self.source.error(node, "for needs range(...)")
        if not isinstance(node.target, ast.Name) or node.orelse:
            raise self.source.error(node, "for needs one name and no else")
        ends = [self.number(argument, "int") for argument in called.args]
        start, stop = (self.translator.runtime(Known(0)), ends[0]) if len(ends) == 1 else ends[:2]
        if len(ends) == 3:
            raise self.source.error(node, "range with a step: count from 0 and compute the position")
        i = "turn" if node.target.id == "_" else self.safe(node.target.id)
        self.names[node.target.id] = Expr(i, "int", uses=frozenset({i}))
        head = f"for (int {i} = {start.text}; {i} < {stop.text}; ++{i})"
        self.inside += 1
        body = self.block(node.body)
        self.inside -= 1
        self.out.append(printer.Block(head, start.uses | stop.uses, body, loop=True, own=i))

    def assign(self, node: ast.stmt, targets: list[ast.expr], value_node: ast.expr) -> None:
        """An assignment, to one or more targets."""
        if self.new_array(node, targets, value_node):
            return
        value = self.value(value_node)
        if isinstance(value, Items) and len(targets) == 1 and isinstance(targets[0], ast.Tuple):
            self.assign_items(node, targets[0].elts, value)
            return
        for target in reversed(targets):
            self.assign_one(node, target, value)
            # The other targets read the first: one evaluation, in C as in Python.
            if len(targets) > 1 and not isinstance(value, Known):
                value = self.value(_as_load(target))

    def change(self, node: ast.AugAssign) -> None:
        """An assignment of the kind x += y."""
        load = ast.copy_location(_as_load(node.target), node)
        present = self.value(load)
        sign = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*=", ast.Div: "/="}.get(type(node.op))
        if sign is None or not isinstance(present, Expr) or present.kind != "real":
            value = ast.copy_location(ast.BinOp(load, node.op, node.value), node)
            self.assign(node, [node.target], value)
            return
        number = self.real(self.value(node.value), node)
        self.check_order(node, present, number)
        place = self.entry(node.target, write=True) if isinstance(node.target, ast.Subscript) else present
        name = place.text if isinstance(node.target, ast.Name) else None
        uses = number.uses | place.uses
        self.out.append(printer.Line(f"{place.text} {sign} {number.text};", uses, name, not number.impure))

    def new_array(self, node: ast.stmt, targets: list[ast.expr], value: ast.expr) -> bool:
        """An array of fixed size within the function, as np.empty or np.zeros make it."""
        made = isinstance(value, ast.Call) and resolve(self.source.function.__globals__, value.func)
        if made not in (np.empty, np.zeros) or not isinstance(value, ast.Call):
            return False
        size = self.value(value.args[0])
        target = targets[0]
        if not isinstance(size, Known) or not isinstance(target, ast.Name) or len(targets) > 1:
            raise self.source.error(node, "a new array needs a size that is known, and one name")
        name = self.safe(target.id)
        self.locals[name] = "[]"
        self.names[target.id] = Array(name, Root(), size=int(size.value))
        start = " = {0}" if made is np.zeros else ""
        text = f"{self.translator.real} {name}[{size.value}]{start};"
        self.out.append(printer.Line(text, frozenset(), name, pure=True))
        return True

    def assign_items(self, node: ast.stmt, targets: list[ast.expr], value: Items) -> None:
        """Tuple to tuple: all values before any target, where a target could change a value."""
        if len(targets) != len(value.items):
            raise self.source.error(node, f"{len(targets)} targets for {len(value.items)} values")
        items = list(value.items)
        names = {self.safe(target.id) for target in targets if isinstance(target, ast.Name)}
        writes = any(isinstance(target, ast.Subscript) for target in targets)
        for i, item in enumerate(items[1:], 1):
            if isinstance(item, Expr) and (item.uses & names or (item.reads and writes)):
                items[i] = self.temporary(item)
        for target, item in zip(targets, items, strict=True):
            self.assign_one(node, target, item)

    def temporary(self, value: Expr) -> Expr:
        """Hold a value in a local of its own."""
        self._temporaries += 1
        name = f"held_{self._temporaries}"
        self.locals[name] = value.kind
        self.out.append(printer.Line(f"{name} = {value.text};", value.uses, name, not value.impure))
        return Expr(name, value.kind, uses=frozenset({name}))

    def assign_one(self, node: ast.stmt, target: ast.expr, value: Value) -> None:
        """Value to one name or entry."""
        if isinstance(target, ast.Subscript):
            entry = self.entry(target, write=True)
            number = self.real(value, node)
            line = printer.Line(f"{entry.text} = {number.text};", entry.uses | number.uses)
            self.out.append(line)
            return
        if not isinstance(target, ast.Name):
            raise self.source.error(node, "assign to a name or to an entry of an array")
        name, once = target.id, self.source.assigned.get(target.id, 0) == 1
        if isinstance(value, Array):
            if not once:
                raise self.source.error(node, f"{name} is given two arrays: use two names")
            self.names[name] = self.alias(name, value)
        elif once and isinstance(value, Items | Known) and not isinstance(self.names.get(name), Expr):
            self.names[name] = value
        elif isinstance(value, Items):
            raise self.source.error(node, f"{name} is given two tuples: use two names")
        else:
            self.assign_local(node, name, value)

    def assign_local(self, node: ast.stmt, name: str, value: Known | Expr) -> None:
        """Value to a local variable of C."""
        expression = self.translator.runtime(value) if isinstance(value, Known) else value
        safe = self.safe(name)
        present = self.names.get(name)
        kind = present.kind if isinstance(present, Expr) else expression.kind
        if kind != expression.kind:
            if kind != "real":
                raise self.source.error(
                    node, f"{name} changes from {kind} to {expression.kind}: start it as 0.0"
                )
            expression = self.real(expression, node)
        if not isinstance(present, Expr):
            self.locals[safe] = kind
            self.names[name] = Expr(safe, kind, uses=frozenset({safe}))
        line = printer.Line(f"{safe} = {expression.text};", expression.uses, safe, not expression.impure)
        self.out.append(line)

    def alias(self, name: str, value: Array) -> Array:
        """A name for a part of an array: a pointer in C, or just the table."""
        if value.table or value.base == self.safe(name):
            return value
        safe = self.safe(name)
        root = Root(value.root)
        offset = self.translator.runtime(value.offset) if isinstance(value.offset, Known) else value.offset
        text = value.base if offset.text == "0" else f"{value.base} + {offset.text}"
        self.locals[safe] = root
        self.out.append(printer.Line(f"{safe} = {text};", value.uses, safe, pure=True))
        shift = value.offset.value if isinstance(value.offset, Known) else 0
        return Array(safe, root, size=value.size, known=tuple((i - shift, v) for i, v in value.known))

    def give_back(self, node: ast.Return) -> None:
        """A return; several values go out through pointers."""
        value = Items(()) if node.value is None else self.value(node.value)
        if isinstance(value, Known) and not self.out and not self.inside:
            self.constant = value
        items = value.items if isinstance(value, Items) else (value,)
        if any(isinstance(item, Array | Items) for item in items):
            raise self.source.error(node, "a function that returns arrays may only name them")
        numbers = [self.translator.runtime(item) if isinstance(item, Known) else item for item in items]
        kinds = tuple(number.kind for number in numbers)
        if self.returns is None:
            self.returns = kinds
        elif len(self.returns) != len(kinds):
            raise self.source.error(node, "every return must give the same number of values")
        numbers = [
            self.real(number, node) if kind == "real" else number
            for number, kind in zip(numbers, self.returns, strict=True)
        ]
        if any(number.kind != kind for number, kind in zip(numbers, self.returns, strict=True)):
            raise self.source.error(node, "every return must give values of the same kind: write 1.0, not 1")
        if len(numbers) == 1:
            self.out.append(printer.Line(f"return {numbers[0].text};", numbers[0].uses))
            return
        if len(numbers) > 1:
            if any(number.reads or number.impure for number in numbers):
                numbers = [self.temporary(number) for number in numbers]
            for i, number in enumerate(numbers):
                self.out.append(printer.Line(f"*result_{i} = {number.text};", number.uses))
        if self.inside:
            self.out.append(printer.Line("return;"))


def _as_load(target: ast.expr) -> ast.expr:
    """The same name or entry, read."""
    if isinstance(target, ast.Name):
        return ast.copy_location(ast.Name(target.id, ast.Load()), target)
    if isinstance(target, ast.Subscript):
        return ast.copy_location(ast.Subscript(target.value, target.slice, ast.Load()), target)
    return target
