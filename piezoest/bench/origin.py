"""What every file of results says of the machine and the code, and where such a file goes."""

import ast
import functools
import hashlib
import importlib
import importlib.metadata
import inspect
import json
import math
import os
import platform
import re
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from piezoest._files import write_text

# This package and those that do its arithmetic.
DISTRIBUTIONS = ("piezoest", "numpy", "scipy", "numba", "casadi", "filterpy")
PACKAGE = Path(__file__).resolve().parents[1]
DIGITS = 16  # of a fingerprint


def cpu_name() -> str:
    """Name of the processor, as far as the system tells."""
    file = Path("/proc/cpuinfo")
    found = re.search(r"^model name\s*: (.*)$", file.read_text() if file.exists() else "", re.MULTILINE)
    return found[1].strip() if found else platform.processor() or platform.machine()


def _sources(root: Path) -> list[Path]:
    """Files of the package's own source."""
    return sorted(path for path in root.rglob("*") if path.suffix in (".py", ".json", ".csv"))


@functools.cache
def code_of_parts(root: Path = PACKAGE) -> dict[str, str]:
    """What this package's own source is, by folder: digits that change with all but comments and docstrings.

    `root`: where the package is; another version of it may be elsewhere. It takes a second.
    """
    found: dict[str, Any] = {}
    for path in _sources(root):
        part = found.setdefault(path.parent.relative_to(root).as_posix(), hashlib.sha256())
        part.update(path.name.encode())
        content = path.read_bytes()
        part.update(repr(_shape(ast.parse(content))).encode() if path.suffix == ".py" else content)
    return {name: part.hexdigest()[:DIGITS] for name, part in found.items()}


def _shape(node: Any) -> Any:
    """A syntax tree as lists, without docstrings and what only some versions of Python fill in."""
    match node:
        case ast.AST():
            fields = [(name, value) for name, value in ast.iter_fields(node) if value not in (None, [])]
            return [type(node).__name__, *((name, _shape(value)) for name, value in fields)]
        case list():
            return [_shape(each) for each in node if not _is_text(each)]
    return repr(node)


def _is_text(node: Any) -> bool:
    """Whether a statement is a string alone, as a docstring is."""
    match node:
        case ast.Expr(value=ast.Constant(value=str())):
            return True
    return False


@functools.cache
def fingerprint() -> str:
    """Hexadecimal digits that change with every file of this package's own source."""
    found = hashlib.sha256()
    for path in _sources(PACKAGE):
        found.update(path.relative_to(PACKAGE).as_posix().encode())
        found.update(path.read_bytes())
    return found.hexdigest()[:DIGITS]


def code_of(text: str) -> str:
    """Fingerprint of this package and, for a class of one's own, of its file."""
    source = source_of(text)
    if source is None:
        return fingerprint()
    return f"{fingerprint()}-{hashlib.sha256(source.read_bytes()).hexdigest()[:DIGITS]}"


def source_of(text: str) -> Path | None:
    """File of ``module:name``, with arguments or without; None for a name of the package."""
    name = name_of(text)
    source = inspect.getsourcefile(imported(name)) if ":" in name else None
    return None if source is None else Path(source)


def name_of(text: str) -> str:
    """Name in a description, without its arguments."""
    return text.partition("(")[0].strip()


def imported(path: str) -> Any:
    """What ``module:name`` stands for; the module may lie in the working directory."""
    module, _, name = path.partition(":")
    if module.startswith(".") or module.endswith(".py"):
        raise ValueError(f"{path}: name the module as in import, such as {Path(module).stem}:{name}")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from None


def origin(began: float | None = None) -> dict[str, Any]:
    """When, on what and by which versions; and how long it took since `began` on `time.perf_counter`."""
    head = {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": {
            "cpu": cpu_name(),
            "cores": os.cpu_count(),
            "platform": platform.platform(),
            "python": f"{platform.python_implementation()} {platform.python_version()}",
        },
        "versions": {name: importlib.metadata.version(name) for name in DISTRIBUTIONS},
        "code": code_of_parts(),
    }
    return head if began is None else {**head, "seconds": round(time.perf_counter() - began, 1)}


def machine_of(document: dict[str, Any]) -> str:
    """Machine and Python of a document, in words."""
    machine = document["machine"]
    return f"{machine['cpu']}, {machine['cores']} cores, {machine['python']}"


def put(document: dict[str, Any], path: Path | None) -> None:
    """Write results to a file, or print them where there is none."""
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    if path is None:
        print(text, end="")
    else:
        write_text(path, text)


def json_safe(value: Any, digits: int | None = None) -> Any:
    """The same with plain lists, None for what is not finite, and so many significant digits."""
    match value:
        case dict():
            return {key: json_safe(item, digits) for key, item in value.items()}
        case list() | tuple():
            return [json_safe(item, digits) for item in value]
        case float() if not math.isfinite(value):
            return None
        case float() if digits is not None:
            return float(f"{value:.{digits}g}")
    return value
