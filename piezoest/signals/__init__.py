"""Reference trajectories that know their sample rate and their period.

Every function returns a `Signal`. The phase of a periodic signal is computed from the sample
index, never accumulated, so a frequency that does not divide the sample rate does not drift.
Values are in µm when the signal is a reference, in V when it is a voltage: the functions do not care.
"""

from piezoest.signals.sequences import (
    dwell,
    filtered_steps,
    from_array,
    maximal_length_sequence,
    prbs,
    random_walk,
)
from piezoest.signals.signal import Signal, check_continuity
from piezoest.signals.waves import amplitude_modulated, chirp, multi_amplitude, sine, triangle, two_tone

__all__ = [
    "Signal", "amplitude_modulated", "check_continuity", "chirp", "dwell", "filtered_steps", "from_array",
    "maximal_length_sequence", "multi_amplitude", "prbs", "random_walk", "sine", "triangle", "two_tone",
]  # fmt: skip
