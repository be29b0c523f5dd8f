"""Checks that the signals share."""

from piezoest._checks import positive

MOST_SAMPLES = 10**10  # 80 GB


def below_half(name: str, frequency: float, sample_rate: float) -> float:
    """Return a frequency (Hz) above zero and below half the sample rate."""
    frequency = positive(name, frequency)
    if frequency >= 0.5 * sample_rate:
        raise ValueError(
            f"{name} must be below half the sample rate, {0.5 * sample_rate:g} Hz, got {frequency:g} Hz: "
            f"lower {name} or raise sample_rate"
        )
    return frequency


def number_of_samples(name: str, duration: float, sample_rate: float) -> int:
    """Return the samples in a duration (s), rounded, at least one, and no more than memory can hold."""
    n = round(min(duration * sample_rate, 2.0 * MOST_SAMPLES))
    if n > MOST_SAMPLES:
        raise ValueError(
            f"{name} must cover at most {MOST_SAMPLES:g} samples, got {duration:g} s at {sample_rate:g} Hz"
        )
    if n < 1:
        raise ValueError(f"{name} must cover at least one sample, got {duration:g} s at {sample_rate:g} Hz")
    return n
