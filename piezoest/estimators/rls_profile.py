"""The memory of amplitudes of `HysteresisRLS`, in its flat state, as an `AmplitudeProfile` and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from piezoest._checks import FloatArray, positive
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as kernel
from piezoest.estimators import rls_policies as policies
from piezoest.estimators import swing
from piezoest.models import AmplitudeProfile

# Turns until the voltage swings as announced: the swing at hand may be a mixture of the old and the new.
MIXED = 2.0


def _places(state: FloatArray, config: FloatArray, scale: FloatArray) -> Any:
    """The policies' part of the state, and within it the places, shape (M, 5)."""
    count = int(config[kernel.PLACES])
    if count == 0:
        raise ValueError("this needs policies.AmplitudeMemory(): add it to the policies of HysteresisRLS")
    start = kernel.FRONT + int(law.state_size(scale.size))
    extra = state[start : start + int(config[kernel.EXTRA])]
    return extra, extra[policies.HEAD :].reshape(count, policies.PLACE)


def read(state: FloatArray, config: FloatArray, scale: FloatArray) -> AmplitudeProfile:
    """Profile of what is remembered."""
    _, places = _places(state, config, scale)
    known = places[places[:, 0] > 0.0]
    known = known[np.unique(known[:, 0], return_index=True)[1]]
    return AmplitudeProfile(known[:, 0].copy(), known[:, 1:4] * scale[:3])


def write(state: FloatArray, config: FloatArray, scale: FloatArray, profile: AmplitudeProfile) -> None:
    """Remember a profile, and nothing else."""
    _, places = _places(state, config, scale)
    if not isinstance(profile, AmplitudeProfile):
        raise ValueError(f"profile must be an AmplitudeProfile, got {profile!r}")
    if profile.swings.size > places.shape[0]:
        raise ValueError(
            f"profile holds {profile.swings.size} swings, AmplitudeMemory has {places.shape[0]} places"
        )
    places[:] = 0.0
    places[: profile.swings.size, 0] = profile.swings
    places[: profile.swings.size, 1:4] = profile.theta / scale[:3]


def announce(state: FloatArray, config: FloatArray, scale: FloatArray, amplitude: float) -> bool:
    """Take up what is known of an amplitude [µm]; False if that is nothing."""
    extra, places = _places(state, config, scale)
    profile = read(state, config, scale)
    if profile.swings.size == 0:
        positive("amplitude", amplitude)
        return False
    n, head = scale.size, kernel.FRONT + law.HEAD
    size = profile.swing_for(amplitude)
    tolerance = config[kernel.TOLERANCE]
    theta = state[head : head + n]
    if not policies.remembered(extra, n, places.shape[0], tolerance, size, theta):
        return False
    for start in (head + n, kernel.ERROR):
        policies.enlarge(state[start : start + n * n], n, config[kernel.RECALLED])
    extra[policies.AT], extra[policies.STEADY] = size, 0.0
    extra[policies.ANNOUNCED] = MIXED
    extra[policies.TRAVELLED : policies.HEAD] = 0.0
    extra[policies.BEGAN] = state[kernel.SWING + swing.TURNED]
    state[kernel.FRONT + law.RESETS] += 1.0
    return True
