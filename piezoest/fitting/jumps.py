"""Jumps of a sensor: steps of the displacement that stay and that the voltage does not explain."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import bridged
from piezoest.fitting.runs import BoolArray, IntArray
from piezoest.fitting.surprise import is_peak, scale_of, surprise

FEWEST_SAMPLES = 64
# A sample that is off by so many standard deviations is no noise, in the longest of logs.
UNUSUAL = 6.0
# A jump is at least so much of the range of the displacement: less does no harm to a fit.
SMALLEST_JUMP = 5e-3
# Part of the displacement that the voltage moves in a sample which a kink of the hysteresis may take or give;
# a jump is so many times what the voltage moves there.
KINK, CROSSED = 0.35, 1.5
# So many jumps, all of them in the direction of the motion, are the stage's own.
STICK_SLIP = 6
# Samples on either side of a jump that say how large it is; those that foresee a difference.
EACH_SIDE, FORESEE = 6, 4
# A step of a slow gauge takes some of the samples of such means; others are so many of them away, at least.
SLOW_STEP, ALONE = (4, 16), 3
# At most so many steps of a residual are looked at.
MOST_LEFT = 6


def jumps_of(
    log: Any, clean: FloatArray, missing: BoolArray, unknown: BoolArray
) -> tuple[IntArray, FloatArray]:
    """First samples after a jump, and the jumps [µm].

    `log`: voltage and displacement, with what belongs to them (`flaws`). `clean` (N,): the displacement with
    something sensible in the place of spikes [µm]. `missing`, `unknown` (N,): samples that were not read;
    those near which the voltage is not known. A gauge with a filter takes some samples for a step: means of
    so many samples jump as well.
    """
    place = np.flatnonzero(~missing)
    found, steps = _steps(log, clean, unknown, place[:, None])
    for width in SLOW_STEP:
        whole = place.size // width * width
        late, later = _steps(log, clean, unknown, place[:whole].reshape(-1, width))
        new = np.all(np.abs(late[:, None] - found) > ALONE * width, axis=1)
        found, steps = np.append(found, late[new]), np.append(steps, later[new])
    order = np.argsort(found)
    found, steps = found[order], steps[order]
    onward = np.sign(log.late[found] - log.late[found - 1])
    if found.size >= STICK_SLIP and np.all(steps * onward > 0.0):
        # A stage that moves in steps, always onward, is sticky: no sensor does that.
        return np.empty(0, np.int64), np.empty(0)
    return found, steps


def jumps_left(residual: FloatArray, size: float) -> IntArray:
    """First samples after what may be jumps that a fit has left: the largest steps of its residual, if any.

    A jump of about what the stage moves in a sample is seen only where a fit has taken the motion away. The
    residual [µm] is NaN where a sample does not count; `size` is the range of the displacement [µm].
    """
    known = np.flatnonzero(np.isfinite(residual))[:, None]
    nothing = np.zeros(residual.size)
    still = SimpleNamespace(late=nothing, explained=nothing, gain=0.0, range=size, quantum=0.0)
    found, steps = _steps(still, bridged(residual), np.zeros(residual.size, np.bool_), known)
    return found[np.argsort(-np.abs(steps), kind="stable")[:MOST_LEFT]]


def _steps(log: Any, clean: FloatArray, unknown: BoolArray, groups: IntArray) -> tuple[IntArray, FloatArray]:
    """Steps between one group of samples, of which the mean is taken, and the next."""
    n, width = groups.shape
    if n < FEWEST_SAMPLES:
        return np.empty(0, np.int64), np.empty(0)
    x, u = clean[groups].mean(axis=1), log.late[groups].mean(axis=1)
    # What the voltage moves between two groups may be a kink of the hysteresis, or a gap that it crosses.
    travel = log.gain * np.cumsum(np.abs(np.diff(log.late, prepend=log.late[0])))[groups[:, 0]]
    moving = np.diff(travel, append=travel[-1])
    explained = width * np.max(log.explained[groups], axis=1) + KINK * moving
    # What goes on by itself goes further where samples are missing.
    longer = np.diff(groups.mean(axis=1)) / width
    e = longer * surprise(np.diff(x) / longer, log.gain * np.diff(u) / longer, FORESEE)
    size, explained = np.abs(e), np.maximum(explained[1:], explained[:-1])
    near = np.convolve(np.any(unknown[groups], axis=1), np.ones(5), mode="same")[1:] > 0
    found = np.flatnonzero((size > np.maximum(UNUSUAL * scale_of(e), explained)) & ~near)
    found = found[is_peak(size, 4, found)] + 1
    found = found[(found >= EACH_SIDE) & (found < n - EACH_SIDE)]
    skipped = int(width > 1)
    apart = (groups[found, 0] - groups[found - 1, -1] - 1) / width + skipped
    steps, scatter = _step_at(x - log.gain * u, found, skipped, apart)
    about = np.clip(found[:, None] + np.arange(-EACH_SIDE, EACH_SIDE), 0, n - 1)
    smallest = np.maximum(
        max(SMALLEST_JUMP * log.range, 3.0 * log.quantum),
        CROSSED * (1.0 + skipped) * np.max(moving[about], axis=1),
    )
    stays = np.abs(steps) > np.maximum(np.maximum(smallest, explained[found - 1]), UNUSUAL * scatter)
    return groups[found[stays], 0], steps[stays]


def _step_at(
    h: FloatArray, found: IntArray, skipped: int, apart: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Steps between lines through a few samples before and after each place, and how far those scatter.

    `skipped`: samples from each place on that belong to neither side. `apart`: samples between both sides; if
    they are more than a line is drawn through, it leads anywhere, and the means have to step as well.
    """
    t = np.arange(EACH_SIDE) + 0.5
    middle = t - t.mean()
    ends, means, off = [], [], np.zeros(found.size)
    for places in (
        found[:, None] - 1 - np.arange(EACH_SIDE),
        found[:, None] + skipped + np.arange(EACH_SIDE),
    ):
        values = h[places]
        mean, slope = values.mean(axis=1), values @ middle / (middle @ middle)
        means.append(mean)
        ends.append(mean - slope * (t.mean() + 0.5 * apart))
        off += np.sum((values - mean[:, None] - slope[:, None] * middle) ** 2, axis=1)
    steps, plain = ends[1] - ends[0], means[1] - means[0]
    scatter = np.sqrt(off / (2.0 * EACH_SIDE - 4.0))
    far = (apart > EACH_SIDE) & (np.abs(plain) < np.abs(steps))
    return np.where(far, plain, steps), np.where(far, np.sqrt(2.0 / EACH_SIDE), 1.0) * scatter
