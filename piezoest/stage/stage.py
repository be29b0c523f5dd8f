"""A simulated stage, put together from parts: amplifier, hysteresis, creep, mechanics, gauge."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable
from typing import Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, finite, integer, number_or_nan, positive
from piezoest.models.coleman_hodgdon import ColemanHodgdon
from piezoest.models.creep import Creep
from piezoest.models.linear_gain import LinearGain
from piezoest.models.mechanics import MassSpringDamper
from piezoest.models.prandtl_ishlinskii import PrandtlIshlinskii
from piezoest.models.preisach import Preisach
from piezoest.stage import kernel
from piezoest.stage.instruments import Amplifier, Gauge
from piezoest.stage.temperature import TemperatureLaw

Hysteresis = LinearGain | ColemanHodgdon | PrandtlIshlinskii | Preisach
HYSTERESES = (LinearGain, ColemanHodgdon, PrandtlIshlinskii, Preisach)
Schedule = Callable[[FloatArray], FloatArray]

_ONE = np.ones(1)
_NO_MECHANICS = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0])


class SimulatedStage:
    """A stage in software: voltage in, measured and true displacement out.

    One sample runs through amplifier → hysteresis → creep → mechanics → gauge. The voltage
    of `step` is held for one sample interval and the reading is taken at its end, so that
    without filters, mechanics and delay the reading is the hysteresis of the voltage itself.
    The stage starts at rest at 0 V; `step`, `run` and a run in pieces give the same bits,
    noise included.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    hysteresis : LinearGain, ColemanHodgdon, PrandtlIshlinskii or Preisach
        Voltage [V] to displacement [µm].
    creep : Creep, optional
        Slow terms added to the displacement.
    mechanics : MassSpringDamper, optional
        Resonance of the stage (5).
    amplifier : Amplifier, optional
        Converter and amplifier that drive the stage; ideal if not given.
    gauge : Gauge, optional
        Gauge and converter that measure it; ideal if not given.
    gain_schedule : callable or array_like, shape (M, 2), optional
        Factor of the hysteresis (not of its offset) over time. An array holds rows of time
        [s] and factor, joined by straight lines and constant outside. A callable gets an
        array of times [s], shape (N,), and returns the factors.
    temperature : float, callable or array_like, shape (M, 2), optional
        Temperature [°C] over time, in the same ways, or one for all times. Gain and shape of
        the hysteresis then follow `temperature_law`; without it nothing changes.
    temperature_law : TemperatureLaw, optional
        What temperature does; its defaults if not given.
    seed : int
        Start of the random numbers of the gauge's noise.

    Raises
    ------
    ValueError
        If a value is out of its range, a part is of the wrong kind, or a filter's cut-off is
        not below half the sample rate.
    """

    __slots__ = (
        "_amplifier",
        "_count",
        "_creep",
        "_displacement",
        "_gauge",
        "_generator",
        "_hysteresis",
        "_mechanics",
        "_noisy",
        "_plays",
        "_rest",
        "_sample_rate",
        "_schedule",
        "_seed",
        "_settings",
        "_state",
        "_temperature",
        "_temperature_law",
        "_terms",
    )

    def __init__(
        self,
        sample_rate: float,
        hysteresis: Hysteresis,
        creep: Creep | None = None,
        mechanics: MassSpringDamper | None = None,
        amplifier: Amplifier | None = None,
        gauge: Gauge | None = None,
        gain_schedule: Schedule | ArrayLike | None = None,
        temperature: Schedule | ArrayLike | None = None,
        temperature_law: TemperatureLaw | None = None,
        seed: int = 0,
    ) -> None:
        self._sample_rate = positive("sample_rate", sample_rate)
        self._hysteresis = _part("hysteresis", hysteresis, HYSTERESES)
        self._creep = creep if creep is None else _part("creep", creep, (Creep,))
        self._mechanics = (
            mechanics if mechanics is None else _part("mechanics", mechanics, (MassSpringDamper,))
        )
        self._amplifier = Amplifier() if amplifier is None else _part("amplifier", amplifier, (Amplifier,))
        self._gauge = Gauge() if gauge is None else _part("gauge", gauge, (Gauge,))
        self._schedule = (
            None if gain_schedule is None else _schedule("gain_schedule", "factor", gain_schedule)
        )
        self._temperature = _temperature(temperature)
        self._temperature_law = (
            TemperatureLaw()
            if temperature_law is None
            else _part("temperature_law", temperature_law, (TemperatureLaw,))
        )
        self._seed = integer("seed", seed)
        self._noisy = self._gauge.noise > 0.0
        self._displacement: float | FloatArray
        self._build()
        self.reset()

    def _build(self) -> None:
        """Lay the parts out in the flat vectors of the kernel."""
        fs = self._sample_rate
        head, thresholds, weights = _hysteresis_settings(self._hysteresis)
        gains = np.empty(0) if self._creep is None else self._creep.gains
        decays = np.empty(0) if self._creep is None else self._creep.decays(fs)
        mechanics = _NO_MECHANICS if self._mechanics is None else self._mechanics.coefficients(fs)
        amplifier, gauge = self._amplifier._settings(fs), self._gauge._settings(fs)
        self._plays, self._terms = thresholds.size, gains.size
        self._settings = np.concatenate(
            (amplifier, head, mechanics, gauge, thresholds, weights, gains, decays)
        )
        offset = self._hysteresis.offset
        sample, coleman_hodgdon = np.zeros(kernel.SAMPLE), np.zeros(2)
        gauge_filter, delay_line = self._gauge._rest_state(offset, gauge)
        self._rest = np.concatenate(
            (
                sample,
                self._amplifier._rest_state(),
                coleman_hodgdon,
                (offset, 0.0),
                gauge_filter,
                np.zeros(self._plays + self._terms),
                delay_line,
            )
        )

    @property
    def sample_rate(self) -> float:
        """Sample rate [Hz]."""
        return self._sample_rate

    @property
    def hysteresis(self) -> Hysteresis:
        """The hysteresis model."""
        return self._hysteresis

    @property
    def creep(self) -> Creep | None:
        """The creep, None if without."""
        return self._creep

    @property
    def mechanics(self) -> MassSpringDamper | None:
        """The mechanics, None if without."""
        return self._mechanics

    @property
    def amplifier(self) -> Amplifier:
        """The amplifier and its converter."""
        return self._amplifier

    @property
    def gauge(self) -> Gauge:
        """The gauge and its converter."""
        return self._gauge

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._count / self._sample_rate

    @property
    def displacement(self) -> float | FloatArray:
        """True displacement [µm]: a float after `step`, shape (N,) after `run`."""
        return self._displacement

    def step(self, u: float) -> float:
        """Apply a voltage for one sample.

        Parameters
        ----------
        u : float
            Voltage [V]. For NaN, infinity and what is no number the last finite voltage is held: a
            program may compute a NaN, an amplifier cannot put it out.

        Returns
        -------
        float
            Measured displacement at the end of the sample [µm].
        """
        factor, shape = (float(values[0]) for values in self._factors(1))
        noise = self._generator.standard_normal() if self._noisy else 0.0
        measured, displacement = kernel.step(
            self._state, self._settings, self._plays, self._terms, number_or_nan(u), noise, factor, shape
        )
        self._count += 1
        self._displacement = displacement
        return measured

    def run(self, u: FloatArray) -> FloatArray:
        """Apply a voltage record, from the current state on.

        Parameters
        ----------
        u : array_like, shape (N,)
            Voltage [V]; for NaN or infinity the last finite voltage is held.

        Returns
        -------
        ndarray, shape (N,)
            Measured displacement at the end of each sample [µm].

        Raises
        ------
        ValueError
            If u is not a 1-D array.
        """
        x = array_1d("u", u, allow_nan=True).copy()  # voltage, which the kernel turns into displacement
        measured = np.empty_like(x)
        disturbances = self._disturbances(x.size)
        kernel.run(self._state, self._settings, self._plays, self._terms, x, *disturbances, measured)
        self._displacement = x
        return measured

    def _disturbances(self, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Noise and factors of the next n samples, each of shape (n,), or (1,) for the same; time goes on."""
        factor, shape = self._factors(n)
        noise = self._generator.standard_normal(n) if self._noisy else np.zeros(1)
        self._count += n
        return noise, factor, shape

    def reset(self) -> None:
        """Go back to the start: at rest at 0 V, time zero, the same random numbers."""
        self._state = self._rest.copy()
        self._generator = np.random.default_rng(self._seed)
        self._count = 0
        self._displacement = self._hysteresis.offset

    def __copy__(self) -> Self:
        return copy.deepcopy(self)

    def _factors(self, n: int) -> tuple[FloatArray, FloatArray]:
        """Factors of the hysteresis and of its shape for the next n samples: shape (n,), or (1,) for 1."""
        if self._schedule is None and self._temperature is None:
            return _ONE, _ONE
        times = (self._count + np.arange(n)) / self._sample_rate
        factor = shape = _ONE
        if self._schedule is not None:
            factor = _values("gain_schedule", "factor", self._schedule, times)
        if self._temperature is not None:
            temperature = _values("temperature", "temperature", self._temperature, times)
            factor = factor * self._temperature_law.gain_factor(temperature)
            shape = self._temperature_law.hysteresis_factor(temperature)
        return factor, shape


def _part(name: str, value: Any, kinds: tuple[type, ...]) -> Any:
    if not isinstance(value, kinds):
        expected = " or ".join(kind.__name__ for kind in kinds)
        raise ValueError(f"{name} must be a {expected}, got {type(value).__name__}")
    return value


def _hysteresis_settings(model: Hysteresis) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(gain, a, b, centre, width, offset), thresholds and weights: all models are cases of one sum."""
    none = np.empty(0)
    if isinstance(model, ColemanHodgdon):
        return np.array([model.c, model.a, model.b, 0.0, 0.0, model.offset]), none, none
    head = np.array([model.gain, 0.0, 0.0, 0.0, 0.0, model.offset])
    if isinstance(model, PrandtlIshlinskii):
        if not model.is_plain:
            raise ValueError(
                "hysteresis must have neither bends nor creep of its own: pass creep=model.creep to the stage"
            )
        return head, model.thresholds, model.weights
    if isinstance(model, Preisach):
        head[3:5] = model.centre, model.width
        return head, model.thresholds, model.weights
    return head, none, none


def _schedule(name: str, quantity: str, schedule: Any) -> Schedule:
    """A schedule as a function of an array of times."""
    if callable(schedule):
        return cast(Schedule, schedule)
    table = np.array(schedule, dtype=np.float64)
    if table.ndim != 2 or table.shape[0] < 1 or table.shape[1] != 2:
        raise ValueError(f"{name} must have shape (M, 2), time and {quantity}, got {table.shape}")
    array_1d(name, table.ravel())
    if np.any(np.diff(table[:, 0]) <= 0.0):
        raise ValueError(f"{name} must have rising times: sort its rows, and ramp where the {quantity} jumps")
    return functools.partial(cast(Any, np.interp), xp=table[:, 0], fp=table[:, 1])


def _temperature(temperature: Any) -> Schedule | None:
    """The schedule of the temperature; a plain number stands for all times."""
    if temperature is None:
        return None
    if not callable(temperature) and np.ndim(temperature) == 0:
        temperature = [[0.0, finite("temperature", temperature)]]
    return _schedule("temperature", "temperature", temperature)


def _values(name: str, quantity: str, schedule: Schedule, times: FloatArray) -> FloatArray:
    """What a schedule returns for the times, shape (N,)."""
    values = np.empty(times.size)
    try:
        values[:] = schedule(times)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{name} must return one {quantity} per time, shape ({times.size},): {error}"
        ) from error
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{name} returned NaN or infinity after {times[0]:g} s: return finite values")
    return values
