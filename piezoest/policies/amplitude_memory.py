"""Remembers what was learnt at each size of the swing, and uses it again."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray, fraction, instance, integer, moderate, positive
from piezoest.compile import inlined
from piezoest.layout import AMOUNT, COUNT, DISTANCE, MEASURED, Field, Length, numbers, record
from piezoest.models import AmplitudeProfile
from piezoest.policies.base import Conditions, Policy

# Swings alike before what they teach is stored, and unlike ones before the middle is given up.
ALIKE, UNLIKE = 2.0, 2.0
# Of each parameter only the shape is recalled: the offset keeps what the stage's history gave it.
ALPHA, OFFSET_SLOPE, SHAPE = 0, 3, 3
# With an alpha below this, relative to the start's, there is no offset to keep.
LEAST_ALPHA = 1e-9


@dataclass(frozen=True, slots=True)
class AmplitudeMemory(Policy):
    """Remember what was learnt at each amplitude, and start from it when the amplitude returns.

    The last paragraph of sec. IV of Eielsen et al. (2012): parameters scheduled by amplitude. At the end
    of a swing like those before it the mean estimate over the swing is stored with its size; when
    the size changes and it, or one on either side of it, is known, theta goes to what was stored,
    interpolated. See `HysteresisRLS.profile` and `AmplitudeProfile`.

    Parameters
    ----------
    places : int
        Amplitudes that are remembered, up to 1000; a further one replaces the nearest.
    tolerance : float
        Sizes with a smaller relative difference are the same amplitude.
    uncertainty : float
        Standard deviation of the stored parameters when they are used again, relative to the initial model.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    needs_swings = needs_discrete = needs_loop = True

    places: int = 8
    tolerance: float = 0.1
    uncertainty: float = 0.05

    def __post_init__(self) -> None:
        integer("places", self.places, 1, 1000)
        positive("tolerance", fraction("tolerance", self.tolerance, 0.0, 0.5))
        moderate("uncertainty", self.uncertainty)

    def numbers(self, at: Conditions) -> dict[str, float]:
        """Tolerance, and variance of what is recalled."""
        return {"tolerance": self.tolerance, "variance": self.uncertainty**2}

    def keeps(self, n: int) -> Field:
        """Sizes stored (0: none) and their theta, and what leads to the next.

        Size of swing at which theta stands, voltage in its middle, where the last swing began, swings of that
        size in a row, swings of another one; the travel in the sums of theta, and these.
        """
        places = Length("places", self.places)
        return record(
            size=DISTANCE, middle=MEASURED, began=MEASURED, steady=COUNT, odd=COUNT, travelled=AMOUNT,
            sums=numbers(n),
            sizes=numbers(places, kind=DISTANCE), thetas=numbers(places, n),
        )  # fmt: skip


@register_jitable
def _recall(own: Any, tolerance: Any, size: Any, theta: Any) -> bool:
    """Theta stored for a size of swing into `theta`, interpolated; False where it is not known."""
    below = above = -1
    low, high = 0.0, 0.0
    for i in range(len(own.sizes)):
        known = own.sizes[i]
        if known > low and known <= size * (1.0 + tolerance):
            below = i
            low = known
        if known >= size * (1.0 - tolerance) and (above < 0 or known < high):
            above = i
            high = known
    if below < 0 or above < 0:
        return False
    weight = 0.0
    if high > low:
        weight = min(max((size - low) / (high - low), 0.0), 1.0)
    n = len(theta)
    kept = theta[OFFSET_SLOPE] / theta[ALPHA] if n > SHAPE and abs(theta[ALPHA]) > LEAST_ALPHA else 0.0
    for i in range(min(n, SHAPE)):
        theta[i] = own.thetas[below, i] + weight * (own.thetas[above, i] - own.thetas[below, i])
    if n > SHAPE:
        theta[OFFSET_SLOPE] = kept * theta[ALPHA]
    return True


@register_jitable
def _store(own: Any, tolerance: Any, size: Any) -> None:
    """Put the mean theta of the swing at hand where its size belongs."""
    nearest, distance, empty = 0, 1e300, -1
    for i in range(len(own.sizes)):
        known = own.sizes[i]
        if known == 0.0:
            if empty < 0:
                empty = i
        elif abs(known - size) < distance:
            nearest = i
            distance = abs(known - size)
    same = distance <= tolerance * size
    if not same and empty >= 0:
        nearest = empty
    rate = 0.5 if same else 1.0
    own.sizes[nearest] += rate * (size - own.sizes[nearest])
    for i in range(len(own.sums)):
        own.thetas[nearest, i] += rate * (own.sums[i] / own.travelled - own.thetas[nearest, i])


@register_jitable
def _size_after_turn(own: Any, swing: Any, tolerance: Any) -> Any:
    """Store what a steady swing taught; the size of swing to expect now, 0 if it is as before."""
    size = abs(swing.turned - own.began)
    middle = 0.5 * (swing.turned + own.began)
    own.began = swing.turned
    expected = 0.0
    if abs(size - own.size) <= tolerance * own.size:
        own.steady += 1.0
        own.odd = 0.0
        own.middle = middle
        if own.steady >= ALIKE and own.travelled > 0.0:
            _store(own, tolerance, size)
    else:
        own.steady = 0.0
        own.odd += 1.0
        expected = 2.0 * abs(swing.turned - own.middle)
        if own.odd >= UNLIKE or own.size == 0.0:
            expected = size
            own.middle = middle
            own.odd = 0.0
    own.travelled = 0.0
    for i in range(len(own.sums)):
        own.sums[i] = 0.0
    return expected


@register_jitable
def _visit(own: Any, swing: Any, theta: Any, fraction: Any, tolerance: Any) -> bool:
    """At a turn store what a steady swing taught, or recall what is known of a new size (True then).

    Only there: amid a swing another theta would throw the inverse.
    """
    if swing.usual == 0.0:
        own.began = swing.turned
        return False
    new_size = 0.0
    if swing.since == 0.0:
        new_size = _size_after_turn(own, swing, tolerance)
    own.travelled += fraction
    for i in range(len(theta)):
        own.sums[i] += fraction * theta[i]
    if new_size == 0.0 or abs(new_size - own.size) <= tolerance * own.size:
        return False
    own.size = new_size
    own.steady = 0.0
    return _recall(own, tolerance, new_size, theta)


@register_jitable
def _enlarge(P: Any, variance: Any) -> None:
    """Let no variance of P be below `variance`."""
    for i in range(len(P)):
        P[i, i] = np.fmax(P[i, i], variance)


@inlined
def prepare(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Look at the swing, and start from what is known of it."""
    law = state.law
    if _visit(own, state.swing, law.theta, state.fraction, fixed.tolerance):
        _enlarge(law.P, fixed.variance)
        if state.error_covariance is not None:
            _enlarge(state.error_covariance, fixed.variance)
        law.resets += 1.0


def profile_of(own: Any, scale: FloatArray) -> AmplitudeProfile:
    """What is stored, as an `AmplitudeProfile`; `scale` of the parameters."""
    _check_is_on(own)
    known = np.flatnonzero(own["sizes"] > 0.0)
    sizes, first = np.unique(own["sizes"][known], return_index=True)
    return AmplitudeProfile(sizes, own["thetas"][known[first], :SHAPE] * scale[:SHAPE])


def store_profile(own: Any, scale: FloatArray, profile: AmplitudeProfile) -> None:
    """Remember a profile, and nothing else."""
    _check_is_on(own)
    instance("profile", profile, AmplitudeProfile, "an AmplitudeProfile")
    count, places = profile.swings.size, own["sizes"].size
    if count > places:
        raise ValueError(f"profile holds {count} swings, AmplitudeMemory has {places} places")
    own["sizes"], own["thetas"] = 0.0, 0.0
    own["sizes"][:count] = profile.swings
    own["thetas"][:count, :SHAPE] = profile.theta / scale[:SHAPE]


def _check_is_on(own: Any) -> None:
    if own.dtype.names is None:
        raise ValueError("this needs policies.AmplitudeMemory(): add it to the policies of HysteresisRLS")
