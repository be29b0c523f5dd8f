"""Packages that only some uses need: loaded then, and named with their extra where they are absent."""

import importlib
from typing import Any


class MissingExtraError(ImportError):
    """A package of an optional extra is not installed."""


def load(module: str, extra: str, purpose: str) -> Any:
    """Import a module of an optional extra."""
    package = module.partition(".")[0]
    try:
        importlib.import_module(package)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise MissingExtraError(
            f"{purpose} needs {package}, which is not installed: pip install 'piezoest[{extra}]'",
            name=package,
        ) from None
    return importlib.import_module(module)
