"""The instruments around a stage: converter and amplifier before it, gauge and converter after it.

Each is a frozen description with two vectors made from it, `settings` (constants at a
sample rate) and `rest_state`, and one function per sample that works on them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray, finite, integer, non_negative, positive
from piezoest.equations.filters import biquad_step, butterworth_low_pass

_NO_FILTER = np.array([1.0, 0.0, 0.0, 0.0, 0.0])


@register_jitable
def quantise(x: Any, resolution: Any) -> Any:
    """x rounded to the nearest multiple of `resolution`; zero stands for none."""
    return resolution * np.floor(x / resolution + 0.5) if resolution > 0.0 else x


@register_jitable
def clip(x: Any, minimum: Any, maximum: Any) -> Any:
    """x within [minimum, maximum]."""
    return min(max(x, minimum), maximum)


@register_jitable
def finite_or_held(u: Any, held: Any) -> Any:
    """u, or `held` where u is NaN or infinite."""
    return u if np.isfinite(u) else held


@register_jitable
def next_place(place: Any, length: Any) -> Any:
    """The place after `place` in a ring of `length`."""
    return place + 1 if place + 1 < length else 0


@register_jitable
def amplifier_step(state: Any, filter_state: Any, u: Any, settings: Any, filter_coefficients: Any) -> Any:
    """Voltage at the stage for the commanded `u`; the states are updated in place.

    The order is that of the hardware: converter (range, steps), reconstruction filter,
    amplifier (range, slew rate). `state` is the last finite command and the output,
    `settings` (minimum, maximum, resolution, largest change per sample).
    """
    u = finite_or_held(u, state[0])
    state[0] = u
    u = clip(quantise(clip(u, settings[0], settings[1]), settings[2]), settings[0], settings[1])
    u = clip(biquad_step(filter_state, u, filter_coefficients), settings[0], settings[1])
    u = clip(u, state[1] - settings[3], state[1] + settings[3])
    state[1] = u
    return u


@register_jitable
def gauge_step(
    filter_state: Any, delay_line: Any, x: Any, noise: Any, settings: Any, filter_coefficients: Any
) -> Any:
    """Reading for the displacement `x`; `noise` is standard normal; the states are updated in place.

    `delay_line` is the place in it and a ring of one value more than the samples of delay,
    `settings` (noise, bias, minimum, maximum, resolution).
    """
    x = biquad_step(filter_state, x + settings[1] + settings[0] * noise, filter_coefficients)
    place = int(delay_line[0])
    delay_line[1 + place] = x
    place = next_place(place, delay_line.shape[0] - 1)
    delay_line[0] = place
    return clip(quantise(delay_line[1 + place], settings[4]), settings[2], settings[3])


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

    def _settings(self, sample_rate: float) -> FloatArray:
        """Settings (4,) and filter coefficients (5,) of `amplifier_step` at `sample_rate` [Hz]."""
        head = [self.minimum, self.maximum, self.resolution, self.slew_rate / sample_rate]
        return np.concatenate((head, _filter("amplifier", self.cutoff, sample_rate)))

    def _rest_state(self) -> FloatArray:
        """State and filter state (4,) of `amplifier_step` after a long time at 0 V."""
        return np.zeros(4)


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

    def _settings(self, sample_rate: float) -> FloatArray:
        """Settings (5,) and filter coefficients (5,) of `gauge_step` at `sample_rate` [Hz]."""
        head = [self.noise, self.bias, self.minimum, self.maximum, self.resolution]
        return np.concatenate((head, _filter("gauge", self.cutoff, sample_rate)))

    def _rest_state(self, x: float, settings: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter state (2,) and delay line of `gauge_step` after a long time at x [µm]."""
        level = x + self.bias
        _, b1, b2, a1, a2 = settings[5:]
        second = (b2 - a2) * level
        line = np.full(self.delay + 2, level)
        line[0] = 0.0
        return np.array([(b1 - a1) * level + second, second]), line


def _check_range(unit: str, minimum: Any, maximum: Any) -> None:
    if not minimum <= 0.0 <= maximum or minimum == maximum:
        raise ValueError(f"minimum and maximum must enclose 0 {unit}, got {minimum} and {maximum}")


def _filter(part: str, cutoff: float | None, sample_rate: float) -> FloatArray:
    if cutoff is None:
        return _NO_FILTER
    if cutoff >= 0.5 * sample_rate:
        raise ValueError(
            f"{part}.cutoff must lie below half the sample rate, got {cutoff:g} Hz at {sample_rate:g} Hz: "
            "raise sample_rate or pass cutoff=None"
        )
    return butterworth_low_pass(cutoff, sample_rate)
