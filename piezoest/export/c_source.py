"""Python functions as the translator reads them: tree, comments, and how often names are assigned."""

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

    @property
    def parameters(self) -> list[str]:
        """Names of the parameters."""
        return [argument.arg for argument in self.tree.args.args]

    @property
    def owner(self) -> str:
        """Its module's last name; the folder's where that is ``base``."""
        module = (self.function.__module__ or "policies").split(".")
        return str(module[-2] if module[-1] == "base" else module[-1]).lstrip("_")

    def error(self, node: ast.AST, problem: str) -> TranslationError:
        """The refusal of a construct."""
        line = self.first_line + getattr(node, "lineno", 1) - 1
        return TranslationError(f"{self.file}:{line}: {problem}")


@cache
def read(function: Any) -> Source:
    """Read a function's source."""
    try:
        lines, first_line = inspect.getsourcelines(function)
    except (TypeError, OSError) as error:
        raise TranslationError(f"{function!r} has no Python source to translate: {error}") from None
    tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
    path = Path(function.__code__.co_filename)
    file = "/".join(path.parts[path.parts.index("piezoest") :]) if "piezoest" in path.parts else path.name
    if path.name.startswith("<"):
        file = "written out"
    if type(tree) is not ast.FunctionDef:
        raise TranslationError(f"{file}:{first_line}: only plain functions can be translated to C")
    arguments = tree.args
    if arguments.vararg or arguments.kwarg or arguments.kwonlyargs or arguments.defaults:
        raise TranslationError(
            f"{file}:{first_line}: {tree.name} has default, keyword or starred parameters: "
            "give it positional ones only"
        )
    return Source(function, tree, file, first_line, _comments(lines), _assignments(tree))


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
        if type(node) is ast.Name and type(node.ctx) is ast.Store:
            counts[node.id] = counts.get(node.id, 0) + 1
        target = getattr(node, "target", None)
        if type(target) is ast.Name:
            counts[target.id] = counts.get(target.id, 0) + 1
    return counts
