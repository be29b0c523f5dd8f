"""A model described by two functions of one sample: the shortest way to a model of your own.

They are in the module of the class, and are used with numbers, in compiled loops and with CasADi symbols:

- ``displacement(state, u_0, u, constants)``: displacement [µm], without offset, after the voltage has gone
  from u_0 to u; it updates the array ``state``, and changes nothing if u is u_0;
- ``voltage(state, u_0, x, constants)``: the voltage u after which ``displacement`` is x; it does not change
  ``state``.

Both, and the functions that they call, are marked ``@inlined``; ``constants`` are read by index, in the order
of `parameter_names`. Symbols have no value, so ``displacement`` must not use ``if``, ``while``, ``min`` and
``max``, but `np.abs`, `np.sign`, `np.fmin`, `np.fmax`. ``voltage`` may branch and iterate.

Simulation, inverse, compensator, stage and fit use these two. The state is zero at rest at 0 V. A new model
in a compensator computes its state from the turning points of the voltage (wiping-out: I. D. Mayergoyz,
Mathematical Models of Hysteresis, Springer 1991). There a step is as long as a swing. A numerically
integrated model must be accurate for such steps, and the state of a model without wiping-out is only
approximate.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray, array_1d
from piezoest.compile import Record, Vector, compiled, is_marked
from piezoest.layout import FIXED, MEASURED, NUMBER, new, numbers, record
from piezoest.layout import Record as Layout
from piezoest.models._base import finite_voltage
from piezoest.models.free_running import FreeRunning

# Least parameters of a fit, relative to their start.
LEAST = 1e-6


@functools.cache
def _check_names(model: type[StepModel]) -> None:
    """Refuse a class whose names do not fit its fields."""
    for name in ("parameter_names", "parameter_units", "state_names"):
        if not isinstance(given := getattr(model, name), tuple) or not given:
            raise TypeError(f"{model.__name__}.{name} must be a tuple of names, in the class, not annotated")
    if len(model.parameter_names) != len(model.parameter_units):
        raise TypeError(f"{model.__name__}.parameter_units must have one unit per parameter")
    fields = {field.name for field in dataclasses.fields(model)}  # type: ignore[arg-type]
    if missing := [name for name in (*model.parameter_names, "offset") if name not in fields]:
        raise TypeError(f"{model.__name__} must have the fields {missing}, as numbers: offset: float = 0.0")


@functools.cache
def _check_functions(module: str) -> None:
    """Refuse a module without the two functions, or with ones that cannot be compiled."""
    for name in ("displacement", "voltage"):
        function = getattr(sys.modules[module], name, None)
        if function is None:
            raise TypeError(f"{module} has no function {name}: write it beside the class of the model")
        if not Path(inspect.getfile(function)).is_file():
            raise TypeError(f"{module}.{name} must stand in a file, for compiled code: import it from there")
        if not is_marked(function):
            raise TypeError(f"{module}.{name} cannot be compiled: mark it @inlined, of piezoest.compile")


class StepModel(FreeRunning):
    """Base class of models that are described by ``displacement`` and ``voltage`` in their module.

    A subclass is a frozen dataclass with one or more `state_names`. If some parameters may be zero or
    negative, it defines `is_admissible` and the `bounds` of a fit. A fit needs an initial model, unless the
    class has a method `guess`.

    Raises
    ------
    TypeError
        If names do not fit the fields of the class, or a function is missing, not marked or in no file.
    """

    __slots__ = ()

    remedy: ClassVar[str] = "its parameters have to be above zero"

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.inverse = _Inverse(cls)

    def __post_init__(self) -> None:
        _check_names(type(self))
        self._check_finite()

    @property
    def is_admissible(self) -> bool:
        """Whether all parameters are above zero."""
        return bool(np.all(self.theta > 0.0))

    @classmethod
    def bounds(cls, start: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """Keep parameters that start above zero above a fraction of their start."""
        above = [name for name in cls.parameter_names if start.get(name, 0.0) > 0.0]
        return {name: (LEAST * start[name], np.inf) for name in above}

    @classmethod
    def free_step(cls, state: Any, u_0: Any, u_1: Any, constants: Any) -> tuple[tuple[Any, ...], Any]:
        """State and displacement without offset after a sample."""
        after = [state[i] for i in range(len(cls.state_names))]
        try:
            x = sys.modules[cls.__module__].displacement(after, u_0, u_1, constants)
        except (TypeError, RuntimeError) as error:
            raise TypeError(
                f"{cls.__module__}.displacement does not work on a fit's symbols, which have no values: "
                "write it without if, min and max of them, by np.fmin, np.fmax, np.sign and np.abs, and read "
                "constants by index"
            ) from error
        return tuple(after), x

    def lifted(self, start: Self, least: float) -> Self:
        """The start, where the slope is less than a fraction of its slope."""
        return self if self.slope >= least * start.slope else start

    def inverse_settings(self, sample_rate: float | None) -> dict[str, Any]:
        """Constants and offset, whatever the sample rate."""
        value = dict(zip(self.parameter_names, self.theta.tolist(), strict=True))
        return {"constants": self.constants(value), "offset": self.offset}

    def stage_settings(self) -> dict[str, Any]:
        """How the model sits in a `SimulatedStage`: see `piezoest.stage.kernel`."""
        return {**self.inverse_settings(None), "gain": self.slope}

    def stage_layouts(self, settings: dict[str, Any]) -> tuple[Layout, Layout]:
        """Layouts of state and settings of a stage's hysteresis.

        Parameters
        ----------
        settings : dict
            What `stage_settings` gave.
        """
        return self.inverse.layouts(settings)

    def simulate(self, u: FloatArray) -> FloatArray:
        """Displacement for a voltage record, from rest at 0 V."""
        return self._through(_simulate, array_1d("u", u)) + self.offset

    def invert(self, r: FloatArray) -> FloatArray:
        """Voltage under which the model follows a reference exactly, from rest at 0 V."""
        if not self.is_admissible:
            raise ValueError(f"{self} is not admissible and has no inverse: {self.remedy}")
        return finite_voltage(self, self._through(_invert, array_1d("r", r) - self.offset))

    def _through(self, loop: Any, record: FloatArray) -> FloatArray:
        values = self.inverse_settings(None)
        layouts = self.inverse.layouts(values)
        result = record.copy()
        loop.of(*layouts)(new(layouts[0]), new(layouts[1], **values), result)
        return result


class _Inverse:
    """What `piezoest.compensators.inverse_kernel` asks of an inverse."""

    def __init__(self, model: type[StepModel]) -> None:
        self._model = model

    def layouts(self, settings: dict[str, Any]) -> tuple[Layout, Layout]:
        """Layouts of state, u being its voltage [V], and settings; `gain` is the slope in a stage."""
        _check_functions(self._model.__module__)
        constants = numbers(len(settings["constants"]), kind=FIXED)
        hysteresis = record(self._model.__module__, values=numbers(len(self._model.state_names)))
        state = record(__name__, u=MEASURED, hysteresis=hysteresis)
        return state, record(gain=FIXED, offset=NUMBER, constants=constants)


@register_jitable
def deform(own: Any, settings: Any, u: Any) -> Any:
    """Displacement without offset after the next voltage."""
    x = own.hysteresis.displacement(own.hysteresis.values, own.u, u, settings.constants)
    own.u = u
    return x


@register_jitable
def wanted(state: Any, settings: Any, r: Any) -> Any:
    """Voltage that moves the displacement to r."""
    own, model = state.inverse, settings.inverse
    return own.hysteresis.voltage(own.hysteresis.values, own.u, r - model.offset, model.constants)


@register_jitable
def follow(state: Any, settings: Any, wanted: Any, given: Any) -> None:
    """Let the state follow the voltage given out."""
    deform(state.inverse, settings.inverse, given)


@register_jitable
def expected(state: Any, settings: Any) -> Any:
    """Displacement at the last voltage [µm]."""
    return deform(state.inverse, settings.inverse, state.inverse.u) + settings.inverse.offset


@register_jitable
def place(state: Any, settings: Any) -> None:
    """Bring the state from rest to where the voltage's turning points lead it."""
    own = state.inverse
    own.u = 0.0
    for i in range(len(own.hysteresis.values)):
        own.hysteresis.values[i] = 0.0
    for k in range(int(state.memory.count)):
        deform(own, settings.inverse, state.memory.points[k])


@compiled
def _simulate(state: Record, settings: Record, x: Vector) -> None:
    """`x` comes as voltage and goes as displacement."""
    for k in range(len(x)):
        x[k] = deform(state, settings, x[k])


@compiled
def _invert(state: Record, settings: Record, u: Vector) -> None:
    """`u` comes as displacement and goes as voltage."""
    for k in range(len(u)):
        u[k] = state.hysteresis.voltage(state.hysteresis.values, state.u, u[k], settings.constants)
        deform(state, settings, u[k])
