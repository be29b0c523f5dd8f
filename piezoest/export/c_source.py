"""Python functions as the translator reads them: tree, comments, and which parameters must be known."""

from __future__ import annotations

import ast
import inspect
import textwrap
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from piezoest.export.c_values import TranslationError


@dataclass(frozen=True, eq=False)
class Source:
    """One function."""

    function: Any
    tree: ast.FunctionDef
    file: str
    first_line: int
    comments: dict[int, list[str]]  # of the lines right above the line of that number
    assigned: dict[str, int]  # how often each name is assigned to
    needs_value: frozenset[str]  # parameters whose value shapes the code
    needs_size: frozenset[str]  # array parameters whose size does

    @property
    def parameters(self) -> list[str]:
        """Names of the parameters."""
        return [argument.arg for argument in self.tree.args.args]

    def error(self, node: ast.AST, problem: str) -> TranslationError:
        """The refusal of a construct."""
        line = self.first_line + getattr(node, "lineno", 1) - 1
        return TranslationError(f"{self.file}:{line}: {problem}")


# Functions whose sources are being read: one that calls itself is refused later, with its line.
_reading: list[Any] = []


def plain(function: Any) -> Any:
    """The Python function inside a compiled one."""
    return getattr(function, "py_func", function)


def resolve(source_globals: dict[str, Any], node: ast.AST) -> Any:
    """Object that a name or a dotted name stands for outside of the function, or None."""
    if isinstance(node, ast.Name):
        return source_globals.get(node.id)
    if isinstance(node, ast.Attribute):
        owner = resolve(source_globals, node.value)
        return getattr(owner, node.attr, None) if owner is not None else None
    return None


@cache
def read(function: Any) -> Source:
    """Read a function's source.

    Raises
    ------
    TranslationError
        If it has none, or defaults, keyword or starred parameters.
    """
    function = plain(function)
    try:
        lines, first_line = inspect.getsourcelines(function)
    except (TypeError, OSError) as error:
        raise TranslationError(f"{function!r} has no Python source to translate: {error}") from None
    tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
    path = Path(inspect.getsourcefile(function) or "?")
    file = "/".join(path.parts[path.parts.index("piezoest") :]) if "piezoest" in path.parts else path.name
    if not isinstance(tree, ast.FunctionDef):
        raise TranslationError(f"{file}:{first_line}: only plain functions can be translated to C")
    arguments = tree.args
    if arguments.vararg or arguments.kwarg or arguments.kwonlyargs or arguments.defaults:
        raise TranslationError(
            f"{file}:{first_line}: {tree.name} has default, keyword or starred parameters: "
            "give it positional ones only"
        )
    tree.decorator_list = []
    _reading.append(function)
    needs_value, needs_size = _needs(tree, function.__globals__)
    _reading.pop()
    return Source(
        function, tree, file, first_line, _comments(lines), _assignments(tree), needs_value, needs_size
    )


def _comments(lines: list[str]) -> dict[int, list[str]]:
    found: dict[int, list[str]] = {}
    block: list[str] = []
    for number, line in enumerate(lines, 1):
        stripped = line.strip()
        if stripped.startswith("#"):
            block.append(stripped[1:].strip().replace("*/", "* /"))
        elif stripped:
            if block:
                found[number] = block
            block = []
    return found


def _assignments(tree: ast.FunctionDef) -> dict[str, int]:
    """Assignments by name; a loop's variable and `+=` count twice, for they never hold one value."""
    counts: dict[str, int] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            counts[node.id] = counts.get(node.id, 0) + 1
    for node in ast.walk(tree):
        target = getattr(node, "target", None)
        if isinstance(node, ast.For | ast.AugAssign) and isinstance(target, ast.Name):
            counts[target.id] += 1
    return counts


def _names(node: ast.AST | None) -> set[str]:
    return set() if node is None else {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def _is_part(node: ast.AST) -> bool:
    return isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice)


def _needs(tree: ast.FunctionDef, names: dict[str, Any]) -> tuple[frozenset[str], frozenset[str]]:
    """Parameters whose value, and arrays whose size, decide what the code looks like."""
    values: set[str] = set()
    sizes: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.For):
            values |= _names(node.iter)
        elif isinstance(node, ast.If | ast.IfExp | ast.While):
            values |= _names(node.test)
        elif isinstance(node, ast.Slice):
            values |= _names(node.lower) | _names(node.upper)
        elif _is_part(node) or (isinstance(node, ast.Attribute) and node.attr in ("size", "shape")):
            assert isinstance(node, ast.Subscript | ast.Attribute)
            sizes |= _names(node.value)
        elif isinstance(node, ast.Call):
            _needs_of_call(node, names, values, sizes)
    # A local stands for the parameters it is made of.
    for _ in range(3):
        for node in ast.walk(tree):
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                if node.targets[0].id in values:
                    values |= _names(node.value)
                if node.targets[0].id in sizes:
                    sizes |= _names(node.value)
    parameters = {argument.arg for argument in tree.args.args}
    return frozenset(values & parameters), frozenset(sizes & parameters)


def _needs_of_call(node: ast.Call, names: dict[str, Any], values: set[str], sizes: set[str]) -> None:
    called = resolve(names, node.func)
    name = getattr(called, "__name__", "")
    if called is None or called is min or called is max:
        # A parameter that is called: what it needs is not known here.
        sizes.update(*(_names(argument) for argument in node.args))
        return
    if name in ("empty", "int"):
        values.update(*(_names(argument) for argument in node.args))
        return
    if plain(called) in _reading:
        return
    if not inspect.isfunction(plain(called)) or getattr(called, "__module__", "").startswith("numpy"):
        return
    inner = read(called)
    for parameter, argument in zip(inner.parameters, node.args, strict=False):
        if parameter in inner.needs_value:
            values |= _names(argument)
        if parameter in inner.needs_size:
            sizes |= _names(argument)
