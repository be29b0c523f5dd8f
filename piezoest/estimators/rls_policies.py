"""Compiled parts of the policies that `HysteresisRLS` has off by default, in a state of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.equations import admissible, least_squares
from piezoest.estimators import swing

# State, there only where a policy needs it. The innovation's energy: cumulative sum of what is
# unusual, usual energy, swings (up to two) that it is known from. The gate: whether it is shut,
# samples until it is looked at again.
SUM, USUAL, WAY, SHUT, LOOK = range(5)
# The memory of amplitudes: size of swing at which theta stands, voltage in its middle, where the last swing
# began, swings of that size in a row, swings of another one, turns for which an announcement
# holds; way in the sums, and the sums of theta over it.
AT, MIDDLE, BEGAN, STEADY, ODD, ANNOUNCED, TRAVELLED, SUMS, HEAD = 5, 6, 7, 8, 9, 10, 11, 12, 16
# Each place: size of swing [V], 0 while empty, and theta[:4].
PLACE = 5

# Swings over which the usual energy is learnt, and samples between two looks at the excitation.
ENOUGH, EVERY = 2.0, 64.0
# Swings alike before what they teach is stored, and unlike ones before the middle is given up.
ALIKE, UNLIKE = 2.0, 2.0
# Of each parameter only the shape is taken up: the offset keeps what the stage's history gave it.
ALPHA, OFFSET_SLOPE, SHAPE = 0, 3, 3
# With an alpha below this, in parts of the start's, there is no offset to keep.
LEAST_ALPHA = 1e-9


@register_jitable
def project(theta: Any, P: Any, n: Any, scale: Any, least: Any, margin: Any, work: Any) -> None:
    """Move the scaled theta to the nearest admissible point in the metric of P; `work` has n + n*n."""
    alpha_least = least * scale[0] / scale[4]
    beta_least = least * scale[1] / scale[4]
    for i in range(n):
        work[i] = theta[i] * scale[i] / scale[4]
    if admissible.is_admissible(work[0], work[1], work[2], alpha_least, beta_least, margin) != 0.0:
        return
    for i in range(n):
        for j in range(n):
            work[n + i * n + j] = P[i * n + j] * (scale[i] / scale[4]) * (scale[j] / scale[4])
    if admissible.project_admissible(work, work[n:], n, alpha_least, beta_least, margin):
        for i in range(n):
            theta[i] = work[i] * scale[4] / scale[i]


@register_jitable
def gate(extra: Any, mean: Any, n: Any, least: Any, work: Any) -> None:
    """Shut or open the gate: whether the least eigenvalue of `mean` is `least` of its mean eigenvalue."""
    extra[LOOK] -= 1.0
    if extra[LOOK] <= 0.0:
        extra[LOOK] = EVERY
        size = least_squares.trace(mean, n) / n
        extra[SHUT] = 1.0 - least_squares.above_floor(mean, n, least * size, work)


@register_jitable
def changed(extra: Any, y: Any, S: Any, part: Any, threshold: Any, drift: Any) -> bool:
    """Take an innovation over a part of a swing; True where the sum of what is unusual passes `threshold`."""
    energy = y * y / S
    if extra[WAY] >= ENOUGH and threshold > 0.0:
        excess = energy / max(extra[USUAL], 1e-30)
        extra[SUM] = least_squares.cusum(extra[SUM], excess * part, (1.0 + drift) * part)
        if extra[SUM] > threshold:
            extra[SUM] = extra[WAY] = 0.0
            return True
    extra[WAY] = min(extra[WAY] + part, ENOUGH)
    extra[USUAL] += (energy - extra[USUAL]) * part / max(extra[WAY], 1e-12)
    return False


@register_jitable
def nominal(extra: Any, forgetting: Any) -> Any:
    """Factor that gives the memory wanted at the usual energy; as good as 1 until that is known."""
    if extra[WAY] < ENOUGH:
        return 1.0 - (1.0 - forgetting) / 1e30
    return 1.0 - (1.0 - forgetting) / max(extra[USUAL], 1e-30)


@register_jitable
def remembered(extra: Any, n: Any, places: Any, tolerance: Any, size: Any, theta: Any) -> bool:
    """Theta stored for a size of swing into `theta`, interpolated; False where it is not known."""
    below = above = -1
    low, high = 0.0, 0.0
    for i in range(places):
        known = extra[HEAD + PLACE * i]
        if known > low and known <= size * (1.0 + tolerance):
            below = HEAD + PLACE * i
            low = known
        if known >= size * (1.0 - tolerance) and (above < 0 or known < high):
            above = HEAD + PLACE * i
            high = known
    if below < 0 or above < 0:
        return False
    weight = 0.0
    if high > low:
        weight = min(max((size - low) / (high - low), 0.0), 1.0)
    kept = theta[OFFSET_SLOPE] / theta[ALPHA] if n > SHAPE and abs(theta[ALPHA]) > LEAST_ALPHA else 0.0
    for i in range(min(n, SHAPE)):
        theta[i] = extra[below + 1 + i] + weight * (extra[above + 1 + i] - extra[below + 1 + i])
    if n > SHAPE:
        theta[OFFSET_SLOPE] = kept * theta[ALPHA]
    return True


@register_jitable
def store(extra: Any, n: Any, places: Any, tolerance: Any, size: Any) -> None:
    """Put the mean theta of the swing at hand where its size belongs."""
    nearest, distance, empty = 0, 1e300, -1
    for i in range(places):
        known = extra[HEAD + PLACE * i]
        if known == 0.0:
            if empty < 0:
                empty = i
        elif abs(known - size) < distance:
            nearest = i
            distance = abs(known - size)
    same = distance <= tolerance * size
    if not same and empty >= 0:
        nearest = empty
    place = HEAD + PLACE * nearest
    rate = 0.5 if same else 1.0
    extra[place] += rate * (size - extra[place])
    for i in range(n):
        extra[place + 1 + i] += rate * (extra[SUMS + i] / extra[TRAVELLED] - extra[place + 1 + i])


@register_jitable
def visit(extra: Any, clock: Any, theta: Any, n: Any, part: Any, places: Any, tolerance: Any) -> bool:
    """At a turn store what a steady swing taught, or take up what is known of a new size (True then).

    Only there: amid a swing another theta would throw the inverse.
    """
    if clock[swing.USUAL] == 0.0:
        extra[BEGAN] = clock[swing.TURNED]
        return False
    new_size = 0.0
    if clock[swing.SINCE] == 0.0:
        size = abs(clock[swing.TURNED] - extra[BEGAN])
        middle = 0.5 * (clock[swing.TURNED] + extra[BEGAN])
        extra[BEGAN] = clock[swing.TURNED]
        extra[ANNOUNCED] = max(extra[ANNOUNCED] - 1.0, 0.0)
        if abs(size - extra[AT]) <= tolerance * extra[AT]:
            extra[STEADY] += 1.0
            extra[ODD] = 0.0
            extra[MIDDLE] = middle
            if extra[STEADY] >= ALIKE and extra[TRAVELLED] > 0.0:
                store(extra, n, places, tolerance, size)
        elif extra[ANNOUNCED] == 0.0:
            extra[STEADY] = 0.0
            extra[ODD] += 1.0
            new_size = 2.0 * abs(clock[swing.TURNED] - extra[MIDDLE])
            if extra[ODD] >= UNLIKE or extra[AT] == 0.0:
                new_size = size
                extra[MIDDLE] = middle
                extra[ODD] = 0.0
        for i in range(n + 1):
            extra[TRAVELLED + i] = 0.0
    extra[TRAVELLED] += part
    for i in range(n):
        extra[SUMS + i] += part * theta[i]
    if new_size == 0.0 or abs(new_size - extra[AT]) <= tolerance * extra[AT]:
        return False
    extra[AT] = new_size
    extra[STEADY] = 0.0
    return remembered(extra, n, places, tolerance, new_size, theta)


@register_jitable
def enlarge(P: Any, n: Any, variance: Any) -> None:
    """Let no variance of P (n*n,) be below `variance`."""
    for i in range(n):
        P[i * n + i] = np.fmax(P[i * n + i], variance)
