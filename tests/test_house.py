"""How the package is laid out: short files, no circle of imports, no private name of another sub-package."""

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Private by its spelling alone, of Python itself.
PUBLIC = ("_exit", "_replace")
LONGEST = 400


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


TEXTS = {module_of(path): path.read_text(encoding="utf-8") for path in (ROOT / "piezoest").rglob("*.py")}
TREES = {name: ast.parse(text) for name, text in TEXTS.items()}


def imported(tree: ast.Module) -> Iterator[tuple[str, str, str]]:
    """(module that is imported or imported from, name as it is used, its own name) of the package's."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("piezoest"):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in TREES else str(node.module), alias.asname or alias.name, alias.name


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and name not in PUBLIC


def foreign_names(module: str, tree: ast.Module) -> Iterator[str]:
    foreign = set()
    for source, used, name in imported(tree):
        if source.split(".")[:2] != module.split(".")[:2]:
            foreign.add(used)
            if is_private(name) and source in TREES and source.split(".")[-1] != name:
                yield f"{module}: {source}.{name}"
    nodes = list(ast.walk(tree))
    named = [node for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)]
    own = {node.name for node in nodes if isinstance(node, ast.ClassDef | ast.FunctionDef)}
    own |= {node.attr for node in named if node.value.id in ("self", "cls")}  # type: ignore[attr-defined]
    for node in named:
        base: str = node.value.id  # type: ignore[attr-defined]
        allowed = base in ("self", "cls") or (node.attr in own and base not in foreign)
        if is_private(node.attr) and not allowed:
            yield f"{module}:{node.lineno}: {base}.{node.attr}"


def test_no_private_name_of_another_sub_package() -> None:
    assert [found for name, tree in TREES.items() for found in foreign_names(name, tree)] == []


def test_imports_make_no_circle() -> None:
    graph = {name: {source for source, _, _ in imported(tree)} - {name} for name, tree in TREES.items()}
    assert len(list(graphlib.TopologicalSorter(graph).static_order())) >= len(TREES)


def test_a_file_is_one_concept() -> None:
    lines = {name: len(text.splitlines()) for name, text in TEXTS.items()}
    assert {name: count for name, count in lines.items() if count > LONGEST} == {}
