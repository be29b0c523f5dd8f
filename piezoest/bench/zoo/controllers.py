"""Controllers to try the zoo with, and to compare with: a line, and the library's parts wired by hand."""

from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.compensators import InverseCompensator, VoltageLimits
from piezoest.estimators.rls import HysteresisRLS


class Line:
    """u = (r - centre)/gain within the limits; learns nothing. `gain`, `centre`: [µm/V] and [µm]."""

    def __init__(self, gain: float, centre: float, limits: VoltageLimits) -> None:
        self._gain, self._centre, self._limits = gain, centre, limits
        self.events: tuple[()] = ()
        self.status: dict[str, Any] = {"model": "line"}

    def step(self, r: float) -> float:
        """Voltage for a reference."""
        u = (r - self._centre) / self._gain
        return min(max(u, self._limits.minimum), self._limits.maximum)

    def run(self, r: FloatArray) -> FloatArray:
        """Voltages for references, shape (N,)."""
        return np.clip((r - self._centre) / self._gain, self._limits.minimum, self._limits.maximum)

    def learn(self, u: Any, x: Any) -> None:
        """Leave everything as it is."""


class Parts:
    """`InverseCompensator` and `HysteresisRLS` wired by hand, with all their defaults."""

    def __init__(self, sample_rate: float, limits: VoltageLimits, *, update_interval: int = 50) -> None:
        self._estimator = HysteresisRLS(sample_rate)
        self._compensator = InverseCompensator(self._estimator.model, limits)
        self._interval = update_interval
        self._u: list[FloatArray] = []
        self._x: list[FloatArray] = []

    @property
    def events(self) -> tuple[()]:
        """None: there is nobody who watches."""
        return ()

    @property
    def status(self) -> dict[str, Any]:
        """Model in use."""
        return {"model": "coleman-hodgdon"}

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
        if sum(part.size for part in self._u) < self._interval:
            return
        u, x = (np.concatenate(parts) for parts in (self._u, self._x))
        self._u, self._x = [], []
        self._estimator.absorb(u, x)
        self._compensator.model = self._estimator.model
