"""Learn a piezo stage's hysteresis while it runs, and cancel it."""

import lazy_loader as _lazy

_load, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """Import a public name when it is first asked for."""
    if name not in __all__:
        raise AttributeError(f"piezoest has no attribute {name!r}")
    return _load(name)
