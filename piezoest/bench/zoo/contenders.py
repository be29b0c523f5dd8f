"""Controllers by name, as the command line gives them, and the library's parts wired by hand."""

import functools
import inspect
from typing import Any

import numpy as np

import piezoest
from piezoest._checks import FloatArray
from piezoest.bench.origin import imported
from piezoest.bench.zoo.running import Factory
from piezoest.compensators import InverseCompensator, VoltageLimits
from piezoest.estimators.rls import HysteresisRLS

PARTS = "parts"
CANDIDATES = ("HysteresisRLS", "OutputErrorRLS", "PrandtlIshlinskiiRLS")  # of the default controller
# The default controller, changed: with the line alone, with all the room, and with one estimator.
CHANGED: dict[str, dict[str, Any]] = {
    "line": {"estimators": ()},
    "no-corridor": {"corridor": 1.0},
    **{name: {"estimators": (getattr(piezoest, name),)} for name in (*CANDIDATES, "HysteresisEKF")},
}
NEEDED = ("step", "run", "learn")
DEFAULT = "AdaptiveFeedforward"
UPDATE_INTERVAL = 50  # samples, of the parts wired by hand


class Parts:
    """`InverseCompensator` and `HysteresisRLS` wired by hand, with all their defaults."""

    events: tuple[()] = ()  # there is nobody who watches

    def __init__(self, sample_rate: float, limits: VoltageLimits) -> None:
        self._estimator = HysteresisRLS(sample_rate)
        self._compensator = InverseCompensator(self._estimator.model, limits)
        self.status = {"model": "coleman-hodgdon"}
        self._u: list[FloatArray] = []
        self._x: list[FloatArray] = []

    def step(self, r: float) -> float:
        """Voltage for a reference."""
        return float(self._compensator.step(r))

    def run(self, r: FloatArray) -> FloatArray:
        """Voltages for references, shape (N,)."""
        return self._compensator.run(r)

    def learn(self, u: Any, x: Any) -> None:
        """Take up voltages and readings, and now and then a model."""
        self._u.append(np.array(u, ndmin=1, dtype=float))
        self._x.append(np.array(x, ndmin=1, dtype=float))
        if sum(part.size for part in self._u) < UPDATE_INTERVAL:
            return
        u, x = (np.concatenate(parts) for parts in (self._u, self._x))
        self._u, self._x = [], []
        self._estimator.absorb(u, x)
        self._compensator.model = self._estimator.model


def contender(name: str) -> Factory:
    """Maker of a controller.

    `name`: "parts", a name in `CHANGED`, a class of the package, or a class or function of one's own as
    ``module:name``. It is called as ``name(sample_rate, limits=limits)``.
    """
    if name == PARTS:
        return Parts
    if name in CHANGED:
        return functools.partial(piezoest.AdaptiveFeedforward, **CHANGED[name])
    if ":" not in name and not hasattr(piezoest, name):
        known = ", ".join((PARTS, *CHANGED))
        raise ValueError(f"controller {name}: choose {known}, a class of piezoest, or module:name")
    found: Any = imported(name) if ":" in name else getattr(piezoest, name)
    if inspect.isclass(found) and (missing := [each for each in NEEDED if not hasattr(found, each)]):
        lacks = " and no ".join(missing)
        raise ValueError(f"{name} has no {lacks}: it is no controller, which has {', '.join(NEEDED)}")
    return found
