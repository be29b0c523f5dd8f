"""A simulated stage: amplifier, hysteresis, creep, mechanics, gauge."""

import functools
from collections.abc import Callable
from typing import Any, ClassVar, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import (
    FloatArray,
    array_1d,
    as_floats,
    finite,
    instance,
    integer,
    number_or_nan,
    positive,
)
from piezoest.layout import Copied, new
from piezoest.models.creep import Creep
from piezoest.models.mechanics import MassSpringDamper
from piezoest.stage import kernel
from piezoest.stage.instruments import Amplifier, Gauge
from piezoest.stage.temperature import TemperatureLaw


class Hysteresis(Protocol):
    """What a stage needs of a hysteresis model."""

    @property
    def offset(self) -> float:
        """Displacement at zero voltage [µm]."""

    def simulate(self, u: FloatArray) -> FloatArray:
        """Displacement [µm] for a voltage record [V]."""

    def stage_settings(self) -> dict[str, Any]:
        """Numbers of the hysteresis by name, see `kernel.hysteresis_layouts`; those left out are zero."""


Schedule = Callable[[FloatArray], FloatArray]

_ONE = np.ones(1)
_NO_MECHANICS = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0])


class SimulatedStage(Copied):
    """A simulated stage: from a voltage to the measured and the true displacement.

    Each sample passes amplifier → hysteresis → creep → mechanics → gauge. The voltage of `step` is
    held for one sample interval, and the reading is taken at its end. So without filters, mechanics
    and delay the reading belongs to this voltage. The stage starts at rest at 0 V. `step`, `run` and
    several shorter runs give identical numbers, including the noise.

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
        Converter and amplifier before the stage; ideal if not given.
    gauge : Gauge, optional
        Sensor and converter after the stage; ideal if not given.
    gain_schedule : callable or array_like, shape (M, 2), optional
        Factor of the hysteresis (not of its offset) over time. An array holds rows of time
        [s] and factor, interpolated linearly, constant outside. A callable receives an array of
        times [s], shape (N,), and returns the factors.
    temperature : float, callable or array_like, shape (M, 2), optional
        Temperature [°C] over time, in the same ways, or one for all times. Gain and shape of
        the hysteresis then follow `temperature_law`; without it nothing changes.
    temperature_law : TemperatureLaw, optional
        Effect of temperature; its defaults if not given.
    seed : int
        Start of the random numbers of the gauge's noise.

    Raises
    ------
    ValueError
        If a value is out of its range, a part is of another class, or a filter's cut-off is
        not below half the sample rate.

    Examples
    --------
    >>> import piezoest as pz
    >>> model = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
    >>> stage = pz.SimulatedStage(10_000.0, model, gauge=pz.Gauge(noise=1e-3), seed=0)
    >>> x = stage.step(10.0)
    """

    __slots__ = (
        "_amplifier", "_count", "_creep", "_displacement", "_gauge", "_generator", "_hysteresis", "_layouts",
        "_mechanics", "_noisy", "_rest", "_run_loop", "_sample_rate", "_schedule", "_seed", "_settings",
        "_state", "_step_loop", "_temperature", "_temperature_law",
    )  # fmt: skip

    _machine_code: ClassVar[tuple[str, ...]] = ("_step_loop", "_run_loop")

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
        if not hasattr(type(hysteresis), "stage_settings"):
            raise ValueError(
                "hysteresis must be a LinearGain or another model with stage_settings(), "
                f"got {type(hysteresis).__name__}"
            )
        self._hysteresis = hysteresis
        self._creep: Creep | None = instance("creep", creep, Creep | None, "a Creep")
        self._mechanics: MassSpringDamper | None = instance(
            "mechanics", mechanics, MassSpringDamper | None, "a MassSpringDamper"
        )
        given = instance("amplifier", amplifier, Amplifier | None, "an Amplifier")
        self._amplifier: Amplifier = given or Amplifier()
        self._gauge: Gauge = instance("gauge", gauge, Gauge | None, "a Gauge") or Gauge()
        self._schedule = _schedule("gain_schedule", "factor", gain_schedule)
        self._temperature = _schedule("temperature", "temperature", _for_all_times(temperature))
        law = instance("temperature_law", temperature_law, TemperatureLaw | None, "a TemperatureLaw")
        self._temperature_law: TemperatureLaw = law or TemperatureLaw()
        self._seed = integer("seed", seed)
        self._noisy = self._gauge.noise > 0.0
        self._displacement: float | FloatArray
        self._step_loop: Any = None
        self._run_loop: Any = None
        self._build()
        self.reset()

    def _build(self) -> None:
        """Lay the parts out as the compiled loops know them; what is not there does nothing."""
        fs, offset = self._sample_rate, self._hysteresis.offset
        hysteresis = self._hysteresis.stage_settings()
        creep = {} if self._creep is None else {"gains": self._creep.gains, "decays": self._creep.decays(fs)}
        terms = len(creep.get("gains", ()))
        layouts = getattr(self._hysteresis, "stage_layouts", kernel.hysteresis_layouts)
        own_state, own_settings = layouts(hysteresis)
        settings_layout = kernel.settings_layout(own_settings, terms)
        state_layout = kernel.state_layout(own_state, terms, self._gauge.delay)
        self._layouts = state_layout, settings_layout
        self._settings = new(
            settings_layout,
            amplifier=self._amplifier._settings(fs),
            hysteresis=hysteresis,
            creep=creep,
            offset=offset,
            mechanics=_NO_MECHANICS if self._mechanics is None else self._mechanics.coefficients(fs),
            gauge=self._gauge._settings(fs),
        )
        self._rest = new(state_layout, mechanics=(offset, 0.0), gauge=self._gauge._rest(offset, fs))

    def __repr__(self) -> str:
        """Class, sample rate and kind of hysteresis."""
        return f"<{type(self).__name__}({self.sample_rate:g} Hz): {type(self._hysteresis).__name__}>"

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
            Voltage [V]. For NaN, infinity and anything that is not a number the last finite voltage is
            held: a program may compute a NaN, an amplifier cannot put it out.

        Returns
        -------
        float
            Measured displacement at the end of the sample [µm].
        """
        factor, shape = self._factors(1)
        noise = self._generator.standard_normal() if self._noisy else 0.0
        if self._step_loop is None:
            self._step_loop = kernel.step.of(*self._layouts)
        measured, displacement = self._step_loop(
            self._state, self._settings, number_or_nan(u), noise, factor.item(), shape.item()
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
        # Voltage, which the kernel turns into displacement.
        x = array_1d("u", u, allow_nan=True, sample_rate=self.sample_rate).copy()
        measured = np.empty_like(x)
        disturbances = self._disturbances(x.size)
        if self._run_loop is None:
            self._run_loop = kernel.run.of(*self._layouts)
        self._run_loop(self._state, self._settings, x, *disturbances, measured)
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


def _schedule(name: str, quantity: str, schedule: Any) -> Schedule | None:
    """A schedule as a function of an array of times; None without one."""
    if schedule is None or callable(schedule):
        return cast(Schedule | None, schedule)
    table = as_floats(name, schedule).copy()
    if table.ndim != 2 or table.shape[0] < 1 or table.shape[1] != 2:
        raise ValueError(f"{name} must have shape (M, 2), time and {quantity}, got {table.shape}")
    array_1d(name, table.ravel())
    if np.any(np.diff(table[:, 0]) <= 0.0):
        raise ValueError(f"{name} must have rising times: sort its rows, and ramp where the {quantity} jumps")
    return functools.partial(cast(Any, np.interp), xp=table[:, 0], fp=table[:, 1])


def _for_all_times(temperature: Any) -> Any:
    """A plain number as a table that holds at all times."""
    if temperature is None or callable(temperature) or np.ndim(temperature) != 0:
        return temperature
    return [[0.0, finite("temperature", temperature)]]


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
