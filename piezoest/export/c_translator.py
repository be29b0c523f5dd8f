"""Translate the kernels, plain Python on numbers and records, into C99.

A function is translated for the records, sizes and constants that it is called with: branches that cannot be
reached disappear, what is absent is not there, loops have fixed ends. The subset is that of the kernels;
anything else is refused, so that no construct is translated by guess.
"""

import ast
from typing import Any

from piezoest.export.c_expressions import Expressions, as_load, negated
from piezoest.export.c_file import File, Function
from piezoest.export.c_printer import Statement, declare, drop_unused, used_names
from piezoest.export.c_source import Source, read
from piezoest.export.c_values import Array, Items, Known, Number, Refused, Room, Root, Struct, Value, number


def translate(file: File, function: Any, arguments: list[Value]) -> tuple[Function, list[Value]]:
    """Translate a function for such arguments; returns also what of them is left to hand over."""
    source = read(getattr(function, "function", function))
    if len(arguments) != len(source.parameters):
        count = f"{len(source.parameters)} arguments, got {len(arguments)}"
        raise source.error(source.tree, f"{source.tree.name} takes {count}")
    settled = [
        # A number that the function changes is a variable, even if its first value is known.
        number(value, file.single)
        if value.is_number and name in source.assigned
        else value.settled(file.single)
        for name, value in zip(source.parameters, arguments, strict=True)
    ]
    key = (source.function, tuple(argument.identity() for argument in settled))
    if key in file.in_work:
        raise source.error(source.tree, f"{source.tree.name} calls itself: write a loop")
    if key not in file.functions:
        file.in_work.append(key)
        # Behind those that it calls.
        file.functions[key] = _translated(file, source, settled)
        file.in_work.pop()
    return file.functions[key], _flat(settled)


def call(file: File, function: Any, arguments: list[Value]) -> str:
    """Text of a call of the translated function."""
    made, flat = translate(file, function, arguments)
    given: list[Any] = [flat[place] for place, _, _ in made.parameters]
    return f"{made.name}({', '.join(getattr(each, 'address', each.text) for each in given)})"


def _translated(file: File, source: Source, arguments: list[Value]) -> Function:
    body = Body(file, source)
    for name, value in zip(source.parameters, arguments, strict=True):
        body.names[name] = body.bind(name, value)
    statements = drop_unused(body.block(source.tree.body))
    used = used_names(statements)
    parameters = [
        (place, root, _declaration(file, root, value))
        for place, (root, value) in enumerate(body.slots)
        if root is not None and root.name in used
    ]
    for name, kind in body.locals.items():
        declare(statements, name, kind and file.type_of(kind))
    name = file.unused(
        f"{source.owner}_{source.tree.name.lstrip('_')}", {made.name for made in file.functions.values()}
    )
    impure = any(root.written for _, root, _ in parameters)
    return Function(name, source, parameters, body.returns or (), statements, impure, body.constant)


def _declaration(file: File, root: Root, value: Value) -> str:
    """Of a parameter."""
    const = "const " if root.is_const else ""
    if type(value) is Struct:
        return f"{const}{file.struct(value.layout, value.path)} *{root.name}"
    if type(value) is Array:
        return f"{const}{file.real} {root.name}{''.join(f'[{count}]' for count in value.shape)}"
    return f"{file.type_of(value.identity())} {root.name}"


def _flat(values: list[Value]) -> list[Value]:
    flat: list[Value] = []
    for value in values:
        flat += _flat(list(value.items)) if type(value) is Items else [value]
    return flat


class Body(Expressions):
    """Statements of one function."""

    def __init__(self, file: File, source: Source) -> None:
        super().__init__(file, source)
        self.returns: tuple[str, ...] | None = None
        self.slots: list[tuple[Root | None, Value]] = []  # of the parameters
        self.inside = -1  # branches and loops around the statement at hand; no statement yet
        self.constant: Known | None = None

    def bind(self, name: str, value: Value) -> Value:
        """What a parameter is inside the function: a value that is known, or a name in C."""
        if type(value) is Items:
            return Items(tuple(self.bind(f"{name}_{i}", item) for i, item in enumerate(value.items)))
        bound, root = value.as_parameter(self.safe(name))
        self.slots.append((root, value))
        return bound

    def block(self, nodes: list[ast.stmt]) -> list[Statement]:
        """Translate statements; those after a return are left out."""
        outer, self.out = self.out, []
        self.inside += 1
        self.sequence(nodes)
        self.inside -= 1
        done, self.out = self.out, outer
        return done

    def sequence(self, nodes: list[ast.stmt]) -> bool:
        """Translate statements in the present block; True if nothing after them is reached."""
        for node in nodes:
            before = len(self.out)
            ended = self.visit(node)
            comment = self.source.comments.get(node.lineno)
            if comment and len(self.out) > before:
                self.out[before].comment = comment
            if ended:
                return True
        return False

    # ------------------------------------------------------------ branches and loops

    def visit_Pass(self, node: ast.Pass) -> None:
        """Nothing."""

    def visit_Expr(self, node: ast.Expr) -> None:
        """A call whose result is not used, or a docstring."""
        if type(node.value) is ast.Constant:
            return
        if type(node.value) is not ast.Call:
            raise Refused("a statement that does nothing")
        if self.called(node.value) in self.file.unneeded:
            return
        value = self.value(node.value)
        if type(value) is Number and value.text:
            self.out.append(Statement(f"{value.text};", value.uses))

    def visit_If(self, node: ast.If) -> bool:
        """An if; without C where the condition is known."""
        test = self.value(node.test).truth()
        if test.is_known:
            return self.sequence(node.body if test.value else node.orelse)
        body, orelse = self.block(node.body), self.block(node.orelse)
        number = self.number(test)
        if body or orelse:
            head = f"if ({number.text if body else negated(number).text})"
            self.out.append(Statement(head, number.uses, body=body or orelse, orelse=orelse if body else []))
        return False

    def visit_For(self, node: ast.For) -> None:
        called: Any = node.iter
        if type(called) is not ast.Call or getattr(called.func, "id", "") != "range":
            raise Refused("for needs range(...)")
        if type(node.target) is not ast.Name or node.orelse:
            raise Refused("for needs one name and no else")
        values = self.arguments(called.args)
        step = values.pop() if len(values) == 3 else Known(1)
        if not (step.is_known and step.is_whole and step.value > 0):
            raise Refused("range with a step that is not known to be above 0")
        start, stop = values if len(values) == 2 else (Known(0), values[0])
        if start.is_known and stop.is_known and start.value >= stop.value:
            return
        first, last = self.number(start, "int"), self.number(stop, "int")
        if last.reads or last.impure:
            last = self.hold(last)
        i = "turn" if node.target.id == "_" else self.safe(node.target.id)
        self.names[node.target.id] = Number(i, "int", uses=frozenset({i}))
        body = self.block(node.body)
        on = f"++{i}" if step.value == 1 else f"{i} += {step.value}"
        head = f"for (int {i} = {first.text}; {i} < {last.text}; {on})"
        self.out.append(Statement(head, first.uses | last.uses, body=body, loop=True, own=i))

    def visit_While(self, node: ast.While) -> None:
        before = len(self.out)
        test = self.value(node.test).truth()
        if test.is_known or node.orelse or len(self.out) > before:
            raise Refused(
                "while needs a condition that changes, without calls of several results, and no else"
            )
        number = self.number(test)
        body = self.block(node.body)
        self.out.append(Statement(f"while ({number.text})", number.uses, body=body, loop=True))

    def visit_Break(self, node: ast.Break | ast.Continue) -> bool:
        self.out.append(Statement(f"{type(node).__name__.lower()};"))
        return True

    visit_Continue = visit_Break  # noqa: N815

    def visit_Return(self, node: ast.Return) -> bool:
        """A return; several values go out through pointers."""
        value = Items() if node.value is None else self.value(node.value)
        if type(value) is Known and not self.out and not self.inside:
            self.constant = value
        numbers = [self.number(item) for item in (value.items if type(value) is Items else (value,))]
        kinds = tuple(number.kind for number in numbers)
        self.returns = kinds if self.returns is None else self.returns
        if len(self.returns) != len(kinds):
            raise Refused("every return must give the same number of values")
        pairs = zip(numbers, self.returns, strict=True)
        numbers = [self.number(each, "real") if kind == "real" else each for each, kind in pairs]
        if tuple(number.is_whole for number in numbers) != tuple(kind != "real" for kind in self.returns):
            raise Refused("every return must give values of the same kind: write 1.0, not 1")
        if len(numbers) == 1:
            self.out.append(Statement(f"return {numbers[0].text};", numbers[0].uses))
            return True
        # The places of the results may be those that are read.
        numbers = [self.hold(number) if number.reads or number.impure else number for number in numbers]
        for i, each in enumerate(numbers):
            self.out.append(Statement(f"*result_{i} = {each.text};", each.uses))
        if self.inside:
            self.out.append(Statement("return;"))
        return True

    # ------------------------------------------------------------ assignments

    def visit_Assign(self, node: ast.Assign) -> None:
        """An assignment, to one or more targets."""
        target = node.targets[0]
        if type(target) is ast.Tuple:
            names = [self.safe(getattr(each, "id", "")) for each in target.elts]
            self.wanted = names if all(type(each) is ast.Name for each in target.elts) else []
            self.assign_items(target.elts, self.value(node.value))
            return
        value = self.value(node.value)
        for target in node.targets:
            self.assign(target, value)
            # The other targets read the first: one evaluation, in C as in Python.
            if len(node.targets) > 1 and not value.is_known:
                value = self.value(as_load(target))

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        present, value = self.arguments([as_load(node.target), node.value])
        sign = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*=", ast.Div: "/="}.get(type(node.op))
        held = self.write(node.target).text != getattr(present, "text", "")
        if sign is None or held or present.is_whole:
            self.assign(node.target, self.operate(node.op, present, value))
            return
        assert type(present) is Number
        number = self.number(value, "real")
        name = present.text if type(node.target) is ast.Name else None
        uses = number.uses | present.uses
        self.out.append(Statement(f"{present.text} {sign} {number.text};", uses, name, not number.impure))

    def assign_items(self, targets: list[ast.expr], value: Value) -> None:
        """Tuple to tuple: all values before any target, where a target could change a value."""
        if type(value) is not Items or len(targets) != value.length():
            raise Refused(f"{len(targets)} targets need as many values")
        items = list(value.items)
        names = {self.safe(target.id) for target in targets if type(target) is ast.Name}
        writes = any(type(target) is not ast.Name for target in targets)
        for i, item in enumerate(items[1:], 1):
            there = getattr(item, "text", "") == self.safe(getattr(targets[i], "id", ""))
            later = type(item) is Number and (item.uses & names or (item.reads and writes) or item.impure)
            if later and not there:
                items[i] = self.hold(item)
        for target, item in zip(targets, items, strict=True):
            self.assign(target, item)

    def assign(self, target: ast.expr, value: Value) -> None:
        """Value to one name, field or entry."""
        if type(target) is not ast.Name:
            number = self.number(value, "real")
            if number.impure and type(target) is ast.Subscript:
                number = self.hold(number)
            place = self.write(target)
            self.out.append(Statement(f"{place.text} = {number.text};", place.uses | number.uses))
            return
        name, once = target.id, self.source.assigned.get(target.id, 0) == 1
        present = self.names.get(name)
        if type(value) is Room:
            self.names[name] = value = self.new_array(self.safe(name), value.shape)
        elif not value.is_number or (once and value.is_known and type(present) is not Number):
            if not once and not (value.is_number or value == present):
                raise Refused(f"{name} is given two values that are no numbers: use two names")
            self.names[name] = value
        else:
            self.assign_local(name, self.number(value), present)

    def new_array(self, name: str, shape: tuple[int, ...]) -> Array:
        """An array of the function's own."""
        self.locals[name] = ""
        text = f"{self.file.real} {name}{''.join(f'[{count}]' for count in shape)};"
        self.out.append(Statement(text, frozenset(), name, pure=True))
        return Array(name, shape, Root(name))

    def assign_local(self, name: str, number: Number, present: Value | None) -> None:
        """Value to a local variable of C."""
        safe = self.safe(name)
        kind = present.kind if type(present) is Number else number.kind
        if kind == "real":
            number = self.number(number, "real")
        elif not number.is_whole:
            raise Refused(f"{name} changes from {kind} to {number.kind}: start it as 0.0")
        if type(present) is not Number:
            self.locals[safe] = kind
            self.names[name] = Number(safe, kind, uses=frozenset({safe}))
        if number.text != safe:
            self.out.append(Statement(f"{safe} = {number.text};", number.uses, safe, not number.impure))

    def write(self, target: Any) -> Number:
        """A name, field or entry as text, for writing into it."""
        place = self.value(as_load(target))
        owner: Any = self.value(target.value) if type(target) is not ast.Name else None
        if type(place) is not Number or (type(owner) is Array and owner.values is not None):
            raise Refused("this is constant in C, and cannot be assigned to")
        if owner is not None:
            owner.root.write()
        return place

    # ------------------------------------------------------------ calls

    def invoke(self, called: Any, arguments: list[Value], wanted: list[str]) -> Value:
        """A call of a translated function; several results arrive in locals, of the names `wanted`."""
        value: Any
        flat: list[Any]
        function, flat = translate(self.file, called, arguments)
        passed = [] if function.constant else [place for place, _, _ in function.parameters]
        for place, value in enumerate(flat):
            if type(value) is Number and value.impure and place not in passed:
                # Its result is not used, but what it does is.
                self.out.append(Statement(f"{value.text};", value.uses))
        if function.constant is not None:
            return function.constant
        texts: list[str] = []
        uses: frozenset[str] = frozenset()
        numbers: list[Any] = [flat[place] for place in passed if type(flat[place]) is Number]
        for place, root, _ in function.parameters:
            value = flat[place]
            texts.append(getattr(value, "address", value.text))
            uses |= value.uses if type(value) is Number else {value.root.name}
            if type(value) is not Number:
                value.root.hand_over(root)
        reads = len(numbers) < len(passed) or any(each.reads for each in numbers)
        impure = function.impure or any(each.impure for each in numbers)
        if len(function.returns) <= 1:
            text = f"{function.name}({', '.join(texts)})" if function.body else ""
            kind = function.returns[0] if function.returns else "none"
            return Number(text, kind, uses=uses, reads=reads, impure=impure)
        results = []
        for i, kind in enumerate(function.returns):
            name = wanted[i] if wanted else ""
            if not name or self.locals.get(name, kind) != kind or name in self.source.parameters:
                name = self.file.unused(f"{function.source.tree.name.strip('_')}_{i}", set(self.locals))
            self.locals[name] = kind
            texts.append(f"&{name}")
            uses |= {name}
            results.append(Number(name, kind, uses=frozenset({name})))
        self.out.append(Statement(f"{function.name}({', '.join(texts)});", uses))
        return Items(tuple(results))
