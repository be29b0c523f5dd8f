"""Check the docstrings of all public names by numpydoc's own validation; its checks stand in pyproject.toml.

python docs/check_docstrings.py
"""

import inspect
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import piezoest
from piezoest.estimators.compiled import CompiledEstimator
from piezoest.models import FreeRunning, Model
from piezoest.policies import Policy

ROOT = Path(__file__).resolve().parents[1]
# What the library asks of a class is described once, at its face.
FACES: tuple[type, ...] = (Model, FreeRunning, Policy, CompiledEstimator)


def public_objects() -> dict[str, Any]:
    """Every public class and function, once, under its shortest public name."""
    found: dict[str, Any] = {name: getattr(piezoest, name) for name in piezoest.__all__}
    for name, module in [each for each in found.items() if inspect.ismodule(each[1])]:
        own = [
            key for key, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__
        ]
        for inner in getattr(module, "__all__", [key for key in own if not key.startswith("_")]):
            value = getattr(module, inner)
            if value not in found.values():
                found[f"{name}.{inner}"] = value
    return {
        name: value for name, value in found.items() if inspect.isclass(value) or inspect.isfunction(value)
    }


def own_methods(cls: type) -> Iterator[tuple[str, Any]]:
    """Public methods and properties that the class, or a base of ours, defines."""
    for name in dir(cls):
        value = inspect.getattr_static(cls, name)
        if name.startswith("_") or name in getattr(cls, "__dataclass_fields__", {}):
            continue
        if any(cls is not face and issubclass(cls, face) and name in vars(face) for face in FACES):
            continue
        function = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
        if inspect.isfunction(function) and function.__module__.startswith("piezoest"):
            yield name, function


def raises(value: Any) -> bool:
    """Whether its source raises an error; a dataclass checks what it is given behind its constructor."""
    if inspect.isclass(value):
        value = getattr(value, "__post_init__", value.__init__)
    try:
        source = inspect.getsource(value)
    except (OSError, TypeError):  # generated, or built in
        return False
    return re.search(r"^\s+raise (Value|Key|Type|Runtime)Error", source, re.MULTILINE) is not None


def faults() -> Iterator[str]:
    """What is wrong, in words."""
    # The tests take the public names from this file, and do without numpydoc.
    from numpydoc.validate import get_validation_checks, validate

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    settings = project["tool"]["numpydoc_validation"]
    checks = get_validation_checks(set(settings["checks"]))
    objects = public_objects()
    for name, cls in list(objects.items()):
        if inspect.isclass(cls):
            objects |= {f"{name}.{method}": value for method, value in own_methods(cls)}
    for name in settings["exclude"]:
        objects.pop(name)
    for name, value in objects.items():
        errors = validate(f"piezoest.{name}")["errors"]
        yield from (f"{name}: {code} {text}" for code, text in errors if code in checks)
        # Of this numpydoc knows nothing.
        if raises(value) and "Raises\n---" not in (inspect.getdoc(value) or ""):
            yield f"{name}: raises, and does not say so"


if __name__ == "__main__":
    found = list(faults())
    print("\n".join(found) or "docstrings: all is well")
    sys.exit(bool(found))
