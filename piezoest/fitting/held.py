"""Readings that stand several times in a row, because the log was written faster than the sensor measures."""

from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.runs import BoolArray

REPEATED, STEADY, FEWEST_CHANGES = 2, 0.8, 10
# Steps of the sensor that a changed reading moves by, where it is held and not coarse.
HELD_STEPS = 5.0
# A voltage that is held for so many times as long as the reading explains it.
ALIKE = (0.5, 1.5)
# So many readings must be left.
FEWEST_READINGS = 64


def repeats(u: FloatArray, x: FloatArray) -> int:
    """How many times in a row each reading [µm] stands where all are held alike; 1 if they are not.

    Where the voltage [V] stands as long, the stage stands still.
    """
    changed = np.flatnonzero(np.diff(x) != 0.0)
    if changed.size < FEWEST_CHANGES:
        return 1
    lengths: Any = np.diff(changed)
    usual = int(np.median(lengths))
    steady = float(np.mean(np.abs(lengths - usual) <= 1)) > STEADY
    if usual < REPEATED or not steady:
        return 1
    # Coarse steps repeat values too, but then each change is by one step.
    moved = np.abs(np.diff(x)[changed])
    fine = float(np.median(moved)) > HELD_STEPS * float(np.min(moved))
    if not fine and np.unique(x).size <= 0.5 * changed.size:
        return 1
    stood = np.diff(np.flatnonzero(np.diff(u) != 0.0))
    longest = float(np.median(stood)) if stood.size else float(u.size)
    alike = longest >= REPEATED and ALIKE[0] * usual <= longest <= ALIKE[1] * usual
    return 1 if alike else usual


def held(u: FloatArray, x: FloatArray) -> BoolArray:
    """Which samples only repeat the reading before, shape (N,); none if the log is of no slow sensor.

    Of a reading that stands far longer than the others, as that of a sensor that is lost does, one sample is
    taken in the usual time. Voltage [V] and displacement [µm] are NaN where they are missing.
    """
    nothing = np.zeros(x.size, dtype=np.bool_)
    known = np.flatnonzero(np.isfinite(u) & np.isfinite(x))
    usual = repeats(u[known], x[known])
    if usual < REPEATED:
        return nothing
    y = x[known]
    first = np.append(True, np.diff(y) != 0.0)
    index = np.arange(y.size)
    age = index - np.maximum.accumulate(np.where(first, index, 0))
    read = first | ((age >= 2 * usual) & (age % usual == 0))
    if np.count_nonzero(read) < FEWEST_READINGS:
        return nothing
    nothing[known[~read]] = True
    return nothing
