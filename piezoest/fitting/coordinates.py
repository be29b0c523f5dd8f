"""What an output-error fit varies, and what that means in parameters."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.models import FreeRunning
from piezoest.symbolic import jacobian, simulation, trace


class Coordinates:
    """Coordinates q of a fit, the parameters they stand for, and the derivative of the one by the other.

    `held`: names out of `parameters` whose values are given. `delayed`: whether the displacement lags the
    voltage, and the start state is one that a voltage brings about. `parameters`: the model's, offset, its
    start states, creep_gains[0], …, and delay [samples].
    """

    def __init__(
        self, model: type[FreeRunning], held: tuple[str, ...], creep_terms: int, delayed: bool
    ) -> None:
        self.model, self.delayed = model, delayed
        self._gains = tuple(f"creep_gains[{i}]" for i in range(creep_terms))
        others = (*self._gains, *(("delay",) if delayed else ()))
        self.parameters = (*model.parameter_names, "offset", *model.state_names, *others)
        free = (*model.coordinates(held, delayed), *(name for name in others if name not in held))
        self.free = free
        self.held = tuple(name for name in held if name in self.parameters)
        self._inputs = (*free, *self.held)
        sizes = [0] * len(self._inputs)
        self._value = trace(self._physical, *sizes)
        self._derivative: Callable[..., FloatArray] = jacobian(self._physical, *sizes)
        self._count = self._value.size1_out(0) - len(self.parameters)
        states = max(1, len(model.state_names) + creep_terms)
        constants = self._count - 1 - creep_terms - delayed - states
        self.simulation = simulation(model, constants, creep_terms, delayed)

    def _physical(self, *values: Any) -> tuple[Any, ...]:
        """Simulation's (p, s), then `parameters`, from the values of the coordinates and the held ones."""
        value = dict(zip(self._inputs, values, strict=True))
        self.model.complete(value)
        delay = [value["delay"]] if self.delayed else []
        states = [*(value[name] for name in self.model.state_names), *[0.0] * len(self._gains)]
        p = (*self.model.constants(value), value["offset"], *(value[name] for name in self._gains), *delay)
        return (*p, *(states or [0.0]), *(value[name] for name in self.parameters))

    def __call__(
        self, q: FloatArray, held: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Simulation's (p, s), its derivative by q, `parameters`' values, and theirs."""
        values = (*q.tolist(), *held.tolist())
        both, by_all = self._value(*values).full()[:, 0], self._derivative(*values)
        by_q, k = by_all[:, : q.size], self._count
        return both[:k], by_q[:k], both[k:], by_q[k:]

    def of(self, model: FreeRunning, others: Mapping[str, float] = {}) -> FloatArray:
        """Coordinates of a model, moved into the admissible set; creep gains and delay from `others`."""
        value = model.coordinate_values() | dict(others)
        return np.array([value[name] for name in self.free])

    def bounds(
        self, start: FloatArray, limits: Mapping[str, tuple[float, float]] = {}
    ) -> tuple[FloatArray, FloatArray]:
        """Admissible set about a start, or narrower limits by name."""
        known = self.model.bounds(dict(zip(self.free, start.tolist(), strict=True))) | dict(limits)
        lower, upper = np.array([known.get(name, (-np.inf, np.inf)) for name in self.free]).T
        return lower, upper

    def where(self, *names: str) -> list[int]:
        """Positions of those of the coordinates that there are."""
        return [i for i, name in enumerate(self.free) if name in names]


@lru_cache(maxsize=64)
def coordinates(
    model: type[FreeRunning], held: tuple[str, ...], creep_terms: int = 0, delayed: bool = False
) -> Coordinates:
    """`Coordinates` of these arguments; made once."""
    return Coordinates(model, held, creep_terms, delayed)


def late(u: FloatArray, delay: float) -> FloatArray:
    """Voltage `delay` samples ago, linear between samples, the first one before the record."""
    if delay == 0.0:
        return u
    index = np.arange(u.size)
    return np.interp(index - delay, index, u)


def bridged(u: FloatArray) -> FloatArray:
    """Voltage with straight lines over its gaps (NaN)."""
    known = np.isfinite(u)
    index = np.arange(u.size)
    return u if known.all() else np.interp(index, index[known], u[known])
