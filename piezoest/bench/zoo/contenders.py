"""Controllers by name, as the command line gives them."""

import functools
import inspect
from typing import Any

import piezoest
from piezoest.bench import origin
from piezoest.bench.origin import imported
from piezoest.bench.zoo.controllers import Parts
from piezoest.bench.zoo.running import Factory

PARTS = "parts"
# The default controller, changed: with the line alone, with one estimator, and with all the room.
CANDIDATES = ("HysteresisRLS", "OutputErrorRLS", "PrandtlIshlinskiiRLS")  # of the default one
ALONE = (*CANDIDATES, "HysteresisEKF")
CHANGED = ("line", "no-corridor", *ALONE)
NEEDED = ("step", "run", "learn")
DEFAULT = "AdaptiveFeedforward" if hasattr(piezoest, "AdaptiveFeedforward") else PARTS


def contender(name: str) -> Factory:
    """Maker of a controller.

    `name`: "parts", a class of the package, or a class or function of one's own as ``module:name``. It is
    called as ``name(sample_rate, limits=limits)``. Or the default controller, changed: "line" has no
    candidate beside the line, "no-corridor" leaves the voltage all its room, and the name of an estimator has
    no other estimator, but the recorded loop.
    """
    found = _found(name)
    if inspect.isclass(found) and (missing := [each for each in NEEDED if not hasattr(found, each)]):
        raise ValueError(f"{name} has no {' and no '.join(missing)}: it is no controller")
    return functools.partial(_made, found)


def _made(make: Any, sample_rate: float, limits: Any, **options: Any) -> Any:
    return make(sample_rate, limits=limits, **options)


def _found(name: str) -> Any:
    if name == PARTS:
        return Parts
    if name in CHANGED:
        return functools.partial(piezoest.AdaptiveFeedforward, **_change(name))
    if ":" in name:
        return imported(name)
    if not hasattr(piezoest, name):
        known = ", ".join((PARTS, *CHANGED))
        raise ValueError(f"controller {name}: choose {known}, a class of piezoest, or module:name")
    return getattr(piezoest, name)


def _change(name: str) -> dict[str, Any]:
    """What a controller of this name is given beside sample rate and limits."""
    if name == "no-corridor":
        return {"corridor": 1.0}
    return {"estimators": (getattr(piezoest, name),) if name in ALONE else ()}


def code_of(name: str) -> str:
    """Fingerprint of this package and, for a controller of one's own, of its file."""
    return origin.code_of(inspect.getsourcefile(_found(name)) if ":" in name else None)
