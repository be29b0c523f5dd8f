"""Signals made of levels and of chance: low-passed steps, PRBS, random walk, dwell, and any array."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, finite, integer, non_negative, positive
from piezoest.signals._arguments import below_half, number_of_samples
from piezoest.signals.signal import Signal, smooth_rise


def dwell(level: float, duration: float, sample_rate: float) -> Signal:
    """Constant signal.

    Parameters
    ----------
    level : float
        µm.
    duration : float
        s; the number of samples is rounded.
    sample_rate : float
        Hz.

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
    >>> pz.signals.dwell(level=2.0, duration=0.5, sample_rate=1000.0)
    Signal('dwell', 500 samples at 1000 Hz, amplitude 2)
    """
    sample_rate = positive("sample_rate", sample_rate)
    n = number_of_samples("duration", positive("duration", duration), sample_rate)
    return Signal(np.full(n, finite("level", level)), sample_rate, None, "dwell")


def from_array(
    values: ArrayLike, sample_rate: float, period: float | None = None, name: str = "array"
) -> Signal:
    """Signal from samples of one's own.

    Parameters
    ----------
    values : array_like, shape (N,)
        Samples, finite, µm or V. Copied.
    sample_rate : float
        Hz.
    period : float, optional
        Samples per period.
    name : str
        For labels and messages.

    Returns
    -------
    Signal
        Jumps are kept: `check_continuity` refuses them.

    Raises
    ------
    ValueError
        If `values` is not of shape (N,), empty, or holds NaN or infinity.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.signals.from_array([0.0, 0.1, 0.2, 0.1], sample_rate=1000.0, period=4)
    Signal('array', 4 samples at 1000 Hz, period 4 samples, amplitude 0.2)
    """
    return Signal(array_1d("values", values, minimum_length=1), sample_rate, period, name)


def filtered_steps(
    levels: ArrayLike,
    dwell_times: ArrayLike,
    sample_rate: float,
    cutoff: float = 10.0,
    order: int = 2,
    start: float = 0.0,
    periods: int | None = None,
) -> Signal:
    """Low-pass a sequence of steps with a Butterworth filter.

    The second-order filter overshoots each step by 4.3 %; order 1 does not overshoot.

    Parameters
    ----------
    levels : array_like, shape (M,)
        Levels in their order, µm.
    dwell_times : float or array_like, shape (M,)
        Time from each step to the next, s. Edges are rounded to samples, their errors do not add up.
    sample_rate : float
        Hz.
    cutoff : float
        −3 dB frequency, Hz, below half the sample rate.
    order : int
        Of the filter.
    start : float
        Level at which the filter rests before the first step, µm; without effect if `periods` is given.
    periods : int, optional
        Repeat the levels so often. The signal then is the periodic steady state of the filter: it has no
        start-up transient and its first value is generally not zero.

    Returns
    -------
    Signal
        Period: the samples of all levels, if `periods` is given.

    Raises
    ------
    ValueError
        If an argument is out of its range, or `dwell_times` and `levels` differ in length.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.signals.filtered_steps([0.0, 2.0, 1.0], 0.1, sample_rate=1000.0, cutoff=50.0)
    Signal('filtered steps', 300 samples at 1000 Hz, amplitude 2.08889)
    """
    heights = array_1d("levels", levels, minimum_length=1)
    sample_rate = positive("sample_rate", sample_rate)
    if np.ndim(dwell_times) == 0:
        times = np.full(heights.size, positive("dwell_times", dwell_times))
    else:
        times = array_1d("dwell_times", dwell_times)
    if times.size != heights.size:
        raise ValueError(
            f"dwell_times must have one entry for each of the {heights.size} levels, got {times.size}: "
            "or pass one number for all"
        )
    edges = np.rint(np.cumsum(times) * sample_rate).astype(np.int64)
    counts = np.diff(edges, prepend=0)
    if np.any(counts < 1):
        raise ValueError(
            f"dwell_times must each be at least one sample, {1.0 / sample_rate:g} s, got "
            f"{float(times.min()):g} s"
        )
    steps = np.repeat(heights, counts)
    if periods is None:
        from scipy.signal import sosfilt

        start = finite("start", start)
        values = start + sosfilt(_butterworth(cutoff, order, sample_rate), steps - start)
        return Signal(values, sample_rate, None, "filtered steps")
    n = integer("periods", periods, 1)
    cycle = _periodic_low_pass(steps, cutoff, order, sample_rate)
    return Signal(np.tile(cycle, n), sample_rate, float(steps.size), "filtered steps")


def prbs(
    amplitude: float = 5.0,
    periods: int = 1,
    sample_rate: float = 50_000.0,
    bits: int = 5,
    chip_rate: float = 40.0,
    cutoff: float = 10.0,
    order: int = 2,
    start: Literal["sequence", "zero"] = "sequence",
    lead_in: float = 0.0,
) -> Signal:
    """Pseudo-random binary signal through a Butterworth low-pass, periodic.

    The defaults are the paper's: 31 chips of 1250 samples (25 ms) at 50 kHz, 38 750 samples a period, ±5 µm,
    second order, 10 Hz. The signal is the *periodic steady state* of the filter, its response to the sequence
    repeated for ever, so all periods are the same to the bit and none holds a start-up transient. The
    filter overshoots: the largest value is 1.09 times `amplitude`, 5.45 µm.

    Parameters
    ----------
    amplitude : float
        The sequence is ±amplitude before the filter, µm.
    periods : int
        Number of whole periods.
    sample_rate : float
        Hz, a whole multiple of `chip_rate`.
    bits : int
        Length of the shift register, 2 to 20: 2^bits − 1 chips in a period.
    chip_rate : float
        Chips per second, Hz.
    cutoff : float
        −3 dB frequency of the low-pass, Hz, below half the sample rate.
    order : int
        Of the low-pass.
    start : {"sequence", "zero"}
        Begin with the first chip, in general away from zero, or at the sample nearest to zero on the
        first rise through zero (the same periodic signal, begun later).
    lead_in : float
        Time, s, during which the signal is faded in from rest at zero before the first period, by a weight
        with two continuous derivatives. These samples come on top of `periods`.

    Returns
    -------
    Signal
        Period (2^bits − 1)·sample_rate/chip_rate.

    Raises
    ------
    ValueError
        If an argument is out of its range, or a chip is not a whole number of samples.

    Notes
    -----
    Eielsen, Gravdahl and Pettersen (2012), Sec. IV: "a length of 38 750 samples, a bandwidth of 40 Hz, a ±5
    µm range, and was filtered by a second-order low-pass Butterworth filter with a 10 Hz cut-off frequency".

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.signals.prbs(periods=2)
    Signal('PRBS', 77500 samples at 50000 Hz, period 38750 samples, amplitude 5.44962)
    """
    amplitude = non_negative("amplitude", amplitude)
    periods = integer("periods", periods, 1)
    sample_rate = positive("sample_rate", sample_rate)
    chip_rate = positive("chip_rate", chip_rate)
    lead_in = non_negative("lead_in", lead_in)
    chip = round(sample_rate / chip_rate)
    if chip < 1 or abs(chip * chip_rate - sample_rate) > 1e-9 * sample_rate:
        raise ValueError(
            f"chip_rate must divide sample_rate, {sample_rate:g} Hz, into whole samples, got "
            f"{chip_rate:g} Hz: use {sample_rate / max(chip, 1):.10g}"
        )
    steps = amplitude * np.repeat(maximal_length_sequence(bits), chip)
    cycle = _periodic_low_pass(steps, cutoff, order, sample_rate)
    if start == "zero":
        rise = int(np.flatnonzero((cycle <= 0.0) & (np.roll(cycle, -1) > 0.0))[0]) if amplitude else 0
        cycle = np.roll(cycle, -rise)
        if abs(cycle[1]) < abs(cycle[0]):
            cycle = np.roll(cycle, -1)
    elif start != "sequence":
        raise ValueError(f"start must be 'sequence' or 'zero', got {start!r}")
    values = np.concatenate([_faded_in(cycle, round(lead_in * sample_rate)), np.tile(cycle, periods)])
    return Signal(values, sample_rate, float(cycle.size), "PRBS")


def maximal_length_sequence(bits: int) -> FloatArray:
    """Maximal-length sequence of ±1.

    Its circular autocorrelation is 2^bits − 1 at lag zero and −1 at every other lag.

    Parameters
    ----------
    bits : int
        Length of the shift register, 2 to 20.

    Returns
    -------
    ndarray, shape (2^bits − 1,)
        +1 and −1; one +1 more than −1.

    Raises
    ------
    ValueError
        If `bits` is not a whole number from 2 to 20.

    Examples
    --------
    >>> import piezoest as pz
    >>> print(pz.signals.maximal_length_sequence(3))
    [ 1.  1.  1. -1.  1. -1. -1.]
    """
    bits = integer("bits", bits, 2)
    if bits > 20:
        raise ValueError(f"bits must be at most 20, got {bits}: that already is a million chips")
    from scipy.signal import max_len_seq

    return 2.0 * np.asarray(max_len_seq(bits)[0], dtype=np.float64) - 1.0


def random_walk(
    amplitude: float, bandwidth: float, duration: float, sample_rate: float, seed: int = 0
) -> Signal:
    """Band-limited random walk that starts at zero and returns to it.

    A Fourier series of the harmonics of 1/duration up to `bandwidth`, with normal coefficients that fall as
    1/frequency (the spectrum of a random walk), moved to start at zero and scaled to reach `amplitude`
    exactly. It contains nothing above `bandwidth` and repeats without a seam. The same seed gives the same
    curve at every sample rate, up to that scaling.

    Parameters
    ----------
    amplitude : float
        Largest absolute value, µm.
    bandwidth : float
        Hz, at least 1/duration, below half the sample rate.
    duration : float
        s; the number of samples is rounded.
    sample_rate : float
        Hz.
    seed : int
        Of the random numbers.

    Returns
    -------
    Signal
        Its period is its length.

    Raises
    ------
    ValueError
        If an argument is out of its range.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.signals.random_walk(5.0, bandwidth=20.0, duration=2.0, sample_rate=1000.0, seed=1)
    Signal('random walk', 2000 samples at 1000 Hz, period 2000 samples, amplitude 5)
    """
    amplitude = non_negative("amplitude", amplitude)
    sample_rate = positive("sample_rate", sample_rate)
    bandwidth = below_half("bandwidth", bandwidth, sample_rate)
    n = number_of_samples("duration", positive("duration", duration), sample_rate)
    harmonics = int(bandwidth * n / sample_rate + 1e-9)
    if harmonics < 1:
        raise ValueError(
            f"bandwidth must be at least 1/duration, {sample_rate / n:g} Hz, got {bandwidth:g} Hz: "
            "raise it or make the signal longer"
        )
    rng = np.random.default_rng(integer("seed", seed))
    # One pair of numbers for each harmonic: a wider band adds detail to the same curve.
    coefficients = rng.standard_normal((harmonics, 2)) / np.arange(1, harmonics + 1)[:, None]
    spectrum = np.zeros(n // 2 + 1, dtype=np.complex128)
    spectrum[1 : harmonics + 1] = coefficients[:, 0] - 1j * coefficients[:, 1]
    curve = np.fft.irfft(spectrum, n)
    curve -= curve[0]
    return Signal(curve * (amplitude / np.max(np.abs(curve))), sample_rate, float(n), "random walk")


def _periodic_low_pass(cycle: FloatArray, cutoff: float, order: int, sample_rate: float) -> FloatArray:
    """One period of the filter's response to `cycle` repeated for ever.

    The state at the start of a period is the one that the filter has again at its end: z = A^N z + z₁, with
    z₁ the end state from rest.
    """
    from scipy.signal import sosfilt

    sections = _butterworth(cutoff, order, sample_rate)
    shape = (sections.shape[0], 2)
    silence = np.zeros_like(cycle)
    forced = sosfilt(sections, cycle, zi=np.zeros(shape))[1].ravel()
    free = [sosfilt(sections, silence, zi=unit.reshape(shape))[1].ravel() for unit in np.eye(forced.size)]
    state = np.linalg.solve(np.eye(forced.size) - np.transpose(free), forced)
    return np.asarray(sosfilt(sections, cycle, zi=state.reshape(shape))[0], dtype=np.float64)


def _butterworth(cutoff: float, order: int, sample_rate: float) -> FloatArray:
    from scipy.signal import butter

    cutoff = below_half("cutoff", cutoff, sample_rate)
    order = integer("order", order, 1)
    return np.asarray(butter(order, cutoff, fs=sample_rate, output="sos"), dtype=np.float64)


def _faded_in(cycle: FloatArray, n: int) -> FloatArray:
    """Return the `n` samples before the start of a periodic signal, faded in from rest."""
    return np.asarray(smooth_rise(n) * cycle[np.arange(-n, 0) % cycle.size])
