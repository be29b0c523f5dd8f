"""The instruments around a stage: converter and amplifier before it, gauge and converter after it.

Each is a frozen description with the numbers made from it, `settings` (constants at a
sample rate) and `rest` (its state at rest), and one function per sample that works on them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, as_floats, finite, integer, non_negative, positive
from piezoest.compile import inlined
from piezoest.equations.filters import biquad_step, butterworth_low_pass
from piezoest.layout import COUNT, FIXED, MEASURED, Length, Record, numbers, record

# Coefficients of a section that leaves its input as it is.
_NO_FILTER = np.array([1.0, 0.0, 0.0, 0.0, 0.0])

# The last finite command and the output [V].
AMPLIFIER = record(command=MEASURED, output=MEASURED, filter=numbers(2))
AMPLIFIER_SETTINGS = record(
    minimum=FIXED, maximum=FIXED, resolution=FIXED, largest_change=FIXED, filter=numbers(5, kind=FIXED)
)
GAUGE_SETTINGS = record(
    noise=FIXED, bias=FIXED, minimum=FIXED, maximum=FIXED, resolution=FIXED, filter=numbers(5, kind=FIXED)
)


def gauge_layout(delay: int) -> Record:
    """Layout of a gauge's state; its delay line is a circular buffer of one more value than `delay`."""
    line = numbers(Length("length", delay + 1), kind=MEASURED)
    return record(place=COUNT, filter=numbers(2), line=line)


@inlined
def quantise(x: Any, resolution: Any) -> Any:
    """x rounded to the nearest multiple of `resolution`; zero stands for none."""
    return resolution * np.floor(x / resolution + 0.5) if resolution > 0.0 else x


@inlined
def clip(x: Any, minimum: Any, maximum: Any) -> Any:
    """x within [minimum, maximum]."""
    return min(max(x, minimum), maximum)


@inlined
def amplifier_step(state: Any, settings: Any, u: Any) -> Any:
    """Voltage at the stage for the commanded `u`.

    The order is that of the hardware: converter (range, steps), reconstruction filter, amplifier (range, slew
    rate).
    """
    low, high = settings.minimum, settings.maximum
    u = u if np.isfinite(u) else state.command
    state.command = u
    u = clip(quantise(clip(u, low, high), settings.resolution), low, high)
    u = clip(biquad_step(state.filter, u, settings.filter), low, high)
    u = clip(u, state.output - settings.largest_change, state.output + settings.largest_change)
    state.output = u
    return u


@inlined
def gauge_step(state: Any, line: Any, settings: Any, x: Any, noise: Any) -> Any:
    """Reading for the displacement `x`; `noise` is standard normal, `line` a circular buffer."""
    x = biquad_step(state.filter, x + settings.bias + settings.noise * noise, settings.filter)
    place = int(state.place)
    line[place] = x
    place = place + 1 if place + 1 < len(line) else 0
    state.place = place
    return clip(quantise(line[place], settings.resolution), settings.minimum, settings.maximum)


@dataclass(frozen=True, slots=True)
class Amplifier:
    """Digital-to-analogue converter, reconstruction filter and voltage amplifier.

    All voltages are those at the stage, after the amplifier's gain.

    Parameters
    ----------
    minimum, maximum : float
        Range of the output [V]; zero must lie within it.
    resolution : float
        Voltage step of the converter [V]; 0 for none.
    slew_rate : float
        Fastest change of the output [V/s].
    cutoff : float, optional
        Cut-off of the reconstruction filter, second-order Butterworth [Hz]; None for none.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> import piezoest as pz
    >>> amplifier = pz.Amplifier(minimum=-20.0, maximum=120.0, resolution=0.002, slew_rate=5e4)
    >>> stage = pz.SimulatedStage(10_000.0, pz.ColemanHodgdon(0.02, 0.12, 0.0036), amplifier=amplifier)
    """

    minimum: float = -np.inf
    maximum: float = np.inf
    resolution: float = 0.0
    slew_rate: float = np.inf
    cutoff: float | None = None

    def __post_init__(self) -> None:
        _check_range("V", self.minimum, self.maximum)
        non_negative("resolution", self.resolution)
        if self.slew_rate != np.inf:
            positive("slew_rate", self.slew_rate)
        if self.cutoff is not None:
            positive("cutoff", self.cutoff)

    def _settings(self, sample_rate: float) -> dict[str, Any]:
        """Settings of `amplifier_step` at `sample_rate` [Hz]."""
        return {
            "minimum": self.minimum,
            "maximum": self.maximum,
            "resolution": self.resolution,
            "largest_change": self.slew_rate / sample_rate,
            "filter": _filter("amplifier", self.cutoff, sample_rate),
        }


@dataclass(frozen=True, slots=True)
class Gauge:
    """Displacement gauge, anti-alias filter and analogue-to-digital converter.

    Parameters
    ----------
    noise : float
        Standard deviation of the white noise before the filter [µm].
    bias : float
        Constant added to the displacement [µm].
    cutoff : float, optional
        Cut-off of the anti-alias filter, second-order Butterworth [Hz]; None for none.
    delay : int
        Delay of the reading in whole samples.
    resolution : float
        Step of the converter [µm]; 0 for none.
    minimum, maximum : float
        Range of the reading [µm].

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> import piezoest as pz
    >>> gauge = pz.Gauge(noise=0.001, delay=2, resolution=0.0005)
    >>> stage = pz.SimulatedStage(1000.0, hysteresis=pz.ColemanHodgdon(0.02, 0.12, 0.0036), gauge=gauge)
    """

    noise: float = 0.0
    bias: float = 0.0
    cutoff: float | None = None
    delay: int = 0
    resolution: float = 0.0
    minimum: float = -np.inf
    maximum: float = np.inf

    def __post_init__(self) -> None:
        non_negative("noise", self.noise)
        finite("bias", self.bias)
        if self.cutoff is not None:
            positive("cutoff", self.cutoff)
        object.__setattr__(self, "delay", integer("delay", self.delay))
        non_negative("resolution", self.resolution)
        _check_range("µm", self.minimum, self.maximum)

    def _settings(self, sample_rate: float) -> dict[str, Any]:
        """Settings of `gauge_step` at `sample_rate` [Hz]."""
        names = ("noise", "bias", "minimum", "maximum", "resolution")
        values = {name: getattr(self, name) for name in names}
        return {**values, "filter": _filter("gauge", self.cutoff, sample_rate)}

    def _rest(self, x: float, sample_rate: float) -> dict[str, Any]:
        """State of `gauge_step` after a long time at x [µm]."""
        level = x + self.bias
        _, b1, b2, a1, a2 = _filter("gauge", self.cutoff, sample_rate)
        second = (b2 - a2) * level
        return {"filter": [(b1 - a1) * level + second, second], "line": level}


def _check_range(unit: str, minimum: Any, maximum: Any) -> None:
    low, high = (as_floats(name, each) for name, each in (("minimum", minimum), ("maximum", maximum)))
    if low.ndim or high.ndim or not low <= 0.0 <= high or low == high:
        raise ValueError(f"minimum and maximum must enclose 0 {unit}, got {minimum} and {maximum}")


def _filter(name: str, cutoff: float | None, sample_rate: float) -> FloatArray:
    if cutoff is None:
        return _NO_FILTER
    if cutoff >= 0.5 * sample_rate:
        raise ValueError(
            f"{name}.cutoff must lie below half the sample rate, got {cutoff:g} Hz at {sample_rate:g} Hz: "
            "raise sample_rate or pass cutoff=None"
        )
    return butterworth_low_pass(cutoff, sample_rate)
