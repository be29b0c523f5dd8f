"""What measured times depend on."""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.metadata
import os
import platform
import sys
from pathlib import Path
from typing import Any

DISTRIBUTIONS = ("piezoest", "numpy", "scipy", "numba", "casadi", "filterpy")


def cpu_name() -> str:
    """Name of the processor, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def describe_machine() -> dict[str, Any]:
    """Processor, system and Python."""
    return {
        "cpu": cpu_name(),
        "cores": os.cpu_count(),
        "platform": platform.platform(),
        "python": f"{platform.python_implementation()} {platform.python_version()}",
    }


def versions() -> dict[str, str]:
    """Versions of this package and of those that do its arithmetic."""
    return {name: importlib.metadata.version(name) for name in DISTRIBUTIONS}


@functools.cache
def fingerprint() -> str:
    """Sixteen hexadecimal digits that change with every file of this package's own source."""
    root = Path(__file__).resolve().parents[1]
    found = hashlib.sha256()
    for path in sorted(path for path in root.rglob("*") if path.suffix in (".py", ".json", ".csv")):
        found.update(path.relative_to(root).as_posix().encode())
        found.update(path.read_bytes())
    return found.hexdigest()[:16]


def code_of(source: str | Path | None) -> str:
    """Fingerprint of this package and, if there is one, of the file of a class of one's own."""
    if source is None:
        return fingerprint()
    return f"{fingerprint()}-{hashlib.sha256(Path(source).read_bytes()).hexdigest()[:16]}"


def imported(path: str) -> Any:
    """What ``module:name`` stands for; the module may lie in the working directory."""
    module, _, name = path.partition(":")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise ValueError(f"{path}: {error}") from None
