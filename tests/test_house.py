"""How the package is laid out: short files, no private name of another sub-package."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Private by its spelling alone, of Python itself.
PUBLIC = ("_exit", "_replace")
TEXTS = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path.read_text("utf-8")
    for path in (ROOT / "piezoest").rglob("*.py")
}


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and name not in PUBLIC


def foreign_names(module: str) -> Iterator[str]:
    nodes, foreign, own = list(ast.walk(ast.parse(TEXTS[module]))), set(), set()
    accesses: list[tuple[str, ast.Attribute]] = []
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("piezoest"):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                source = inner if inner in TEXTS else str(node.module)
                if source.split(".")[:2] != module.split(".")[:2]:
                    foreign.add(alias.asname or alias.name)
                    if is_private(alias.name) and source != inner:
                        yield f"{module}: {inner}"
        elif isinstance(node, ast.ClassDef | ast.FunctionDef):
            own.add(node.name)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            accesses.append((node.value.id, node))
    own |= {node.attr for base, node in accesses if base in ("self", "cls")}
    for base, node in accesses:
        allowed = base in ("self", "cls") or (node.attr in own and base not in foreign)
        if is_private(node.attr) and not allowed:
            yield f"{module}:{node.lineno}: {base}.{node.attr}"


def test_no_private_name_of_another_sub_package() -> None:
    assert [found for module in TEXTS for found in foreign_names(module)] == []


def test_no_file_has_more_than_400_lines() -> None:
    assert [name for name, text in TEXTS.items() if len(text.splitlines()) > 400] == []
