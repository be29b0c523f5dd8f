"""How the package is laid out: short files, no circle of imports, no private name of another sub-package."""

from __future__ import annotations

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# Private by their spelling alone: of tuples with names, of Python itself, of Numba.
PUBLIC = ("_replace", "_asdict", "_fields", "_exit", "_reduce")
LONGEST = 400


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for path in sorted((ROOT / "piezoest").rglob("*.py"))}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}


def imported(tree: ast.Module) -> Iterator[tuple[str, str, ast.alias]]:
    """(module that is imported or imported from, name as it is used, alias) of imports from the package."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("piezoest"):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in MODULES else str(node.module), alias.asname or alias.name, alias


def owner(module: str) -> str:
    """Sub-package or module at the top that a module belongs to."""
    return ".".join(module.split(".")[:2])


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and name not in PUBLIC


def foreign_names(name: str, tree: ast.Module) -> Iterator[str]:
    """Private names of other sub-packages that a module uses."""
    foreign = set()
    for source, used, alias in imported(tree):
        if owner(source) != owner(name):
            foreign.add(used)
            if is_private(alias.name) and f"{source}" in MODULES and source.split(".")[-1] != alias.name:
                yield f"{name}: {source}.{alias.name}"
    own = {node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef | ast.FunctionDef)}
    own |= {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in ("self", "cls")
    }
    for node in ast.walk(tree):
        if not (
            isinstance(node, ast.Attribute) and is_private(node.attr) and isinstance(node.value, ast.Name)
        ):
            continue
        base = node.value.id
        if base in foreign or (node.attr not in own and base not in ("self", "cls")):
            yield f"{name}:{node.lineno}: {base}.{node.attr}"


@pytest.mark.parametrize("name", MODULES)
def test_no_private_name_of_another_sub_package(name: str) -> None:
    assert list(foreign_names(name, TREES[name])) == []


def test_a_private_name_is_seen() -> None:
    text = "from piezoest.models import creep\nfrom piezoest.tracking import _loop\ncreep._run()\nx._y\n"
    assert len(list(foreign_names("piezoest.stage.stage", ast.parse(text)))) == 3
    text = "class A:\n    def b(self, other):\n        self._c = other._c\n"
    assert list(foreign_names("piezoest.stage.stage", ast.parse(text))) == []


def test_imports_make_no_circle() -> None:
    graph = {name: {source for source, _, _ in imported(tree)} - {name} for name, tree in TREES.items()}
    assert len(list(graphlib.TopologicalSorter(graph).static_order())) >= len(MODULES)
    with pytest.raises(graphlib.CycleError):
        graphlib.TopologicalSorter({"a": {"b"}, "b": {"a"}}).prepare()


@pytest.mark.parametrize("name", MODULES)
def test_a_file_is_one_concept(name: str) -> None:
    lines = MODULES[name].read_text(encoding="utf-8").splitlines()
    assert len(lines) <= LONGEST, f"{len(lines)} lines: a file of more than {LONGEST} holds two concepts"
    assert [i for i, line in enumerate(lines, 1) if len(line) > 110] == []
