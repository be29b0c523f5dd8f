"""Waves with a closed form: triangle, sine, modulated and multi-amplitude waves, two tones, chirp."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Literal

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, finite, fraction, integer, non_negative, positive
from piezoest.signals._arguments import below_half, number_of_samples
from piezoest.signals.signal import Signal

Shape = Literal["triangle", "sine"]
HIGHEST_CONTINUITY = 8  # above it the corner's coefficients cancel, and the corner hardly changes


def triangle(
    amplitude: float,
    frequency: float,
    periods: float,
    sample_rate: float,
    smoothing: float = 0.1,
    continuity: int = 3,
    phase: float = 0.0,
    *,
    exact_peak: bool = False,
) -> Signal:
    """Triangle wave with rounded corners; it peaks at about 97 % of `amplitude`.

    ``triangle(amplitude=5.0, ...)`` peaks at 4.84, because its corners are rounded as in the paper. With
    ``exact_peak=True`` it peaks at 5.0.

    The ideal triangle of the nominal amplitude keeps its slopes, ±4·amplitude·frequency, and its straight
    lines up to (1 − smoothing)·amplitude. Around each of the two extrema of a period, `smoothing`/2 of the
    period is replaced by the even polynomial of lowest degree that joins the straight lines with `continuity`
    continuous derivatives. For order k it has degree 2k. With s = −1…1 across the corner its curvature is
    proportional to (1 − s²)^(k−1), and the wave at a maximum is amplitude·(1 − smoothing·φ(s)):

    - k = 1: φ = (1 + s²)/2, a parabola;
    - k = 2: φ = (3 + 6s² − s⁴)/8;
    - k = 3: φ = (5 + 15s² − 5s⁴ + s⁶)/16.

    The wave therefore turns *below* the nominal amplitude, at amplitude·(1 − smoothing·φ(0)). With the
    paper's 10 % that is 0.95, 0.9625, 0.969, 0.973, … of it for k = 1, 2, 3, 4, …, and the straight lines
    end at 90 %: Fig. 4, "5.0 µm amplitude (4.5 µm linear range)". The paper does not name its polynomial;
    the ratios of maximum to relative error in its Tables II and III put the peak between 0.966 and 0.984 of
    the nominal amplitude, which fits k of 3 or more and misses k = 2 by 0.3 %.

    Parameters
    ----------
    amplitude : float
        Nominal amplitude, that of the ideal triangle (µm).
    frequency : float
        Hz, below half the sample rate.
    periods : float
        Number of periods; the number of samples is rounded.
    sample_rate : float
        Hz.
    smoothing : float
        Fraction of the period that is replaced, 0 (ideal triangle) to 1 (no straight line left).
    continuity : int
        Number of continuous derivatives, 1 to 8.
    phase : float
        Start, in periods. 0: at zero, rising.
    exact_peak : bool
        Scale the wave so that its peak, not that of the ideal triangle, is `amplitude`.

    Returns
    -------
    Signal
        Period sample_rate/frequency.

    Raises
    ------
    ValueError
        If an argument is out of its range.

    Notes
    -----
    Eielsen, Gravdahl and Pettersen (2012), Sec. IV and Fig. 4.

    Examples
    --------
    >>> import piezoest as pz
    >>> r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=2, sample_rate=1000.0)
    >>> r
    Signal('triangle', 400 samples at 1000 Hz, period 200 samples, amplitude 4.84375)
    """
    amplitude = non_negative("amplitude", amplitude)
    sample_rate = positive("sample_rate", sample_rate)
    frequency = below_half("frequency", frequency, sample_rate)
    n = number_of_samples("periods", positive("periods", periods) / frequency, sample_rate)
    _, turns = _turns(n, frequency, sample_rate, finite("phase", phase))
    wave = _unit_wave(turns, "triangle", smoothing, continuity)
    if exact_peak:
        wave /= _unit_wave(np.array([0.25]), "triangle", smoothing, continuity)
    return Signal(amplitude * wave, sample_rate, sample_rate / frequency, "triangle")


def sine(
    amplitude: float, frequency: float, periods: float, sample_rate: float, phase: float = 0.0
) -> Signal:
    """Sine wave, amplitude·sin(2π(frequency·t + phase)).

    Parameters
    ----------
    amplitude, frequency, periods, sample_rate, phase
        As in `triangle`.

    Returns
    -------
    Signal
        Period sample_rate/frequency.

    Raises
    ------
    ValueError
        If an argument is out of its range.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.signals.sine(amplitude=5.0, frequency=5.0, periods=2, sample_rate=1000.0)
    Signal('sine', 400 samples at 1000 Hz, period 200 samples, amplitude 5)
    """
    amplitude = non_negative("amplitude", amplitude)
    sample_rate = positive("sample_rate", sample_rate)
    frequency = below_half("frequency", frequency, sample_rate)
    n = number_of_samples("periods", positive("periods", periods) / frequency, sample_rate)
    _, turns = _turns(n, frequency, sample_rate, finite("phase", phase))
    return Signal(amplitude * np.sin(2.0 * np.pi * turns), sample_rate, sample_rate / frequency, "sine")


def amplitude_modulated(
    amplitude: float,
    frequency: float,
    modulation_frequency: float,
    duration: float,
    sample_rate: float,
    depth: float = 0.5,
    shape: Shape = "sine",
    smoothing: float = 0.1,
    continuity: int = 3,
) -> Signal:
    """Wave whose amplitude swings between `amplitude` and (1 − depth)·`amplitude`.

    The envelope is amplitude·(1 − depth·(1 − cos(2π·modulation_frequency·t))/2); it starts at its largest,
    the wave starts at zero, rising.

    Parameters
    ----------
    amplitude : float
        Largest (nominal) amplitude, µm.
    frequency, modulation_frequency : float
        Of the wave and of its envelope, Hz, below half the sample rate.
    duration : float
        s; the number of samples is rounded.
    sample_rate : float
        Hz.
    depth : float
        0 (no modulation) to 1 (down to nothing).
    shape : {"sine", "triangle"}
        Of the wave.
    smoothing, continuity
        As in `triangle`.

    Returns
    -------
    Signal
        The period is the common one of wave and envelope, None if their frequencies have no simple ratio.

    Raises
    ------
    ValueError
        If an argument is out of its range.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.signals.amplitude_modulated(5.0, 10.0, 1.0, duration=2.0, sample_rate=1000.0, depth=0.5)
    Signal('amplitude-modulated sine', 2000 samples at 1000 Hz, period 1000 samples, amplitude 4.98461)
    """
    amplitude = non_negative("amplitude", amplitude)
    depth = fraction("depth", depth)
    sample_rate = positive("sample_rate", sample_rate)
    frequency = below_half("frequency", frequency, sample_rate)
    modulation_frequency = below_half("modulation_frequency", modulation_frequency, sample_rate)
    n = number_of_samples("duration", positive("duration", duration), sample_rate)
    _, turns = _turns(n, frequency, sample_rate)
    _, envelope_turns = _turns(n, modulation_frequency, sample_rate)
    envelope = amplitude * (1.0 - depth * 0.5 * (1.0 - np.cos(2.0 * np.pi * envelope_turns)))
    values = envelope * _unit_wave(turns, shape, smoothing, continuity)
    period = _common_period(frequency, modulation_frequency, sample_rate)
    return Signal(values, sample_rate, period, f"amplitude-modulated {shape}")


def multi_amplitude(
    amplitudes: Sequence[float] | FloatArray,
    frequency: float,
    periods: int | Sequence[int],
    sample_rate: float,
    shape: Shape = "triangle",
    smoothing: float = 0.1,
    continuity: int = 3,
) -> Signal:
    """Wave that changes its amplitude at zero crossings.

    Each amplitude lasts for a whole number of periods, which begin and end at zero: the values are continuous
    at every change, the slope is not.

    Parameters
    ----------
    amplitudes : sequence of float, shape (M,)
        Nominal amplitudes in their order, µm; 0 is a rest.
    frequency : float
        Hz, below half the sample rate.
    periods : int or sequence of int, shape (M,)
        Whole periods for each amplitude.
    sample_rate : float
        Hz.
    shape : {"triangle", "sine"}
        Of the wave.
    smoothing, continuity
        As in `triangle`.

    Returns
    -------
    Signal
        Its period is that of one wave, sample_rate/frequency, although the amplitude changes: it is the
        interval over which errors are compared.

    Raises
    ------
    ValueError
        If an argument is out of its range, or `periods` and `amplitudes` differ in length.
    """
    levels = array_1d("amplitudes", amplitudes, minimum_length=1)
    if np.any(levels < 0.0):
        worst = int(levels.argmin())
        raise ValueError(f"amplitudes must be zero or more, got {levels[worst]:g} at index {worst}")
    if np.ndim(periods) == 0:
        counts = np.full(levels.size, integer("periods", periods, 1))
    else:
        counts = np.array([integer(f"periods[{i}]", count, 1) for i, count in enumerate(np.asarray(periods))])
    if counts.size != levels.size:
        raise ValueError(
            f"periods must have one entry for each of the {levels.size} amplitudes, got {counts.size}: "
            "or pass one number for all"
        )
    sample_rate = positive("sample_rate", sample_rate)
    frequency = below_half("frequency", frequency, sample_rate)
    n = number_of_samples("periods", float(counts.sum()) / frequency, sample_rate)
    cycle, turns = _turns(n, frequency, sample_rate)
    segment = np.searchsorted(np.cumsum(counts), cycle, side="right")
    values = levels[np.minimum(segment, levels.size - 1)] * _unit_wave(turns, shape, smoothing, continuity)
    return Signal(values, sample_rate, sample_rate / frequency, f"multi-amplitude {shape}")


def two_tone(amplitudes: ArrayLike, frequencies: ArrayLike, duration: float, sample_rate: float) -> Signal:
    """Sum of two sines, both starting at zero, rising.

    Parameters
    ----------
    amplitudes : sequence of float, shape (2,)
        µm.
    frequencies : sequence of float, shape (2,)
        Hz, below half the sample rate.
    duration : float
        s; the number of samples is rounded.
    sample_rate : float
        Hz.

    Returns
    -------
    Signal
        The period is the common one, None if the frequencies have no simple ratio.

    Raises
    ------
    ValueError
        If an argument is out of its range or there are not two tones.
    """
    heights = array_1d("amplitudes", amplitudes)
    rates = array_1d("frequencies", frequencies)
    for name, pair in (("amplitudes", heights), ("frequencies", rates)):
        if pair.size != 2:
            raise ValueError(f"{name} must hold two numbers, one for each tone, got {pair.size}")
    sample_rate = positive("sample_rate", sample_rate)
    first, second = (below_half(f"frequencies[{i}]", rate, sample_rate) for i, rate in enumerate(rates))
    n = number_of_samples("duration", positive("duration", duration), sample_rate)
    values = np.zeros(n)
    for i, frequency in enumerate((first, second)):
        _, turns = _turns(n, frequency, sample_rate)
        values += non_negative(f"amplitudes[{i}]", heights[i]) * np.sin(2.0 * np.pi * turns)
    return Signal(values, sample_rate, _common_period(first, second, sample_rate), "two-tone")


def chirp(
    amplitude: float,
    start_frequency: float,
    stop_frequency: float,
    duration: float,
    sample_rate: float,
    method: Literal["linear", "logarithmic"] = "linear",
) -> Signal:
    """Sine whose frequency runs from `start_frequency` to `stop_frequency`; starts at zero, rising.

    Parameters
    ----------
    amplitude : float
        µm.
    start_frequency, stop_frequency : float
        Hz, below half the sample rate, in either order.
    duration : float
        s; the number of samples is rounded.
    sample_rate : float
        Hz.
    method : {"linear", "logarithmic"}
        The same number of hertz, or of octaves, in every second.

    Returns
    -------
    Signal
        Not periodic.

    Raises
    ------
    ValueError
        If an argument is out of its range.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.signals.chirp(5.0, start_frequency=1.0, stop_frequency=50.0, duration=2.0, sample_rate=1000.0)
    Signal('linear chirp', 2000 samples at 1000 Hz, amplitude 5)
    """
    amplitude = non_negative("amplitude", amplitude)
    sample_rate = positive("sample_rate", sample_rate)
    start = below_half("start_frequency", start_frequency, sample_rate)
    stop = below_half("stop_frequency", stop_frequency, sample_rate)
    duration = positive("duration", duration)
    t = np.arange(number_of_samples("duration", duration, sample_rate)) / sample_rate
    if method not in ("linear", "logarithmic"):
        raise ValueError(f"method must be 'linear' or 'logarithmic', got {method!r}")
    if method == "linear" or start == stop:
        turns = start * t + (stop - start) * t * t / (2.0 * duration)
    else:
        rate = np.log(stop / start) / duration
        turns = start * np.expm1(rate * t) / rate
    return Signal(amplitude * np.sin(2.0 * np.pi * (turns % 1.0)), sample_rate, None, f"{method} chirp")


def _turns(n: int, frequency: float, sample_rate: float, phase: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Count the whole periods before each sample, and give the phase within the period, in [0, 1)."""
    # The remainder is exact, so periods of a whole number of samples repeat bit for bit.
    cycle, rest = np.divmod(np.arange(n) * frequency, sample_rate)
    return cycle, (rest / sample_rate + phase) % 1.0


def _unit_wave(turns: FloatArray, shape: Shape, smoothing: float, continuity: int) -> FloatArray:
    """Return the wave of nominal amplitude 1 at phases in [0, 1), zero and rising at 0."""
    smoothing = fraction("smoothing", smoothing)
    continuity = integer("continuity", continuity, 1)
    if continuity > HIGHEST_CONTINUITY:
        raise ValueError(f"continuity must be at most {HIGHEST_CONTINUITY}, got {continuity}")
    if shape == "sine":
        return np.asarray(np.sin(2.0 * np.pi * turns))
    if shape != "triangle":
        raise ValueError(f"shape must be 'triangle' or 'sine', got {shape!r}")
    # Distances in periods: to the maximum at phase 1/4 (0 to 1/2), and to the nearer extremum (0 to 1/4).
    from_top = np.abs((turns + 0.25) % 1.0 - 0.5)
    distance = np.minimum(from_top, 0.5 - from_top)
    height = 1.0 - 4.0 * distance
    reach = 0.25 * smoothing
    corner = distance < reach
    if np.any(corner):
        height[corner] = 1.0 - smoothing * _corner_polynomial(continuity)(distance[corner] / reach)
    return np.asarray(np.where(from_top <= 0.25, height, -height))


def _corner_polynomial(continuity: int) -> Polynomial:
    """Build the even polynomial φ of degree 2k with φ(1) = φ'(1) = 1, φ''(1) = … = 0 up to order k."""
    slope = (Polynomial([1.0, 0.0, -1.0]) ** (continuity - 1)).integ()
    slope = slope / slope(1.0)
    corner = slope.integ()
    return corner - (corner(1.0) - 1.0)


def _common_period(first: float, second: float, sample_rate: float) -> float | None:
    """Return the common period in samples, None if the ratio of the frequencies is not simple."""
    low, high = sorted((first, second))
    ratio = Fraction(high / low).limit_denominator(1000)
    if abs(float(ratio) * low - high) > 1e-12 * high:
        return None
    return ratio.denominator * sample_rate / low
